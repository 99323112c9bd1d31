"""What the four learned agents promise alike: names, constructors, weights that are checked before anything drives."""

from __future__ import annotations

import inspect
import shutil
from pathlib import Path

import pytest

torch = pytest.importorskip("torch")

from drive_robust_agents._nets import weights  # noqa: E402
from drive_robust_agents._wrappers.learned_agent import LearnedAgent  # noqa: E402
from drive_robust_agents.simlingo import SimLingo  # noqa: E402
from drive_robust_agents.tcp import TCP  # noqa: E402
from drive_robust_agents.training.candidates import candidate  # noqa: E402
from drive_robust_agents.training.recipes.recipe import RECIPES  # noqa: E402
from drive_robust_agents.uniad import UniAD  # noqa: E402
from drive_robust_agents.vad import VAD  # noqa: E402
from pytest_drive_robust.errors import UsageError  # noqa: E402
from pytest_drive_robust.registry.registry import default_registry  # noqa: E402
from pytest_drive_robust.runner.cache_key.identity import agent_identity  # noqa: E402

AGENTS = (SimLingo, TCP, UniAD, VAD)
every_agent = pytest.mark.parametrize("agent", AGENTS)


@every_agent
def test_it_is_registered_under_the_name_of_its_weights(agent: type[LearnedAgent]) -> None:
    assert default_registry().entry("agents", agent.name).load() is agent
    assert [file.name for file in agent.weights] == [f"{agent.name}.safetensors"]


def test_there_is_a_recipe_for_each() -> None:
    assert sorted(agent.name for agent in AGENTS) == sorted(RECIPES)


@every_agent
def test_its_constructor_says_how_the_network_is_run(agent: type[LearnedAgent]) -> None:
    shared = dict(inspect.signature(LearnedAgent).parameters)
    own = inspect.signature(agent).parameters
    assert {name: own.get(name) for name in shared} == shared


@every_agent
def test_an_argument_that_it_does_not_have_is_an_error(agent: type[LearnedAgent]) -> None:
    with pytest.raises(TypeError, match="unexpected keyword argument 'engin'"):
        agent(engin="onnx")  # type: ignore[call-arg]


@every_agent
def test_missing_weights_are_told_before_anything_drives(
    agent: type[LearnedAgent], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(weights, "SHIPPED", tmp_path)
    with pytest.raises(UsageError, match=f"train '{agent.name}' and publish it"):
        agent.check()


@every_agent
def test_on_onnx_runtime_it_is_another_agent_of_the_same_weights(agent: type[LearnedAgent]) -> None:
    pytest.importorskip("onnxruntime")
    entry = default_registry().entry("agents", f"{agent.name}-onnx")
    assert entry.load().weights == agent.weights  # type: ignore[attr-defined]
    assert agent_identity(f"{agent.name}-onnx", default_registry()) != agent_identity(agent.name, default_registry())


def test_weights_that_do_not_ship_drive_on_onnx_runtime_too(tmp_path: Path) -> None:
    pytest.importorskip("onnxruntime")
    for name in ("tcp.safetensors", "manifest.json"):
        shutil.copy(weights.SHIPPED / name, tmp_path)
    file = tmp_path / "tcp.safetensors"
    factory = candidate(f"tcp-onnx={file}")
    assert type(factory()) is default_registry().entry("agents", "tcp-onnx").load()
    assert factory.weights == (file,)


def test_a_candidate_of_no_learned_agent_is_told_the_nearest(tmp_path: Path) -> None:
    file = tmp_path / "tcp.safetensors"
    file.touch()
    with pytest.raises(UsageError, match=r"no learned agent named 'tcp-onx'\. Did you mean 'tcp-onnx'\?"):
        candidate(f"tcp-onx={file}")
