"""Run a module (`python without_posix.py pytest ...`) in a Python that has as little of POSIX as that of Windows.

What only Linux and macOS have is taken away before the module is imported. `sys.platform` is no real system: where a
library looks for `"win32"` it would go on to call Windows.
"""

from __future__ import annotations

import os
import runpy
import signal
import subprocess  # noqa: F401 - is made for POSIX when it is imported, and stays so
import sys
import sysconfig

_MODULES = ("fcntl", "grp", "pty", "pwd", "resource", "termios", "tty")
_FUNCTIONS = (
    *("fork", "forkpty", "getpgid", "getpgrp", "getpriority", "killpg", "mkfifo", "register_at_fork", "setpriority"),
    *("sched_getaffinity", "sched_setaffinity", "setsid", "statvfs", "sysconf", "waitid"),
)
_SIGNALS = ("SIGALRM", "SIGBUS", "SIGCHLD", "SIGHUP", "SIGKILL", "SIGQUIT", "SIGSTOP", "SIGUSR1", "SIGUSR2")


def forget_posix() -> None:
    sysconfig.get_config_vars()  # reads a file that is named after the platform
    for name in _MODULES:
        sys.modules[name] = None  # type: ignore[assignment] # importing it raises ModuleNotFoundError
    for name in _FUNCTIONS:
        if hasattr(os, name):
            delattr(os, name)
    for name in (*_SIGNALS, "alarm", "pthread_sigmask", "setitimer"):
        if hasattr(signal, name):
            delattr(signal, name)
    sys.platform = "pretended"


if __name__ == "__main__":
    forget_posix()
    del sys.argv[0]
    sys.path[0] = os.getcwd()  # where this file lies is no business of the module
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
