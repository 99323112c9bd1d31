"""On a terminal, a line that shows how far the run is, and that is gone at the end."""

from __future__ import annotations

import os
import pty
import re
import subprocess
import sys

import pytest

SLOW = """

class Slow(ScriptedAgent):
    def act(self, observation):
        import time
        time.sleep(0.005)
        return super().act(observation)


def slow():
    print("captured agent output")
    return Slow([Control(throttle=1.0)])


AGENTS.append(slow)
"""


def run_on_a_terminal(folder, *args):
    """What a terminal of 100 columns would be sent, and the exit code."""
    main, other = pty.openpty()
    environment = {**os.environ, "COLUMNS": "100", "TERM": "xterm-256color"}
    command = [sys.executable, "-m", "pytest", "--drive-robust", "--drive-agent", "slow", *args]
    with subprocess.Popen(
        command, cwd=folder.path, stdout=other, stderr=other, stdin=other, env=environment
    ) as process:
        os.close(other)
        chunks = []
        while True:
            try:
                chunk = os.read(main, 65536)
            except OSError:  # the other side is closed: the process has ended
                break
            if not chunk:
                break
            chunks.append(chunk)
    os.close(main)
    return b"".join(chunks).decode(), process.returncode


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo terminal")
@pytest.mark.parametrize("workers", [(), ("-n2",)], ids=["one-process", "two-workers"])
def test_a_terminal_shows_how_far_the_run_is(suite, workers):
    folder = suite("RD under throttle 0.5 <= 0.90", conftest=SLOW)
    output, code = run_on_a_terminal(folder, *workers)
    assert code == 0, output
    plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", output)
    assert re.search(r"\d/6 episodes", plain), plain
    assert re.search(r"slow, (clean|throttle 0\.5), \d Straight", plain), plain
    assert "captured agent output" not in plain
    assert "\x1b[2K" in output, "the line is erased"
    assert re.search(r"slow +clean +100\.00", plain), plain
