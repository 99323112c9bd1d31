"""`drive-robust check-agent`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import cv2
import pytest

from pytest_drive_robust.cli.main import main
from pytest_drive_robust.simulators.routes import resolve_routes

FAKE = "pytest_drive_robust.testing:FakeSimulator"

pytestmark = pytest.mark.usefixtures("agents_folder")


def test_an_agent_that_keeps_the_contract_exits_with_0(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check-agent", "cli_agents:Good", "--sim", FAKE]) == 0
    shown = capsys.readouterr().out
    assert "keeps the contract" in shown
    assert "determinism" in shown


def test_an_agent_that_breaks_the_contract_exits_with_1(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check-agent", "cli_agents:Bad", "--sim", FAKE]) == 1
    shown = capsys.readouterr().out
    assert "breaks the contract" in shown
    assert "act returned None" in shown


@pytest.mark.usefixtures("two_threads")
def test_libraries_compute_on_one_thread_as_in_a_run() -> None:
    assert main(["check-agent", "cli_agents:OneThreaded", "--sim", FAKE]) == 0
    assert cv2.getNumThreads() == 2


BROKEN = """
from pytest_drive_robust.testing import FakeSimulator

def broken(options):
    return FakeSimulator(options, raises=OSError("the server is gone"), raises_in="observe", raises_at=3)
"""


def test_a_world_that_breaks_is_not_the_agents_fault(agents_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (agents_folder / "broken_world.py").write_text(BROKEN)
    assert main(["check-agent", "cli_agents:Good", "--sim", "broken_world:broken"]) == 1
    shown = capsys.readouterr().out
    assert "the server is gone" in shown
    assert "the simulator breaks: whether cli_agents:Good on " in shown
    assert "keeps the contract is not known" in shown
    assert "breaks the contract" not in shown


def test_a_module_that_only_pytest_finds_is_to_be_put_on_the_path(
    agents_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As with `pythonpath = src` in the ini file, which a line `replay:` of pytest does not tell."""
    (agents_folder / "src").mkdir()
    (agents_folder / "cli_agents.py").rename(agents_folder / "src" / "agents_of_src.py")
    assert main(["check-agent", "agents_of_src:Good"]) == 4
    assert "Put its folder on PYTHONPATH, as in PYTHONPATH=src; `pythonpath` of the ini" in capsys.readouterr().err


def test_every_route_that_is_named_is_checked(capsys: pytest.CaptureFixture[str]) -> None:
    ids = [route.id for route in resolve_routes("full")[:2]]
    assert main(["check-agent", "cli_agents:Good", "--sim", FAKE, "--routes", ",".join(ids)]) == 0
    assert capsys.readouterr().out.count("keeps the contract") == 2


def test_one_route_on_which_the_contract_is_broken_is_enough(
    agents_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = (route.id for route in resolve_routes("full")[:2])
    (agents_folder / "picky.py").write_text(
        "from cli_agents import Good\n"
        "class Picky(Good):\n"
        "    def reset(self, route, seed): self.route = route.id\n"
        f"    def act(self, observation): return None if self.route == '{first}' else super().act(observation)\n"
    )
    assert main(["check-agent", "picky:Picky", "--sim", FAKE, "--routes", f"{first},{second}"]) == 1
    assert "breaks the contract" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["nobody"], "no agent named 'nobody'"),
        (["cli_agents:Good", "--sim", "embeded"], "Did you mean 'embedded'"),
        (["cli_agents:Good", "--sim", "bench2drive"], "python -m pytest_drive_robust.bench2drive.evaluator run"),
        (["cli_agents:Good", "--sim", FAKE, "--routes", "dev11"], "Did you mean 'dev10'"),
        (["cli_agents:Good", "--sim", FAKE, "--routes", ""], "--routes is empty, expected SET: "),
    ],
)
def test_what_cannot_be_checked_exits_with_4(
    arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check-agent", *arguments]) == 4
    shown = capsys.readouterr().err
    assert told in shown
    assert shown.startswith("drive-robust: ")


@pytest.mark.parametrize("seed", [-1, 2**53])
def test_a_seed_that_no_run_takes_is_refused(capsys: pytest.CaptureFixture[str], seed: int) -> None:
    assert main(["check-agent", "cli_agents:Good", "--sim", FAKE, f"--seed={seed}"]) == 4
    assert f"--seed holds {seed}, expected" in capsys.readouterr().err


HANGING = """
from cli_agents import Good

class Hangs(Good):
    def act(self, observation):
        while True:
            try:
                pass
            except Exception:
                pass
"""


def test_a_call_that_hangs_ends_after_the_time_that_it_may_take(
    agents_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (agents_folder / "hanging_agents.py").write_text(HANGING)
    assert main(["check-agent", "hanging_agents:Hangs", "--sim", FAKE, "--act-timeout", "0.3s"]) == 1
    shown = capsys.readouterr().out
    assert "ok      declarations" in shown
    assert "FAILED  controls      tick 0: act raised TimeoutError: the call takes more than 0.3 s (" in shown
    assert "hanging_agents.py:" in shown


def test_weights_that_are_not_there_exit_with_4(agents_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    module = "from cli_agents import Good\nclass Lost(Good):\n    weights = ('no-such-file.pt',)\n"
    (agents_folder / "losing_agents.py").write_text(module)
    assert main(["check-agent", "losing_agents:Lost", "--sim", FAKE]) == 4
    assert "'no-such-file.pt', which cannot be read" in capsys.readouterr().err


def test_an_agent_that_a_run_would_refuse_by_its_check_exits_with_4(
    agents_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    module = """
from cli_agents import Good
from pytest_drive_robust.errors import UsageError

class Checked(Good):
    @classmethod
    def check(cls):
        raise UsageError("the map of Checked is not here")
"""
    (agents_folder / "checked_agents.py").write_text(module)
    assert main(["check-agent", "checked_agents:Checked", "--sim", FAKE]) == 4
    assert "the map of Checked is not here" in capsys.readouterr().err


def test_an_agent_that_leaves_when_it_is_made_exits_with_4_and_not_as_it_said(
    agents_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    module = "import sys\nfrom cli_agents import Good\nclass Leaves(Good):\n    __init__ = lambda self: sys.exit(0)\n"
    (agents_folder / "leaving_agents.py").write_text(module)
    assert main(["check-agent", "leaving_agents:Leaves", "--sim", FAKE]) == 4
    assert "could not be made: SystemExit: 0" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("body", "code", "told"),
    [
        ("act = lambda self, observation: os._exit(0)", 1, "controls      tick 0: act raised SystemExit: os._exit(0)"),
        ("__init__ = lambda self: os._exit(0)", 4, "could not be made: SystemExit: os._exit(0)"),
        ("act = lambda self, observation: in_thread(0)", 1, "a thread of the agent, or of what it uses, called"),
    ],
    ids=["act", "constructor", "thread"],
)
def test_an_agent_that_ends_the_process_does_not_pass(agents_folder: Path, body: str, code: int, told: str) -> None:
    thread = "import os, threading\ndef in_thread(status): threading.Thread(target=os._exit, args=(status,)).start()\n"
    (agents_folder / "leaving_agents.py").write_text(
        f"{thread}from cli_agents import Good\nclass Leaves(Good):\n    {body}\n"
    )
    command = [sys.executable, "-m", "pytest_drive_robust.cli", "check-agent", "leaving_agents:Leaves", "--sim", FAKE]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == code
    assert told in ended.stdout + ended.stderr
