"""An agent whose file of weights is a trap, and one that misses its device: one episode's result, and nobody's harm."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest
from loading_agents import NO_GPU, write_bomb

from pytest_drive_robust.simulators.embedded.route_xml import save_routes
from pytest_drive_robust.testing import fake_route

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="forks")

WORKERS = pytest.mark.parametrize("workers", [("--drive-workers=2",), ("-n2",)], ids=["pool", "xdist"])
SPY = """

def pytest_configure(config):
    with open(Path(__file__).parent / "pytest.pids", "a") as file:
        file.write(f"{os.getpid()}\\n")
"""
TESTS = """
import pytest
from pytest_drive_robust import requirement

@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.drive_robust(agent="loading_agents:" + name)) for name in {names}],
)
def test_agent(drive, name):
    drive.check(requirement("DS") >= 90)
"""


@pytest.fixture
def driving(suite, monkeypatch, pytester):
    """`driving(names, ...)`: one test and one episode for each agent; the result, and the episodes by agent."""
    monkeypatch.setenv("DRIVE_ROBUST_TEST_WEIGHTS", str(pytester.path / "weights.pt"))

    def run(*names: str, options: tuple[str, ...] = ()) -> tuple[pytest.RunResult, dict[str, dict[str, Any]]]:
        suite(test=TESTS.format(names=list(names)), conftest=SPY)
        monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[1] / "helpers"), prepend=":")
        save_routes([fake_route("7")], pytester.path / "long.xml")
        fixed = ("--drive-robust", "--drive-executor=processes", "--drive-routes=long.xml")
        world = "--drive-sim=pytest_drive_robust.testing:FakeSimulator"
        result = pytester.runpytest_subprocess(*fixed, world, "--drive-json=run.json", *options)
        told = pytester.path / "run.json"
        episodes = json.loads(told.read_text())["episodes"] if told.exists() else []
        return result, {item["agent"].partition(":")[2]: item for item in episodes}

    return run


def shown(result: pytest.RunResult) -> str:
    return " ".join((result.stdout.str() + result.stderr.str()).split())


def pids(file: Path) -> list[int]:
    return [int(line) for line in file.read_text().split()] if file.exists() else []


@WORKERS
@pytest.mark.parametrize(
    ("deed", "detail"),
    [
        ("os._exit(3)", "left the process with exit code 3 in {call} at tick 0"),
        ("os.system('kill -SEGV $PPID')", "SIGSEGV in {call} at tick 0"),
    ],
    ids=["leaves", "runs a program"],
)
def test_weights_that_are_a_bomb_burst_in_the_guarded_child_only(driving, pytester, workers, deed, detail):
    note = pytester.path / "burst.pids"
    write_bomb(pytester.path / "weights.pt", note, deed)
    result, episodes = driving("Blank", "Loads", "LoadsInReset", "LoadsWeightsOnly", options=workers)
    assert result.ret == 1
    result.assert_outcomes(passed=1, failed=2, errors=1)
    assert episodes.keys() == {"Blank", "Loads", "LoadsInReset"}
    assert episodes["Blank"]["outcome"] == "completed"
    for name, call in (("Loads", "its constructor"), ("LoadsInReset", "reset")):
        assert (episodes[name]["outcome"], episodes[name]["ticks"]) == ("agent_error", 0)
        assert detail.format(call=call) in episodes[name]["end_detail"]
    refused = "could not be made: UnpicklingError: Weights only load failed. Unsupported global: GLOBAL builtins.exec"
    assert f"'loading_agents:LoadsWeightsOnly' from module loading_agents {refused}" in shown(result)
    burst, ours = pids(note), pids(pytester.path / "pytest.pids")
    assert len(burst) == 2, "once for each agent that loads all, and never for the one that refuses"
    assert len(ours) >= 1
    assert not set(burst) & set(ours), "no process of pytest loaded it"


def test_torch_refuses_a_bomb_and_says_so(driving, pytester):
    pytest.importorskip("torch")
    note = pytester.path / "burst.pids"
    write_bomb(pytester.path / "weights.pt", note, "pass")
    result, episodes = driving("LoadsByTorch")
    result.assert_outcomes(errors=1)
    assert episodes == {}
    assert "'loading_agents:LoadsByTorch' from module loading_agents could not be made: UnpicklingError" in shown(
        result
    )
    assert "weights_only" in shown(result)
    assert pids(note) == []


def test_a_device_that_is_not_there_is_told_in_the_words_of_whoever_missed_it(driving):
    result, episodes = driving("Blank", "WantsAGpu", "WantsAGpuInReset")
    result.assert_outcomes(passed=1, failed=1, errors=1)
    assert episodes.keys() == {"Blank", "WantsAGpuInReset"}
    assert episodes["WantsAGpuInReset"]["outcome"] == "agent_error"
    assert f"reset raised RuntimeError: {NO_GPU}" in episodes["WantsAGpuInReset"]["end_detail"]
    assert f"'loading_agents:WantsAGpu' from module loading_agents could not be made: RuntimeError: {NO_GPU}" in shown(
        result
    )


@WORKERS
def test_a_factory_that_knows_that_it_misses_a_device_says_so_before_anything_is_driven(driving, workers):
    result, episodes = driving("Blank", "wants_a_gpu", options=workers)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    assert episodes == {}
    assert f"the agent needs a GPU and this machine has none: {NO_GPU}" in shown(result)
