"""Starts one command and outlives it until nothing that it started is left. Standard library only; run as a script.

An evaluator starts its server in a session of its own, so no process group reaches both: what belongs to the command is
known by a mark in its environment, which every process inherits. All of it is killed when the command is over, or when
our standard input ends, which it does when whoever started us closes it or dies.

    PDR_ATTEMPT=MARK python guard.py COMMAND [ARGUMENTS]
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

MARK = "PDR_ATTEMPT"
_LONGEST_S = 20.0
_POLL_S = 0.1


def main(command: list[str]) -> int:
    """Run the command. Returns its exit code, 128 + n when signal n ended it."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: None)  # our end is the end of our input
    child = subprocess.Popen(command, stdin=subprocess.DEVNULL, start_new_session=True)
    while child.poll() is None:
        readable, _, _ = select.select([0], [], [], _POLL_S)
        if readable and not os.read(0, 4096):
            child.kill()
            child.wait()
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(child.pid, signal.SIGKILL)  # also those that wrote over their environment
    kill_marked(os.environ[MARK])
    return child.returncode if child.returncode >= 0 else 128 - child.returncode


def kill_marked(mark: str) -> None:
    """Kill all others with the mark again and again: one that is killed may just have started another one."""
    until_s = time.monotonic() + _LONGEST_S
    while (left := [pid for pid in marked(mark) if pid != os.getpid()]) and time.monotonic() < until_s:
        for pid in left:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.kill(pid, signal.SIGKILL)
        time.sleep(0.02)


def marked(mark: str) -> list[int]:
    """Return the processes that inherited the mark, dead ones excepted."""
    if not os.path.isdir("/proc"):
        return []
    sign = f"{MARK}={mark}".encode()
    return [
        int(name) for name in os.listdir("/proc") if name.isdecimal() and sign in read_process(int(name), "environ")
    ]


def read_process(pid: int, name: str) -> bytes:
    """Return what Linux tells of a process in this file; nothing when it is gone."""
    try:
        return Path(f"/proc/{pid}/{name}").read_bytes()
    except OSError:
        return b""


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
