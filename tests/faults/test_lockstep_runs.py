"""`pytest --drive-robust --drive-lockstep N`: the same episodes as one by one, whatever breaks on the way."""

from __future__ import annotations

from dataclasses import replace
from fnmatch import fnmatch
from pathlib import Path

import pytest
from guarded_worlds import request, worker_setup
from lockstep_suite import LOCKSTEP_CONFTEST

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.engine.pool import ProcessExecutor
from pytest_drive_robust.engine.supervisor import Stopped
from pytest_drive_robust.engine.worker_setup import Limits
from pytest_drive_robust.store.record import decode_episode, encode_episode
from pytest_drive_robust.testing import fake_route

SENTENCES = ("DS under clean >= 1", "DS under throttle 0.9 >= 1", "DS under 100 ms latency >= 1")


def drive(suite, agent: str, store: str, *options: str, sentences: tuple[str, ...] = SENTENCES) -> pytest.RunResult:
    """One worker: nine episodes (three routes, three seeds) under the setting of each sentence."""
    project = suite(*sentences, conftest=LOCKSTEP_CONFTEST)
    fixed = ("--drive-seeds", "0,1,2", "--drive-workers", "1", "--drive-store", store)
    return project.runpytest_inprocess("--drive-robust", "--drive-agent", agent, *fixed, *options)


def stored(root: Path) -> dict[str, EpisodeResult]:
    """Every record of a store, by the name of its episode."""
    results = [decode_episode(path.read_bytes()) for path in root.rglob("*.episode")]
    return {str(result.episode): result for result in results}


def bits(results: dict[str, EpisodeResult]) -> dict[str, bytes]:
    return {name: encode_episode(replace(one, wall_s=0.0, versions={})) for name, one in results.items()}


@pytest.mark.parametrize("agent", ["Row", "Raises", "RaisesAtOnce"])
def test_lockstep_drives_the_same_bytes_as_one_by_one(suite, pytester, agent):
    drive(suite, agent, "alone", "--drive-executor", "inline")
    alone = stored(pytester.path / "alone")
    assert len(alone) == 27
    for executor in ("inline", "processes"):
        drive(suite, agent, executor, "--drive-executor", executor, "--drive-lockstep", "8")
        together = stored(pytester.path / executor)
        assert {one.versions.get("lockstep") for one in together.values()} == {"8"}
        for name, one in together.items():  # the words name the call that raised
            assert one.end_detail == alone[name].end_detail.replace("act raised", "act_batch raised")
        assert bits(alone) == bits(
            {name: replace(one, end_detail=alone[name].end_detail) for name, one in together.items()}
        )


def test_an_agent_without_act_batch_is_driven_as_ever(suite, pytester):
    for store, options in (
        ("ever", ("--drive-executor", "inline")),
        ("inline", ("--drive-executor", "inline", "--drive-lockstep", "4")),
        ("processes", ("--drive-executor", "processes", "--drive-lockstep", "4")),
    ):
        drive(suite, "steady", store, *options)
    ever = {path.name for path in (pytester.path / "ever").rglob("*.episode")}
    assert len(ever) == 27
    for executor in ("inline", "processes"):
        kept = [*(pytester.path / executor).rglob("*.episode")]
        assert {path.name for path in kept} == ever, "the keys too are those of a run without the option"
        assert not any("lockstep" in decode_episode(path.read_bytes()).versions for path in kept)


@pytest.mark.parametrize("executor", ["inline", "processes"])
def test_agents_with_and_without_act_batch_in_one_run(suite, pytester, executor):
    tests = "".join(
        f"""
@pytest.mark.drive_robust(agent="{agent}")
def test_{agent}(drive):
    drive.check(requirements("DS under clean >= 1")[0])
"""
        for agent in ("Row", "steady", "Raises")
    )
    imports = "import pytest\nfrom pytest_drive_robust import requirements\n"
    project = suite(test=imports + tests, conftest=LOCKSTEP_CONFTEST)
    options = ("--drive-executor", executor, "--drive-workers", "1", "--drive-lockstep", "4", "--drive-store", "store")
    project.runpytest_inprocess("--drive-robust", *options).assert_outcomes(passed=3)
    lockstep = {one.episode.agent: one.versions.get("lockstep") for one in stored(pytester.path / "store").values()}
    assert lockstep == {"Row": "4", "steady": None, "Raises": "4"}


@pytest.mark.slow
def test_two_workers_of_xdist_share_the_episodes(suite, pytester, driven):
    drive(suite, "Row", "alone")
    (pytester.path / "driven.log").unlink()
    result = drive(suite, "Row", "shared", "--drive-executor", "processes", "--drive-lockstep", "4", "-n2")
    result.assert_outcomes(passed=3)
    assert bits(stored(pytester.path / "shared")) == bits(stored(pytester.path / "alone"))
    assert len(driven()) - 27 in (1, 2), "each once, and the beginning of one in each worker that asked its agent"


def test_what_was_driven_in_lockstep_is_not_taken_for_what_was_not(suite, pytester, driven):
    log = pytester.path / "driven.log"
    for options, count in (((), 27), (("--drive-lockstep", "4"), 27), (("--drive-lockstep", "8"), 0), ((), 0)):
        log.unlink(missing_ok=True)
        drive(suite, "Row", "shared", *options)
        vetting = 1 if options and count else 0
        assert len(driven()) == count + vetting, options


@pytest.mark.parametrize("executor", ["inline", "processes"])
def test_an_agent_that_looks_at_its_neighbours_is_refused(suite, pytester, executor):
    result = drive(suite, "Social", "refused", "--drive-executor", executor, "--drive-lockstep", "8")
    assert result.ret == 1
    result.assert_outcomes(errors=3)
    result.stdout.fnmatch_lines(
        ["*the agent 'Social' cannot be driven in lockstep: act_batch gives Control(*for the same observation in other "
         "company. Usual causes: *Leave out --drive-lockstep (drive_lockstep) and its episodes are driven one by one.*"]
    )  # fmt: skip
    assert stored(pytester.path / "refused") == {}


@pytest.mark.parametrize(
    ("agent", "end", "detail"),
    [
        ("Segfaults", End.AGENT_CRASHED_HARD, "SIGSEGV in act at tick 20 (*conftest.py:*"),
        ("LeavesAtOnce", End.AGENT_CRASHED_HARD, "left the process with exit code 7 in act at tick 20"),
        ("Hangs", End.AGENT_TIMED_OUT, "took longer than 2 s in act at tick 20 (*conftest.py:*"),
    ],
)
def test_an_agent_that_breaks_its_process_on_one_route_costs_only_those_episodes(suite, pytester, agent, end, detail):
    route, raising = ("1", "RaisesAtOnce") if agent == "LeavesAtOnce" else ("2", "Raises")
    drive(suite, raising, "raised", "--drive-executor", "inline", sentences=SENTENCES[1:2])
    options = ("--drive-executor", "processes", "--drive-lockstep", "8", "--drive-act-timeout", "2s")
    drive(suite, agent, "broken", *options, sentences=SENTENCES[1:2])
    raised, broken = stored(pytester.path / "raised"), stored(pytester.path / "broken")
    assert len(broken) == 9
    assert {one.versions.get("lockstep") for one in broken.values()} == {"8"}
    guilty = {name: one for name, one in broken.items() if one.episode.route_id == route}
    assert len(guilty) == 3
    for one in guilty.values():
        twin = raised[str(replace(one.episode, agent=raising))]
        assert (one.outcome, one.end, one.ticks) == (Outcome.AGENT_ERROR, end, twin.ticks)
        assert fnmatch(one.end_detail, detail + "*"), one.end_detail
        assert (one.trace.digest, one.route_completion_pct) == (twin.trace.digest, twin.route_completion_pct)
    for name in broken.keys() - guilty.keys():
        one = broken[name]
        twin = raised[str(replace(one.episode, agent=raising))]
        assert (one.outcome, one.trace.digest) == (twin.outcome, twin.trace.digest)
        assert one.outcome is not Outcome.AGENT_ERROR


@pytest.mark.parametrize("given", ["3", "6", "0", "eight", "-4"])
def test_a_width_that_is_no_multiple_of_four_is_a_usage_error(suite, given):
    result = drive(suite, "Row", "none", f"--drive-lockstep={given}")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines([f"*--drive-lockstep is '{given}', expected a multiple of 4 such as 8.*"])


def test_lockstep_and_ray_exclude_each_other(suite):
    result = drive(suite, "Row", "none", "--drive-lockstep", "8", "--drive-executor", "ray")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*--drive-lockstep and --drive-executor ray cannot be combined*"])


def test_a_driver_that_is_closed_gives_back_what_hangs() -> None:
    made = worker_setup()
    hanging, alone = "lockstep_suite:HangsTogether", "guarded_agents:Steady"
    executor = ProcessExecutor(lambda: made, Limits(), slots=2, width=4, shares=lambda agent: agent == hanging)
    assert executor.slots == 8
    early = executor.submit(request(hanging))
    assert early.result().versions["lockstep"] == "4"
    single = executor.submit(request(alone))
    slots = executor.slots  # asked first: it may end between two questions
    assert slots == 5 or single.done(), "what is driven alone takes the place of a batch"
    assert single.result().outcome is Outcome.COMPLETED
    late = [executor.submit(request(hanging, seed=seed, route=fake_route(str(seed)))) for seed in (1, 2, 3, 4, 5)]
    executor.close()
    executor.close()
    assert isinstance(late[0].exception(timeout=0.0), Stopped)
    assert all(future.done() for future in late)
