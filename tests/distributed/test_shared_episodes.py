"""Two workers of one run: they share episodes, and one that dies takes nothing with it."""

from __future__ import annotations

import os
from pathlib import Path

CRASHING = '''
import signal

class Crashing:
    """Kills its process in the first episode of the run that starts, once."""

    def sensors(self):
        return ()

    def reset(self, route, seed):
        flag = Path(__file__).parent / "crashed"
        try:
            flag.touch(exist_ok=False)
        except FileExistsError:
            return
        os.kill(os.getpid(), signal.SIGKILL)

    def act(self, observation):
        return Control(throttle=1.0)


AGENTS.append(Crashing)
'''

TESTS = """
import pytest
from pytest_drive_robust import requirement

@pytest.mark.parametrize("number", range(6))
def test_shared(drive, number):
    drive.check(requirement("DS") >= 90)
"""


def test_a_killed_worker_hangs_nobody_and_loses_only_its_own_test(suite, driven):
    folder = suite(test=TESTS, conftest=CRASHING)
    result = folder.runpytest_inprocess(
        "--drive-robust", "--drive-agent", "Crashing", "-n2", "--drive-json", "run.json"
    )
    assert result.ret == 1
    result.assert_outcomes(passed=5, failed=1)
    result.stdout.fnmatch_lines(["*worker 'gw?' crashed while running*", "Crashing  clean*100.00*pass"])
    # The episode that the dead worker had begun was begun again by somebody else; nothing was driven a third time.
    assert len(driven()) == 4


def test_both_workers_drive_and_each_episode_is_driven_once(suite, meeting, driven):
    where = """
def test_folder(request):
    from pathlib import Path
    folder = Path(request.config.workerinput["drive_robust_folder"])
    assert folder.is_dir()
    Path("folder.txt").write_text(str(folder))
"""
    folder = suite(test=TESTS + where, conftest=meeting)
    both = ("--drive-sim", "meeting", "-n2")
    result = folder.runpytest_inprocess("--drive-robust", *both, "--drive-seeds", ",".join(map(str, range(20))))
    result.assert_outcomes(passed=7)
    assert len(driven()) == len(set(driven())) == 60
    processes = {line.split()[2] for line in (folder.path / "driven.log").read_text().splitlines()}
    assert len(processes) == 2
    assert os.getpid() not in map(int, processes)
    shared = Path((folder.path / "folder.txt").read_text())
    assert not shared.exists(), "the run's folder goes with the run"
