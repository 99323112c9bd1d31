"""Ctrl-C twice: the second one must not cut off the reports. Where SIGINT is ignored it stays ignored."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest
from patience import PATIENCE_S

from pytest_drive_robust.plugin.interrupt import InterruptPlugin


@pytest.fixture(params=[signal.default_int_handler, signal.SIG_IGN], ids=["foreground", "background"])
def before(request: pytest.FixtureRequest) -> Iterator[object]:
    inherited = signal.signal(signal.SIGINT, request.param)
    yield request.param
    signal.signal(signal.SIGINT, inherited)


def test_the_second_one_is_left_out_and_the_third_interrupts(before):
    plugin = InterruptPlugin()
    plugin.pytest_keyboard_interrupt()
    plugin.pytest_keyboard_interrupt()
    signal.raise_signal(signal.SIGINT)
    if before is signal.SIG_IGN:
        signal.raise_signal(signal.SIGINT)
    else:
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    plugin.pytest_unconfigure()
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.parametrize("option", ["-s", "--pdb"])
def test_leaving_the_debugger_stores_nothing_about_the_agent(tmp_path, option):
    (tmp_path / "stops.py").write_text(
        "from pytest_drive_robust import Control\n"
        "class Stops:\n"
        "    def sensors(self): return []\n"
        "    def reset(self, route, seed): pass\n"
        "    def act(self, observation):\n"
        "        breakpoint()\n"
        "        return Control()\n"
    )
    (tmp_path / "test_it.py").write_text(
        "from pytest_drive_robust import requirements\n"
        "def test_it(drive):\n"
        "    drive.check(requirements('DS under clean >= 10')[0])\n"
    )
    words = ["--drive-robust", option, "--drive-agent", "stops:Stops", "--drive-routes", "601"]
    for _ in range(2):  # the second one stops there again
        done = subprocess.run(
            [sys.executable, "-m", "pytest", *words], cwd=tmp_path, input="q\n", capture_output=True, text=True,
            timeout=PATIENCE_S, check=False,
        )  # fmt: skip
        assert done.returncode == 2, done.stdout + done.stderr
        assert "(Pdb)" in done.stdout
        assert "the debugger was left" in done.stdout
    assert not list((tmp_path / ".drive-robust").rglob("*.episode"))
