"""Reads commit and author from git for the folder in which a run was started; empty when git does not know."""

from __future__ import annotations

import subprocess
from pathlib import Path

_PATIENCE_S = 10.0


def commit(folder: Path) -> str:
    """Return the commit's short name, with `-changed` when tracked files differ from it; empty outside a repository."""
    name = _git(folder, "rev-parse", "--short=9", "HEAD")
    changed = bool(name) and bool(_git(folder, "status", "--porcelain", "--untracked-files=no"))
    return f"{name}-changed" if changed else name


def author(folder: Path) -> str:
    """Return `"NAME <ADDRESS>"` from git's configuration; a part that is not configured is left out."""
    name, mail = _git(folder, "config", "user.name"), _git(folder, "config", "user.email")
    return f"{name} <{mail}>".strip() if mail else name


def _git(folder: Path, *words: str) -> str:
    """Return the output of a git command; empty when git fails or is not installed."""
    try:
        done = subprocess.run(["git", *words], cwd=folder, capture_output=True, timeout=_PATIENCE_S, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    text = done.stdout.decode("utf-8", errors="replace")  # names of files and people may be any bytes
    return text.strip() if done.returncode == 0 else ""
