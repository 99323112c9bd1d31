"""The environment variables that an official agent reads: these variables decide how the agent drives."""

from __future__ import annotations

import os
import re
from pathlib import Path

from pytest_drive_robust.errors import UsageError

PLANNER_TYPE = "PLANNER_TYPE"
"""The variable that tells official agents, such as TCP, which of their outputs drives; modules of an agent read it."""
_ASKS_FOR = re.compile(r"""(?:environ(?:\.get\(|\[)|getenv\()\s*['"](\w+)['"]""")
_NEEDS_PLANNER_TYPE = re.compile(
    rf"""(?:environ(?:\.get\(|\[)|getenv\()\s*['"]{PLANNER_TYPE}['"]\s*(?:,\s*(?:None|''|"")\s*)?[\])]"""
)


def asked_variables(file: Path) -> frozenset[str]:
    """Return the variables that the agent's file reads by name; those that its imported modules read are left out."""
    return frozenset(_ASKS_FOR.findall(file.read_text(encoding="utf-8", errors="replace")))


def require_planner_type(file: Path) -> None:
    """Raise `UsageError` if the agent's file reads `PLANNER_TYPE` without a default and the variable is unset or empty.

    Without the variable such an agent, TCP for example, fails in its first tick, and every route would count as an
    error of the agent.
    """
    if os.environ.get(PLANNER_TYPE):
        return
    if _NEEDS_PLANNER_TYPE.search(file.read_text(encoding="utf-8", errors="replace")):
        raise UsageError(
            f"the agent file {str(file)!r} reads the environment variable {PLANNER_TYPE}, which is unset or empty. "
            f"Set it to what the agent expects; for TCP: export {PLANNER_TYPE}=only_traj, only_ctrl or merge_ctrl_traj."
        )
