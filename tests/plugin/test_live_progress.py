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
        if not (LOG.parent / "seen").exists():
            time.sleep(0.05)
        return super().act(observation)


def slow():
    print("captured agent output")
    return Slow([Control(throttle=1.0)])


AGENTS.append(slow)
"""


LINE = re.compile(r"slow, (clean|throttle 0\.5), \d Straight")


def plain(output: str) -> str:
    """Leave out colours and movements."""
    return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", output)


def screen_of(output: str) -> list[str]:
    """Return the lines that a terminal shows in the end: what was overwritten or erased is gone."""
    lines, row, column = [""], 0, 0
    for code, letter in re.findall(r"\x1b\[([0-9;?]*[A-Za-z])|([^\x1b])", output):
        count = int(code[:-1]) if code[:-1].isdigit() else 1
        if letter == "\n":
            row += 1
            lines += [""] * (row + 1 - len(lines))
        elif letter == "\r":
            column = 0
        elif letter:
            lines[row] = f"{lines[row][:column]:{column}}{letter}{lines[row][column + 1 :]}"
            column += 1
        elif code.endswith("A"):
            row -= count
        elif code.endswith("C"):
            column += count
        elif code == "2K":
            lines[row] = ""
    return lines


def run_on_a_terminal(folder, *args, columns=100, term="xterm-256color"):
    """What a terminal would be sent, and the exit code. The run is slow until the line was seen."""
    main, other = pty.openpty()
    environment = {**os.environ, "COLUMNS": str(columns), "TERM": term}
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
            if LINE.search(plain(b"".join(chunks).decode(errors="replace"))):
                (folder.path / "seen").touch()
    os.close(main)
    return b"".join(chunks).decode(), process.returncode


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo terminal")
@pytest.mark.parametrize("workers", [(), ("-n2",)], ids=["one-process", "two-workers"])
def test_a_terminal_shows_how_far_the_run_is(suite, workers):
    folder = suite("RD under throttle 0.5 <= 0.90", conftest=SLOW)
    output, code = run_on_a_terminal(folder, *workers)
    assert code == 0, output
    text = plain(output)
    assert re.search(r"\d/6 episodes", text), text
    assert LINE.search(text), text
    assert "captured agent output" not in text
    assert "\x1b[2K" in output, "the line is erased"
    shown = screen_of(output)
    assert not any(LINE.search(line) for line in shown), shown
    own = r"\." if workers else r"test_\w+\.py \."
    assert any(re.fullmatch(rf"{own} +\[100%\]", line) for line in shown), "pytest's line is whole"
    assert re.search(r"slow +clean +100\.00", text), text


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo terminal")
def test_a_terminal_that_cannot_take_a_line_back_is_given_plain_ones(suite):
    folder = suite("RD under throttle 0.5 <= 0.90", conftest=SLOW)
    output, code = run_on_a_terminal(folder, "--drive-agent", "steady", term="dumb")
    assert code == 0, output
    assert "drive-robust: steady under clean done, 3/6 episodes" in output
    assert "\x1b" not in output


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo terminal")
def test_the_table_fits_a_narrow_terminal(suite):
    folder = suite("RD under throttle 0.5 and throttle 0.9 and throttle 0.7 and throttle 0.8 <= 0.90", conftest=SLOW)
    output, code = run_on_a_terminal(folder, columns=80)
    assert code == 0, output
    table = plain(output).replace("\r", "").partition("= drive-robust =")[2].splitlines()
    assert any("throttle 0.5" in line for line in table)
    assert max(map(len, table)) <= 80, table
