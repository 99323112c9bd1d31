"""Run one command and kill every process that it has started. Standard library only; run as a script.

An evaluator starts its server in a session of its own, so no process group reaches both. Therefore a mark in the
environment, which every process inherits, tells which processes belong to the command. They are killed when the command
is over, or when our standard input ends because our parent process closes it or dies.

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
    """Run the command and return its exit code, 128 + n when signal n ended the command."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: None)  # only the end of our input ends us
    child = subprocess.Popen(command, stdin=subprocess.DEVNULL, start_new_session=True)
    while child.poll() is None:
        readable, _, _ = select.select([0], [], [], _POLL_S)
        if readable and not os.read(0, 4096):
            child.kill()
            child.wait()
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(child.pid, signal.SIGKILL)  # also processes that have overwritten their environment
    kill_marked(os.environ[MARK])
    return child.returncode if child.returncode >= 0 else 128 - child.returncode


def kill_marked(mark: str) -> None:
    """Kill all other processes with the mark, repeatedly: a killed process may just have started another one."""
    until_s = time.monotonic() + _LONGEST_S
    while (left := [pid for pid in marked(mark) if pid != os.getpid()]) and time.monotonic() < until_s:
        for pid in left:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.kill(pid, signal.SIGKILL)
        time.sleep(0.02)


def marked(mark: str) -> list[int]:
    """Return the ids of the living processes that inherited the mark."""
    if not os.path.isdir("/proc"):
        return []
    sign = f"{MARK}={mark}".encode()
    return [
        int(name) for name in os.listdir("/proc") if name.isdecimal() and sign in read_process(int(name), "environ")
    ]


def read_process(pid: int, name: str) -> bytes:
    """Return the content of `/proc/PID/NAME`, empty when the process is gone."""
    try:
        return Path(f"/proc/{pid}/{name}").read_bytes()
    except OSError:
        return b""


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
