"""`pytest --drive-robust` as people use it, in one process and with two workers."""

from __future__ import annotations

import json
import shlex
import signal
import subprocess
import sys
import time

import pytest
from heeding_interrupts import heed_interrupts
from patience import PATIENCE_S
from suite_runs import GREEN, RED, processes, run


@processes
def test_a_suite_whose_requirements_hold_is_green(suite, driven, workers):
    result = run(suite(GREEN, "DS under clean >= 90"), "--drive-seeds", "0,7", *workers)
    assert result.ret == 0
    result.assert_outcomes(passed=2)
    assert driven() == sorted(["1 0", "2 0", "3 0", "1 7", "2 7", "3 7"] * 2)


@processes
def test_a_broken_requirement_fails_its_test_and_says_why(suite, driven, workers):
    result = run(suite(GREEN, RED, "SR under throttle 0.9 >= 0.5", "DS under clean >= 90"), *workers)
    assert result.ret == 1
    result.assert_outcomes(passed=3, failed=1)
    result.stdout.re_match_lines(
        [
            r"RD under throttle 0\.3 = 0\.\d\d, limit <= 0\.30   \(95 % interval .* to .*, 3 routes x 1 seed\)",
            r" +clean   perturbed",
            r"  DS +100\.00 +\d\d\.\d\d",
            r"  SR +1\.00 +0\.00",
            r"  worst routes",
            r"  3 Straight, diverged at \d\.\d s",
            r"    clean +100\.0  completed",
            r"    perturbed +\d\d\.\d  out of time at 3\.0 s",
        ],
    )
    result.stdout.fnmatch_lines(
        ['  replay:  drive-robust -p conftest.py replay 3 --agent steady --setting "throttle 0.3" --seed 0 --routes *']
    )
    result.stdout.fnmatch_lines(["FAILED *rd-throttle-0.3-le-0.30[]] - RD under throttle 0.3 = 0.64, limit <= 0.30"])
    result.stdout.no_fnmatch_line("*Traceback*")
    result.stdout.no_fnmatch_line("*test_suite.py:*: *Error*")
    assert driven() == sorted(["1 0", "2 0", "3 0"] * 3), "clean, throttle 0.9 and throttle 0.3, each once"
    assert_table(result.outlines, verdicts=["pass", "pass", "fail"])


def test_the_replay_line_drives_again_what_a_conftest_registered(suite):
    folder = suite(RED)
    result = run(folder)
    line = next(line for line in result.outlines if line.startswith("  replay:  "))
    program, *words = shlex.split(line.partition("replay:")[2])
    assert program == "drive-robust"
    replayed = folder.run(sys.executable, "-m", "pytest_drive_robust.cli", *words, "--no-video")
    assert replayed.ret == 0
    replayed.stdout.fnmatch_lines(["steady on 3 under throttle 0.3, seed 0 (Straight)", "first divergence at * s in *"])


@pytest.mark.parametrize("workers", [(), ("-n1",)], ids=["one-process", "one-worker"])
def test_replay_lines_and_reports_name_a_conftest_that_stands_below_the_root(suite, workers):
    folder = suite(RED)
    below = folder.path / "suites" / "own"
    below.mkdir(parents=True)
    for name in ("conftest.py", "test_suite.py"):
        (folder.path / name).rename(below / name)
    result = run(folder, *workers, "--drive-json", "run.json", ".")
    words = shlex.split(next(line for line in result.outlines if line.startswith("  replay:  ")))[2:]
    assert words[:3] == ["-p", "suites/own/conftest.py", "replay"]
    assert json.loads((folder.path / "run.json").read_text())["settings"]["plugins"] == ["suites/own/conftest.py"]
    replayed = folder.run(sys.executable, "-m", "pytest_drive_robust.cli", *words, "--no-video")
    assert replayed.ret == 0
    replayed.stdout.fnmatch_lines(["steady on 3 under throttle 0.3, seed 0 (Straight)"])


def assert_table(lines, *, verdicts):
    start = next(number for number, line in enumerate(lines) if "= drive-robust =" in line)
    table = lines[start + 1 : start + 5]
    assert table[0].split() == ["agent", "setting", "DS", "SR", "RD", "efficiency", "comfort", "routes", "verdict"]
    assert [line.split()[-1] for line in table[1:]] == verdicts
    assert all(len(line) <= 100 for line in table)


@processes
def test_an_episode_that_broke_in_the_simulator_is_an_error_not_a_failure(suite, workers):
    result = run(suite(GREEN), "--drive-sim", "broken", *workers)
    assert result.ret == 1
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*ERROR: not judged: RD under throttle 0.9 <= 0.30*", "*no map*"])


LOST = """

@dataclass
class GpsLoss(Perturbation):
    phrase = "GPS loss"

    def observe(self, observation):
        return replace(observation, gps=replace(observation.gps, x_m=float("nan")))


@dataclass
class SlowComputer(Perturbation):
    every: int = 2
    phrase = "slow computer {every}"

    def wants_inference(self, tick):
        tick % self.every == 0


@dataclass
class AllLate(Perturbation):
    ticks: int = 5
    phrase = "all late {ticks}"

    def reset(self, context):
        self.kept = []

    def observe(self, observation):
        self.kept.append(observation)
        return self.kept[max(observation.tick - self.ticks, 0)]


def follower():
    return ScriptedAgent(lambda seen: Control(throttle=1.0, steer=0.0 * seen.gps.x_m))


AGENTS.append(follower)


@pytest.hookimpl(optionalhook=True)
def pytest_drive_robust_register(registry, _known=pytest_drive_robust_register):
    _known(registry)
    registry.register_perturbation(GpsLoss)
    registry.register_perturbation(SlowComputer)
    registry.register_perturbation(AllLate)
"""


@pytest.mark.parametrize(
    ("failure", "told"),
    [
        ("GPS loss", "GpsLoss.observe gave an observation whose*"),
        ("slow computer 2", "SlowComputer.wants_inference gave None,*"),
        ("all late 5", "AllLate.observe gave the observation of tick 0 in tick*"),
    ],
)
def test_a_perturbation_that_gives_what_cannot_be_used_is_an_error_not_a_failure(suite, failure, told):
    result = run(suite(f"RD under {failure} <= 0.30", conftest=LOST), "--drive-agent", "follower")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines([f"3 x simulation error, never scored: {told}"])


def test_an_agent_that_breaks_its_contract_is_scored_and_listed(suite):
    result = run(suite("DS under clean >= 90"), "--drive-agent", "faulty")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*3 episodes of 3 ended with an agent error*", "*3 x agent error: *throttle is 7.0*"])


def test_a_privileged_agent_is_marked(suite):
    result = run(suite("DS under clean >= 90"), "--drive-agent", "seer")
    assert result.ret == 0
    result.stdout.re_match_lines([r"seer\* .*pass", r"\* privileged: this agent sees ground truth"])


def test_the_header_shows_the_effective_choices(suite):
    result = run(suite(GREEN), "--drive-seeds", "0,1", "--drive-metrics", "fixed")
    settled = "routes=3 (routes.xml) seeds=0,1 reading=paper metrics=fixed"
    result.stdout.fnmatch_lines([f"drive-robust: agent=steady sim=fake {settled}"])


def test_the_header_tells_where_nobody_named_an_agent(suite):
    folder = suite(GREEN)
    ini = folder.path / "tox.ini"
    ini.write_text(ini.read_text().replace("drive_agent = steady\n", ""))
    result = run(folder, "--collect-only")
    result.stdout.fnmatch_lines(["drive-robust: agent=tcp (the default) sim=fake *"])


def test_without_a_terminal_the_exit_code_is_still_right(suite):
    folder = suite(RED)
    assert run(folder, "-p", "no:terminal").ret == 1


def test_what_a_requirement_measured_reaches_junit(suite):
    folder = suite(RED)
    run(folder, "--junitxml", "junit.xml")
    text = (folder.path / "junit.xml").read_text()
    assert '<property name="drive_requirement" value="RD under throttle 0.3 &lt;= 0.30" />' in text
    assert '<property name="drive_verdict" value="fail" />' in text


def test_progress_is_a_few_plain_lines_where_there_is_no_terminal(suite):
    result = run(suite(GREEN, RED))
    lines = [line for line in result.outlines if line.startswith("drive-robust: steady under")]
    assert lines
    assert len(lines) <= 3
    assert not any("\x1b" in line for line in result.outlines)


def test_quiet_runs_write_no_progress(suite):
    result = run(suite(GREEN), "-q")
    result.stdout.no_fnmatch_line("drive-robust: steady under*")


@processes
def test_control_c_ends_with_the_table_of_what_is_there(suite, plugin_args, workers):
    test = """
from pathlib import Path

def test_slow(drive):
    from pytest_drive_robust import Setting
    drive.episodes(Setting.CLEAN)
    Path("ready").touch()
    import time
    for _ in range(12000):
        time.sleep(0.05)
"""
    folder = suite(test=test)
    command = [sys.executable, "-m", "pytest", "--drive-robust", *workers]
    with subprocess.Popen(
        command, cwd=folder.path, stdout=subprocess.PIPE, text=True, preexec_fn=heed_interrupts
    ) as process:
        while not (folder.path / "ready").exists() and process.poll() is None:
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 2, output
    assert "steady" in output
    assert "KeyboardInterrupt" in output


def test_a_report_that_cannot_be_written_is_not_green(suite):
    test = """
def test_it(drive):
    import os
    from pytest_drive_robust import requirement
    drive.check(requirement("DS") >= 90)
    os.rmdir("reports")
"""
    folder = suite(test=test)
    (folder.path / "reports").mkdir()
    result = run(folder, "--drive-json", "reports/run.json")
    assert result.ret == 1
    result.stdout.fnmatch_lines(["ERROR: *run.json was not written: *"])


def test_a_mode_of_distribution_without_workers_drives_here(suite):
    run(suite("DS under clean >= 1"), "--dist", "loadfile").assert_outcomes(passed=1)


def test_a_worker_without_room_for_its_journal_says_so_without_our_traceback(suite):
    full = """

@pytest.fixture(autouse=True)
def full_disk():
    import resource
    usual = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1, usual[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, usual)
"""
    result = suite("DS under clean >= 60", conftest=full).runpytest_inprocess("--drive-robust", "-n1")
    assert result.ret == 1
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["what this worker does cannot be written to *gw0.jsonl, *File too large. Make room *"])
    assert "journal.py" not in result.stdout.str()
