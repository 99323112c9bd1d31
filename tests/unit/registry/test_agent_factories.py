"""Options in the name of an agent reach its class, and what it tells of its agents stays what the class tells."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar

import pytest

from pytest_drive_robust.domain.agent import has_portable_bits
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.registry.agent_factories import check_of
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.runner.cache_key.identity import agent_identity
from pytest_drive_robust.testing import ScriptedAgent


class Configurable(ScriptedAgent):
    portable_bits = True
    weights = ("some.bin",)

    def __init__(
        self, speed: float = 8.0, *, mode: str = "traj", ahead: int = 3, keen: bool = False, aim: str | None = None
    ):
        super().__init__([Control()])
        self.given = (speed, mode, ahead, keen, aim)


class TakesNothing(ScriptedAgent):
    def __init__(self) -> None:
        super().__init__([Control()])


class Checked(Configurable):
    asked: ClassVar[list[float]] = []

    @classmethod
    def check(cls, speed: float = 8.0) -> None:
        cls.asked.append(speed)


@pytest.fixture
def registry() -> Registry:
    registry = Registry()
    registry.register_agent("mine", Configurable)
    registry.register_agent("bare", TakesNothing)
    registry.register_agent("checked", Checked)
    return registry


@pytest.mark.parametrize(
    ("name", "given"),
    [
        ("mine", (8.0, "traj", 3, False, None)),
        ("mine:speed=4", (4.0, "traj", 3, False, None)),
        ("mine:mode=ctrl+ahead=5+keen=true+aim=far", (8.0, "ctrl", 5, True, "far")),
    ],
)
def test_options_have_the_type_of_their_defaults(registry: Registry, name: str, given: tuple[object, ...]) -> None:
    assert registry.agent(name).given == given  # type: ignore[attr-defined]
    assert registry.entry("agents", name).name == name


def test_a_path_may_be_an_option_and_its_file_belongs_to_the_weights(tmp_path: Path) -> None:
    class Loads(ScriptedAgent):
        def __init__(self, model: Path = tmp_path / "usual.bin") -> None:
            super().__init__([Control()])
            self.model = model

    own = tmp_path / "own.bin"
    own.write_bytes(b"own")
    registry = Registry()
    registry.register_agent("loads", Loads)
    name = f"loads:model={own}"
    assert registry.agent(name).model == own  # type: ignore[attr-defined]
    assert registry.entry("agents", name).load().weights == [own]  # type: ignore[attr-defined]


def test_what_the_class_tells_of_its_agents_the_configured_factory_tells(registry: Registry) -> None:
    factory = registry.entry("agents", "mine:speed=4").load()
    assert has_portable_bits(factory)
    assert factory.weights == ("some.bin",)  # type: ignore[attr-defined]
    assert not hasattr(factory, "num_gpus")


@pytest.mark.parametrize("name", ["slow", "slow:ahead=5"])
@pytest.mark.parametrize("says_more", [False, True])
def test_a_partial_tells_what_its_class_tells_and_what_is_said_of_it(
    registry: Registry, name: str, says_more: bool
) -> None:
    slow = functools.partial(Configurable, 2.0, mode="ctrl")
    if says_more:
        vars(slow).update(num_gpus=1)
    registry.register_agent("slow", slow)
    factory = registry.entry("agents", name).load()
    assert has_portable_bits(factory)
    assert factory.weights == ("some.bin",)  # type: ignore[attr-defined]
    assert getattr(factory, "num_gpus", 0) == says_more
    assert factory().given == (2.0, "ctrl", 5 if ":" in name else 3, False, None)  # type: ignore[operator]


@pytest.mark.parametrize("kind", [str, Path])
def test_a_partial_adds_the_file_that_it_is_given_to_the_weights_and_may_say_others(
    registry: Registry, tmp_path: Path, kind: Callable[[Path], object]
) -> None:
    file = tmp_path / "aim.bin"
    file.touch()
    given = functools.partial(Configurable, aim=kind(file))
    registry.register_agent("given", given)
    assert registry.entry("agents", "given").load().weights == ["some.bin", kind(file)]  # type: ignore[attr-defined]
    vars(given).update(weights=("other.bin",))
    assert registry.entry("agents", "given").load().weights == ["other.bin", kind(file)]  # type: ignore[attr-defined]


def test_the_check_of_a_partial_is_given_its_parameters(registry: Registry) -> None:
    Checked.asked.clear()
    registry.register_agent("by_place", functools.partial(Checked, 4.0))
    registry.register_agent("by_name", functools.partial(Checked, speed=5.0, mode="ctrl"))
    for name in ("by_place", "by_name"):
        registry.entry("agents", name).load().check()  # type: ignore[attr-defined]
    assert Checked.asked == [4.0, 5.0]


def test_a_check_is_given_the_options_that_it_takes(registry: Registry) -> None:
    Checked.asked.clear()
    for name in ("checked:speed=4+mode=ctrl", "checked:mode=ctrl", "mine:speed=4"):
        registry.entry("agents", name).load().check()  # type: ignore[attr-defined]
    assert Checked.asked == [4.0, 8.0]


def test_a_check_that_takes_all_options_is_given_those_that_were_chosen() -> None:
    asked: list[dict[str, object]] = []

    class TakesAll(Configurable):
        @classmethod
        def check(cls, **options: object) -> None:
            asked.append(options)

    registry = Registry()
    registry.register_agent("all", TakesAll)
    registry.entry("agents", "all:speed=4+mode=ctrl").load().check()  # type: ignore[attr-defined]
    assert asked == [{"speed": 4.0, "mode": "ctrl"}]


def test_a_check_that_an_agent_has_for_itself_is_not_asked_of_its_class() -> None:
    class Checks(Configurable):
        def check(self, control: Control) -> bool:
            return control == Control()

    registry = Registry()
    registry.register_agent("checks", Checks)
    registry.entry("agents", "checks:speed=4").load().check()  # type: ignore[attr-defined]
    assert check_of(Checks) is None


def test_agents_with_other_options_are_other_agents_to_the_store() -> None:
    registry = Registry()
    identities = [
        agent_identity(name, registry) for name in ("blind", "blind:speed=4", "blind:speed=11", "blind:speed=4")
    ]
    assert len(set(identities)) == 3
    assert identities[1] == identities[3]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("mine:sped=4", "'speed'"),
        ("mine:speed=fast", "a number, as in speed=8.0"),
        ("mine:ahead=2.5", "a whole number, as in ahead=3"),
        ("mine:keen=yes", "true or false"),
        ("mine:speed=", "NAME=VALUE"),
        ("mine:speed=4+mode", "NAME=VALUE"),
        ("mine:speed=4+speed=5", "each NAME once"),
        ("bare:speed=4", "speed"),
    ],
)
def test_what_is_no_option_is_refused_before_anything_is_made(registry: Registry, name: str, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        registry.require("agents", name)


def test_a_misspelt_name_with_options_is_answered_with_the_nearest_one(registry: Registry) -> None:
    with pytest.raises(UnknownNameError, match="'mine'"):
        registry.agent("mini:speed=4")
