"""Agents and worlds that break, through the front door: what people read, and that nobody else is harmed."""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from pytest_drive_robust.simulators.embedded.route_xml import save_routes
from pytest_drive_robust.testing import fake_route

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="forks")

WORKERS = pytest.mark.parametrize("workers", [("--drive-workers=2",), ("-n2",)], ids=["pool", "xdist"])
PROCESSES = ("--drive-robust", "--drive-executor=processes")
FAULTS = {
    "Raises": "act raised ZeroDivisionError: no way (",
    "SaysExit": "act raised SystemExit: enough (",
    "Interrupts": "act raised KeyboardInterrupt: from within (",
    "RaisesWhatCannotBePickled": "OddError: two arguments (",
    "GivesNan": "steer is nan",
    "GivesNothing": "act returned None of type NoneType, expected a Control",
    "CannotBeShown": "act returned something that cannot be shown (",
    "Segfaults": "SIGSEGV in act at tick 30 (",
    "LeavesWithSeven": "left the process with exit code 7 in act at tick 30",
    "KillsItself": "killed by SIGKILL in act at tick 30 (perhaps out of memory), 3 times",
    "Hangs": "took longer than 2 s in act at tick 30 (",
    "HangsInC": "took longer than 2 s in act at tick 30 (",
}
FINE = ("Steady", "Shouts", "LeavesAThread", "ClosesItsStreams")
TESTS = """
import pytest
from pytest_drive_robust import requirement

NAMES = {names}

@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.drive_robust(agent="guarded_agents:" + name)) for name in NAMES]
)
def test_agent(drive, name):
    drive.check(requirement("DS") >= 90)
"""
BREAKING = """

class Breaking(LoggedSimulator):
    def reset(self, route, *, seed, cameras):
        self._route = route.id
        return super().reset(route, seed=seed, cameras=cameras)

    def step(self, control):
        if self._tick == 3:
            raise RuntimeError("no map")
        return super().step(control)


@pytest.hookimpl(optionalhook=True)
def pytest_drive_robust_register(registry, _known=pytest_drive_robust_register):
    _known(registry)
    registry.register_simulator("breaking", lambda options: Breaking(replace(options, tick_cap=60)))
"""


@pytest.fixture
def project(suite, monkeypatch):
    """A suite with one test for each agent, one long route, and the agents of this folder importable."""

    def write(names) -> pytest.Pytester:
        folder = suite(test=TESTS.format(names=list(names)))
        save_routes([fake_route("7")], folder.path / "long.xml")
        monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[1] / "helpers"), prepend=":")
        return folder

    return write


def drive(folder: pytest.Pytester, *arguments: str) -> tuple[pytest.RunResult, dict[str, dict[str, Any]]]:
    """Run it; the result, and the episodes by the agent's bare name."""
    world = ("--drive-sim=pytest_drive_robust.testing:FakeSimulator", "--drive-routes=long.xml")
    result = folder.runpytest_subprocess(*PROCESSES, *world, "--drive-json=run.json", *arguments)
    episodes = json.loads((folder.path / "run.json").read_text())["episodes"]
    return result, {item["agent"].partition(":")[2]: item for item in episodes}


@WORKERS
def test_whatever_an_agent_does_is_its_result_and_nobody_elses(project, workers):
    folder = project((*FINE, *FAULTS))
    result, episodes = drive(folder, "--drive-act-timeout=2s", *workers)
    assert result.ret == 1
    result.assert_outcomes(passed=len(FINE), failed=len(FAULTS))
    text = result.stdout.str()
    for name in FINE:
        assert episodes[name]["outcome"] == "completed", name
        assert episodes[name]["trace_digest"] == episodes["Steady"]["trace_digest"]
    for name, detail in FAULTS.items():
        episode = episodes[name]
        assert episode["outcome"] == "agent_error", name
        assert detail in episode["end_detail"]
        assert episode["ticks"] == 30
        assert 0.0 < episode["driving_score"] < 90.0  # what it drove until then counts
        command = f"replay 7 --agent guarded_agents:{name} --setting clean --seed 0 --routes long.xml"
        assert f"drive-robust -p conftest.py {command}" in text
    lines = [line for line in text.splitlines() if line.startswith("1 x agent error: ")]
    assert len(lines) == 10  # the first kinds, and how many more there are
    assert f"and {len(FAULTS) - 10} more kinds of agent error" in text


def test_the_whole_traceback_and_what_was_printed_are_shown_with_the_failure(project):
    result, _ = drive(project(("Raises", "Aborts")))
    result.stdout.fnmatch_lines(
        [
            "*printed by guarded_agents:Raises on 7 under clean, seed 0*",
            "Traceback (most recent call last):",
            "ZeroDivisionError: no way",
            "*printed by guarded_agents:Aborts on 7 under clean, seed 0*",
            "cannot go on",
        ]
    )
    assert "it last printed 'cannot go on'" in " ".join(result.stdout.str().split())


@pytest.mark.parametrize("executor", ["inline", "processes"])
def test_a_world_that_breaks_is_tried_three_times_and_then_an_error_that_says_why(suite, driven, executor):
    folder = suite("DS under clean >= 10", conftest=BREAKING)
    result = folder.runpytest_subprocess(
        *PROCESSES, "--drive-sim=breaking", f"--drive-executor={executor}", "--drive-verdict=list"
    )
    assert result.ret == 1
    result.assert_outcomes(errors=1)
    text = " ".join(result.stdout.str().split())
    assert "1 of 1 episodes ended with infra_error and are never scored, first: steady on" in text
    assert "1 x simulation error, never scored: the simulation raised RuntimeError: no map (conftest.py:" in text
    begun = Counter(driven())  # with two at a time, the next route may have begun
    assert set(begun.values()) <= {1, 2, 3}
    assert 3 in begun.values()


def test_a_world_that_works_again_is_no_error(suite, driven):
    # of one route: with two at a time, which of two breaks first is open
    broken = 'self._tick == 3 and self._route == "1" and LOG.read_text().count("1 0 ") < 3'
    once = BREAKING.replace("self._tick == 3", broken)
    result = suite("DS under clean >= 90", conftest=once).runpytest_subprocess(*PROCESSES, "--drive-sim=breaking")
    assert result.ret == 0
    assert Counter(driven()) == {"1 0": 3, "2 0": 1, "3 0": 1}


def test_an_agent_that_only_this_process_can_import_is_a_usage_error_with_advice(suite, driven, monkeypatch):
    folder = suite("DS under clean >= 90")
    folder.makepyfile(
        shy_agent="""
        import sys
        if "pytest" not in sys.argv[0]:
            raise ImportError("only where pytest runs")
        from guarded_agents import Steady
        """
    )
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[1] / "helpers"), prepend=":")
    result = folder.runpytest_subprocess(*PROCESSES, "--drive-agent=shy_agent:Steady")
    assert result.ret == 1
    assert driven() == []
    text = result.stdout.str().replace("\n", " ")
    assert "'shy_agent:Steady'" in text
    assert "does not load: ImportError: only where pytest runs" in text


def test_a_path_that_python_itself_passes_over_is_passed_over(suite, driven):
    folder = suite("DS under clean >= 90", conftest="import sys\nsys.path.append(Path())\n")
    result = folder.runpytest_subprocess(*PROCESSES, "-p", "no:hypothesispytest")  # which stumbles over it at the end
    assert result.ret == 0
    assert driven() == ["1 0", "2 0", "3 0"]


@pytest.mark.parametrize(
    ("severity", "said"),
    [("", "--drive-executor inline"), ("lock: object = field(default_factory=threading.Lock)", "expected a number")],
    ids=["class", "severity"],
)
def test_a_setting_that_no_other_process_can_have_is_an_error_with_advice(suite, driven, severity, said):
    test = f"""
from dataclasses import dataclass, field
import threading
from pytest_drive_robust import Perturbation

def test_local(drive):
    @dataclass
    class Local(Perturbation):
        phrase = "local trouble"
        {severity}

    drive.ds(Local())
"""
    result = suite(test=test).runpytest_subprocess(*PROCESSES)
    assert result.ret == 1
    assert said in result.stdout.str().replace("\n", " ")
    assert "INTERNALERROR" not in result.stdout.str()
    assert set(driven()) <= {"1 0", "2 0", "3 0"}  # the clean twins
