"""Starts one command and outlives it until nothing that it started is left. Standard library only; run as a script.

An evaluator starts its server in a session of its own, so no process group reaches both. This process becomes the
parent of everything below it whose own parent ends (Linux), and kills all of it when the command is over, or when its
standard input ends, which it does when whoever started us closes it or dies.

    python subreaper.py COMMAND [ARGUMENTS]
"""

from __future__ import annotations

import ctypes
import os
import select
import signal
import subprocess
import sys
import time

_PR_SET_CHILD_SUBREAPER = 36
_LONGEST_S = 20.0
_POLL_S = 0.1


def main(command: list[str]) -> int:
    """Run the command. Returns its exit code, 128 + n when signal n ended it."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: None)  # our end is the end of our input
    child = subprocess.Popen(command, stdin=subprocess.DEVNULL, start_new_session=True)
    code = _watched(child.pid)
    _kill_all(child.pid)
    return code


def _watched(child: int) -> int:
    """Reap whoever ends until the child has, or until our input ends."""
    while True:
        for pid, status in _reaped():
            if pid == child:
                return os.WEXITSTATUS(status) if os.WIFEXITED(status) else 128 + os.WTERMSIG(status)
        readable, _, _ = select.select([0], [], [], _POLL_S)
        if readable and not os.read(0, 4096):
            return 128 + signal.SIGKILL


def _kill_all(child: int) -> None:
    """Kill what is below us again and again: a process that is killed may just have started another one."""
    until_s = time.monotonic() + _LONGEST_S
    _kill(child, group=True)
    while time.monotonic() < until_s:
        _reaped()
        below = _below(os.getpid())
        if not below:
            return
        for pid in below:
            _kill(pid)
        time.sleep(0.02)


def _reaped() -> list[tuple[int, int]]:
    ended: list[tuple[int, int]] = []
    while True:
        try:
            pid, status = os.waitpid(-1, os.WNOHANG)
        except ChildProcessError:
            return ended
        if pid == 0:
            return ended
        ended.append((pid, status))


def _kill(pid: int, *, group: bool = False) -> None:
    try:
        if group:
            os.killpg(pid, signal.SIGKILL)
        else:
            os.kill(pid, signal.SIGKILL)
    except (ProcessLookupError, PermissionError):
        pass


def _below(root: int) -> list[int]:
    """Return every process below `root`; children that only wait to be reaped do not count."""
    children: dict[int, list[int]] = {}
    for name in os.listdir("/proc") if os.path.isdir("/proc") else []:
        if not name.isdecimal():
            continue
        try:
            with open(f"/proc/{name}/stat", "rb") as file:
                state, parent = file.read().rpartition(b")")[2].split()[:2]
        except OSError:
            continue
        if state != b"Z":
            children.setdefault(int(parent), []).append(int(name))
    found: list[int] = []
    open_ends = [root]
    while open_ends:
        nearer = children.get(open_ends.pop(), [])
        found += nearer
        open_ends += nearer
    return found


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
