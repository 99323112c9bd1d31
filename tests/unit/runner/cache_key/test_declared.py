"""What only the made agent says of itself is refused: keys are made of what its factory says."""

from __future__ import annotations

import functools
from contextlib import nullcontext
from pathlib import Path
from typing import ClassVar

import pytest

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.errors import PluginError
from pytest_drive_robust.registry.registry import Registry, default_registry
from pytest_drive_robust.runner.cache_key.identity import agent_identity
from pytest_drive_robust.runner.driver import make_agent
from pytest_drive_robust.testing import ScriptedAgent


class Says(ScriptedAgent):
    weights = ("speed.txt",)
    configuration: ClassVar[object] = {"gain": 1}
    computed_by = ("numpy",)

    def __init__(self) -> None:
        super().__init__([Control()])


class SaysLate(ScriptedAgent):
    def __init__(self, path: str = "speed.txt") -> None:
        super().__init__([Control()])
        self.weights = [path]


class KeepsForItself(ScriptedAgent):
    """Uses the names for what it loaded, as many a network's class does."""

    def __init__(self) -> None:
        super().__init__([Control()])
        self.weights = {"layer": [1.0]}
        self.configuration = object()


def behind_a_function() -> Says:
    return Says()


def behind_a_function_that_says_so() -> Says:
    return Says()


behind_a_function_that_says_so.weights = Says.weights  # type: ignore[attr-defined]
behind_a_function_that_says_so.configuration = Says.configuration  # type: ignore[attr-defined]
behind_a_function_that_says_so.computed_by = ("torch", *Says.computed_by)  # type: ignore[attr-defined]


class GivesOtherFiles:
    """A factory object: its agents read another file than their class names."""

    weights = ("other.txt",)
    configuration: ClassVar[object] = {"gain": 2}
    computed_by = Says.computed_by

    def __call__(self) -> Says:
        return Says()


@pytest.fixture
def registry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Registry:
    monkeypatch.chdir(tmp_path)
    Path("speed.txt").write_text("6.0")
    Path("other.txt").write_text("5.0")
    registry = Registry()
    registry.register_agent("GivesOtherFiles", GivesOtherFiles())
    for factory in (Says, SaysLate, KeepsForItself, behind_a_function, behind_a_function_that_says_so):
        registry.register_agent(factory.__name__, factory)
    return registry


@pytest.mark.parametrize(
    "name", ["Says", "KeepsForItself", "behind_a_function_that_says_so", "SaysLate:path=speed.txt", "GivesOtherFiles"]
)
def test_an_agent_is_made_whose_factory_says_what_it_says(registry: Registry, name: str) -> None:
    assert make_agent(registry, name) is not None


def test_what_a_function_leaves_out_is_named_with_the_lines_that_say_it(registry: Registry) -> None:
    with pytest.raises(PluginError) as caught:
        make_agent(registry, "behind_a_function")
    told = str(caught.value)
    assert "weights = ('speed.txt',) and configuration = {'gain': 1} and computed_by = ('numpy',)" in told
    assert "behind_a_function.weights = Says.weights; behind_a_function.configuration = Says.configuration" in told


def test_a_function_that_names_another_file_is_not_believed(registry: Registry) -> None:
    def names_another() -> Says:
        return Says()

    names_another.weights = ("other.txt",)  # type: ignore[attr-defined]
    names_another.configuration = Says.configuration  # type: ignore[attr-defined]
    names_another.computed_by = Says.computed_by  # type: ignore[attr-defined]
    registry.register_agent("names_another", names_another)
    with pytest.raises(PluginError, match=r"names_another\.weights = Says\.weights"):
        make_agent(registry, "names_another")


class NamesNothing:
    """A factory object that leaves it to its agents."""

    def __call__(self) -> Says:
        return Says()


def test_a_factory_object_that_names_nothing_is_refused(registry: Registry) -> None:
    registry.register_agent("names_nothing", NamesNothing())
    with pytest.raises(PluginError, match=r"weights = \('speed.txt',\) and configuration = \{'gain': 1\}"):
        make_agent(registry, "names_nothing")


@pytest.mark.parametrize(
    ("named", "believed"),
    [
        (("other.txt", "speed.txt"), True),
        (["zero.txt", "speed.txt"], True),
        ("./speed.txt", True),
        (("zero.txt",), False),
        (("other.txt",), False),
    ],
)
def test_a_function_may_name_more_files_than_its_agent_and_not_fewer(
    registry: Registry, named: object, believed: bool
) -> None:
    def names_several() -> Says:
        return Says()

    Path("zero.txt").write_text("0.0")
    vars(names_several).update(weights=named, configuration=Says.configuration, computed_by=Says.computed_by)
    registry.register_agent("names_several", names_several)
    with nullcontext() if believed else pytest.raises(PluginError, match=r"names_several\.weights = Says\.weights"):
        make_agent(registry, "names_several")


def test_a_partial_of_a_class_is_believed_what_the_class_says(registry: Registry) -> None:
    registry.register_agent("partial", functools.partial(Says))
    make_agent(registry, "partial")
    first = agent_identity("partial", registry)
    Path("speed.txt").write_text("1.0")
    assert agent_identity("partial", registry) != first


def test_a_partial_is_believed_the_file_that_it_is_given_and_no_other(registry: Registry) -> None:
    registry.register_agent("named", functools.partial(SaysLate, "speed.txt"))
    make_agent(registry, "named")
    registry.register_agent("late", functools.partial(SaysLate))
    with pytest.raises(PluginError, match="in the body of the class SaysLate, not in __init__"):
        make_agent(registry, "late")


def test_what_is_set_in_a_constructor_belongs_in_the_class(registry: Registry) -> None:
    with pytest.raises(PluginError, match="in the body of the class SaysLate, not in __init__"):
        make_agent(registry, "SaysLate")


@pytest.mark.parametrize("given", ["speed.txt", "."])
def test_the_content_of_a_file_or_folder_that_an_option_names_is_in_the_key(registry: Registry, given: str) -> None:
    first = agent_identity(f"SaysLate:path={given}", registry)
    Path("speed.txt").write_text("1.0")
    assert agent_identity(f"SaysLate:path={given}", registry) != first
    assert agent_identity("SaysLate:path=no-file", registry) == agent_identity("SaysLate:path=no-file", registry)


@pytest.mark.parametrize(
    "name", ["tcp", "tcp:mode=ctrl+tuning=ours", "vad", "uniad", "simlingo", "blind:speed=4", "expert"]
)
def test_the_shipped_agents_say_what_they_are(name: str) -> None:
    assert make_agent(default_registry(), name) is not None


def test_an_option_may_choose_what_computes() -> None:
    pytest.importorskip("torch")
    assert make_agent(default_registry(), "tcp:engine=torch") is not None
