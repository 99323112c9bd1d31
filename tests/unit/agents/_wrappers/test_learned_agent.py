"""What the four learned agents promise alike: names, constructors, weights that are checked before anything drives."""

from __future__ import annotations

import hashlib
import inspect
import json
import math
import re
import shutil
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
import pytest
from numpy.typing import NDArray

from drive_robust_agents._nets import weights
from drive_robust_agents._nets.answer import GENERATE
from drive_robust_agents._nets.engine_options import ENGINES
from drive_robust_agents._nets.inference import ROWS, LoadedNetwork
from drive_robust_agents._nets.manifest import WeightsEntry, write_entry
from drive_robust_agents._vehicle import mkz
from drive_robust_agents._wrappers.learned_agent import LearnedAgent
from drive_robust_agents.simlingo import SimLingo
from drive_robust_agents.tcp import TCP
from drive_robust_agents.training.candidates import candidate
from drive_robust_agents.training.recipes.recipe import RECIPES, recipe_of
from drive_robust_agents.uniad import UniAD
from drive_robust_agents.vad import VAD
from pytest_drive_robust import Control
from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.registry.registry import default_registry

TOLERANCE = 1e-4
"""Metres of waypoints, shares of a control."""

AGENTS = (SimLingo, TCP, UniAD, VAD)
every_agent = pytest.mark.parametrize("agent", AGENTS)


@every_agent
def test_it_is_registered_under_the_name_of_its_weights(agent: type[LearnedAgent]) -> None:
    assert default_registry().entry("agents", agent.name).load() is agent
    _, entry = weights.locate(agent.name)
    assert {file.name for file in agent.weights} == {entry.file, *(graph.file for graph in entry.graphs.values())}


def test_there_is_a_recipe_for_each() -> None:
    assert sorted(agent.name for agent in AGENTS) == sorted(RECIPES)


@every_agent
def test_a_network_that_a_name_says_is_refused_before_anything_drives(agent: type[LearnedAgent]) -> None:
    with pytest.raises(UsageError, match=f"as in '{agent.name}:weights=FILE'"):
        default_registry().entry("agents", f"{agent.name}:network=small").load().check()


@every_agent
def test_its_constructor_says_how_the_network_is_run(agent: type[LearnedAgent]) -> None:
    shared = dict(inspect.signature(LearnedAgent).parameters)
    own = dict(inspect.signature(agent).parameters)
    own["tuning"] = own["tuning"].replace(default=shared["tuning"].default)  # each drives by what drives it better
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


def for_taller_pictures(agent: type[LearnedAgent], folder: Path) -> WeightsEntry:
    """The weights that ship and their manifest, both of which say that the pictures have another height."""
    for file in agent.weights:
        shutil.copy(file, folder)
    _, entry = weights.locate(agent.name)
    path = folder / entry.file
    text, content = json.dumps(entry.spec, sort_keys=True), path.read_bytes()
    height = re.search(r'height_px": (96|128)', text)
    assert height is not None
    other = text.replace(height[0], f'height_px": {256 if height[1] == "128" else 48}')
    old, new = (json.dumps(spec).encode() for spec in (text, other))  # the header holds it as a text
    assert content.count(old) == 1
    content = content.replace(old, new)
    path.write_bytes(content)
    entry = replace(entry, spec=json.loads(other), sha256=hashlib.sha256(content).hexdigest())
    write_entry(folder, entry)
    return entry


@every_agent
def test_weights_of_another_rig_are_refused_before_anything_drives(agent: type[LearnedAgent], tmp_path: Path) -> None:
    entry = for_taller_pictures(agent, tmp_path)
    told = rf"{entry.label} are for another rig than that of '{agent.name}': \S*height_px is (48|256), the cameras"
    with pytest.raises(UsageError, match=told):
        agent(weights=tmp_path / entry.file)
    with pytest.raises(UsageError, match=told):
        agent.check(weights=str(tmp_path / entry.file))


def inputs_of(agent: type[LearnedAgent], rows: int) -> dict[str, NDArray[Any]]:
    """What the network may be asked in the middle of a drive, the same at every call."""
    pytest.importorskip("torch")
    recipe = recipe_of(agent.name)
    generator = np.random.Generator(np.random.Philox(4))
    given = {name: value.numpy() for name, value in recipe.make().example(rows).items()}  # type: ignore[operator]
    for name, value in given.items():
        if value.dtype == np.uint8:
            given[name] = generator.integers(0, 256, value.shape, dtype=np.uint8)
        elif name == "command":
            given[name] = 1 + np.arange(rows) % 6
        elif name == "known":
            given[name] = np.ones_like(value)
        elif value.dtype == np.float32:
            given[name] = value + generator.normal(0.0, 0.5, value.shape).astype(np.float32)
    return given


@every_agent
def test_the_graphs_that_ship_plan_as_the_weights_that_ship(agent: type[LearnedAgent]) -> None:
    given = inputs_of(agent, ROWS)
    for method in ("forward", GENERATE) if agent is SimLingo else ("forward",):
        plans = [
            LoadedNetwork.of(agent.name, agent.network_class, engine=engine).run(method, **given) for engine in ENGINES
        ]
        assert set(plans[0]) == set(plans[1])
        for name in {"path", "waypoints", "action", "answer"} & set(plans[0]):
            assert np.abs(plans[0][name] - plans[1][name]).max() < TOLERANCE, (method, name)


@every_agent
def test_a_graph_computes_a_row_alike_in_any_company(agent: type[LearnedAgent]) -> None:
    """But for last bits: they are up to the processor, and lockstep checks them before it begins."""
    network, given = LoadedNetwork.of(agent.name, agent.network_class), inputs_of(agent, 8)
    whole = network.run(**given)
    for rows in ([3, 2, 1, 0], [0, 5, 6], [7, 6, 5, 4, 0, 0]):
        again = network.run(**{name: values[rows] for name, values in given.items()})
        assert all(np.abs(again[name] - whole[name][rows]).max() < TOLERANCE for name in whole)


@pytest.mark.skipif(sys.byteorder != "little", reason="weights are little-endian")
@every_agent
def test_the_graphs_that_ship_are_open_to_any_program_beside_their_weights(agent: type[LearnedAgent]) -> None:
    given = inputs_of(agent, 1)
    plain = onnxruntime.InferenceSession(weights.SHIPPED / f"{agent.name}.onnx", providers=["CPUExecutionProvider"])
    found = dict(zip([one.name for one in plain.get_outputs()], plain.run(None, given), strict=True))
    expected = LoadedNetwork.of(agent.name, agent.network_class).run(**given)
    assert np.abs(found["waypoints"] - expected["waypoints"]).max() < TOLERANCE


@every_agent
def test_its_engine_is_a_choice_and_decides_what_its_bits_depend_on(agent: type[LearnedAgent]) -> None:
    pytest.importorskip("torch")
    assert agent.computed_by == agent().computed_by == ("onnxruntime", "numpy")
    assert agent(engine="torch").computed_by == ("torch", "numpy")


@every_agent
def test_the_name_that_it_had_on_onnx_runtime_is_told_the_one_that_it_has(agent: type[LearnedAgent]) -> None:
    with pytest.raises(UsageError, match=rf"no agent named '{agent.name}-onnx'\. Did you mean '{agent.name}'\?"):
        default_registry().entry("agents", f"{agent.name}-onnx")


def test_a_candidate_is_keyed_by_its_weights_and_its_graph(tmp_path: Path) -> None:
    for name in ("tcp.safetensors", "tcp.onnx", "manifest.json"):
        shutil.copy(weights.SHIPPED / name, tmp_path)
    file = tmp_path / "tcp.safetensors"
    factory = candidate(f"tcp={file}")
    assert type(factory()) is TCP
    assert factory.weights == (file, tmp_path / "tcp.onnx")


def test_a_candidate_of_no_learned_agent_is_told_the_nearest(tmp_path: Path) -> None:
    file = tmp_path / "tcp.safetensors"
    file.touch()
    with pytest.raises(UsageError, match=r"no learned agent named 'tcp-onnx'\. Did you mean 'tcp'\?"):
        candidate(f"tcp-onnx={file}")


LEARNED = pytest.mark.parametrize("made", [TCP, UniAD, VAD, SimLingo], ids=["tcp", "uniad", "vad", "simlingo"])


@LEARNED
def test_a_tuning_that_there_is_none_of_is_refused_with_the_nearest_name(made: type[LearnedAgent]) -> None:
    with pytest.raises(UnknownNameError, match=rf"no tuning named 'publishd'. Did you mean 'published'.*'{made.name}:"):
        made(tuning="publishd")  # type: ignore[arg-type]


@LEARNED
def test_the_tuning_is_an_option_of_the_name(made: type[LearnedAgent]) -> None:
    names = (made.name, f"{made.name}:tuning=published", f"{made.name}:tuning=ours")
    agents = [agent for agent in map(default_registry().agent, names) if isinstance(agent, made)]
    assert [agent.tuning for agent in agents] == ["published", "published", "ours"]


@LEARNED
def test_our_numbers_move_the_car_as_a_plain_one_and_published_ones_are_given_as_they_are(
    made: type[LearnedAgent],
) -> None:
    wanted = Control(throttle=0.3, steer=0.2, brake=0.0)
    assert made(tuning="published")._for_driven_car(wanted, 5.0) is wanted
    moved = mkz.moved(5.0, made(tuning="ours")._for_driven_car(wanted, 5.0))
    tangent = math.tan(0.2 * 0.61)
    assert moved.turn_rad == pytest.approx(0.05 * math.cos(math.atan(0.5 * tangent)) * tangent / 2.85, rel=1e-6)
    drag_mps2 = 0.12 + 0.018 * 5.0 + 0.0006 * 25.0
    assert moved.speed_mps == pytest.approx(5.0 + 0.05 * (0.3 * 5.0 - drag_mps2))
