"""What is around an agent while it drives, whatever a test does: folder, environment variables, warnings."""

from __future__ import annotations

import pytest
from suite_runs import processes, run


@processes
@pytest.mark.parametrize("executor", ["inline", "processes"])
def test_an_agent_reads_from_the_folder_of_the_call_wherever_the_first_test_has_gone(suite, workers, executor):
    reading = """

def reading():
    return ScriptedAgent([Control(throttle=float(Path("throttle.txt").read_text()))])


AGENTS.append(reading)
"""
    test = """
from pytest_drive_robust import requirements

def test_elsewhere(drive, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    drive.check(requirements("DS under clean >= 90")[0])
"""
    folder = suite(test=test, conftest=reading)
    (folder.path / "throttle.txt").write_text("1.0")
    options = ("--drive-agent", "reading", "--drive-executor", executor, "--drive-workers", "1")
    run(folder, *options, *workers).assert_outcomes(passed=1)


@pytest.mark.parametrize("executor", ["inline", "processes"])
def test_a_variable_that_a_test_sets_is_not_set_for_the_agent(suite, executor):
    reading = """

class Reads(ScriptedAgent):
    def act(self, observation):
        return Control(throttle=float(os.environ.get("HOW_FAST", "1.0")))


def reading():
    return Reads([Control()])


AGENTS.append(reading)
"""
    test = """
import os
from pytest_drive_robust import requirements

def test_sets_it(drive, monkeypatch):
    monkeypatch.setenv("HOW_FAST", "0.1")
    drive.check(requirements("DS under clean >= 90")[0])
    assert os.environ["HOW_FAST"] == "0.1"
"""
    options = ("--drive-agent", "reading", "--drive-executor", executor, "--drive-workers", "1", "-W", "default")
    result = run(suite(test=test, conftest=reading), *options)
    result.assert_outcomes(passed=1, warnings=1)
    result.stdout.fnmatch_lines(
        ["*drive-robust: environment variables changed after *: HOW_FAST. The agent does not see *"]
    )


@pytest.mark.parametrize("executor", ["inline", "processes"])
def test_a_variable_that_an_agent_sets_stays_set_for_it(suite, executor):
    setting = """

class Sets(ScriptedAgent):
    def __init__(self):
        super().__init__([Control()])
        os.environ["HOW_FAST"] = "1.0"

    def act(self, observation):
        return Control(throttle=float(os.environ["HOW_FAST"]))


def setting():
    return Sets()


AGENTS.append(setting)
"""
    options = ("--drive-agent", "setting", "--drive-executor", executor, "--drive-workers", "1", "-W", "default")
    folder = suite("DS under clean >= 90", "DS under throttle 0.9 >= 1", conftest=setting)
    run(folder, *options).assert_outcomes(passed=2, warnings=0)


@pytest.mark.parametrize("executor", ["inline", "processes"])
def test_what_an_agent_warns_of_ends_no_episode_where_warnings_are_errors(suite, monkeypatch, executor):
    warning = """

class Warns(ScriptedAgent):
    def act(self, observation):
        import warnings

        warnings.warn("old", DeprecationWarning)
        return super().act(observation)


def warning():
    return Warns([Control(throttle=1.0)])


AGENTS.append(warning)
"""
    folder = suite("DS under clean >= 90", conftest=warning)
    monkeypatch.setenv("PYTHONWARNINGS", "error::DeprecationWarning")
    as_errors = ("-W", "error::DeprecationWarning", "--drive-probe")
    with pytest.warns(DeprecationWarning, match="old"):  # of the probe, which is no test's
        result = run(folder, "--drive-agent", "warning", "--drive-executor", executor, *as_errors)
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(["*probe: warning drove route 1 clean twice with seed 0: the same 53 ticks *"])


def test_an_agent_that_ends_the_process_does_not_end_a_run_that_drives_in_it(suite):
    leaving = """
class Leaving(ScriptedAgent):
    def act(self, observation):
        os._exit(0)


def leaving():
    return Leaving([Control(throttle=1.0)])


AGENTS.append(leaving)
"""
    result = suite("DS under clean >= 60", conftest=leaving).runpytest_subprocess(
        "--drive-robust", "--drive-agent=leaving"
    )
    assert result.ret == 1
    result.stdout.fnmatch_lines(["*act raised SystemExit: os._exit(0)*", "*1 failed*"])
