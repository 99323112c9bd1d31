"""Parse and check `FILE.py+CONFIG`, the name of an official agent."""

from __future__ import annotations

import re
from pathlib import Path

from pytest_drive_robust.errors import UsageError, nearest

_SYNTAX = "expected leaderboard:path/to/agent_file.py, or leaderboard:path/to/agent_file.py+path/to/config"
_LOOKS_LIKE_A_FILE = re.compile(r".*[/\\].*|.+\.[A-Za-z]\w*")


def split_argument(argument: str) -> tuple[Path, str]:
    """Return the absolute path of the agent's file, and the text for its `setup`, which may name files joined by `+`.

    Raises `UsageError` if the agent's file is missing or no Python file.
    """
    name, _, config = argument.partition("+")
    if not name:
        raise UsageError(f"leaderboard names no agent file: {_SYNTAX}.")
    file = Path(name).expanduser()
    if not file.is_file():
        raise UsageError(f"there is no agent file {name!r}{_instead(file)}: {_SYNTAX}.")
    if file.suffix != ".py":
        raise UsageError(f"the agent file {name!r} is no Python file: {_SYNTAX}.")
    return file.resolve(), config


def require_configuration(argument: str, config: str, *, root: Path | None = None) -> None:
    """Raise `UsageError` for a part of the configuration that looks like a file and is not there.

    Relative paths are looked for in the current folder, then in `root`.
    """
    for part in filter(None, config.split("+")):
        path = Path(part).expanduser()
        if _LOOKS_LIKE_A_FILE.fullmatch(part) and not path.exists() and not (root and (root / path).exists()):
            near = _instead(path) or (_instead(root / path) if root else "")
            raise UsageError(
                f"there is no {part!r}{near}, which leaderboard:{argument} names as configuration of the agent: "
                f"{_SYNTAX}."
            )


def _instead(missing: Path) -> str:
    """Return `" (did you mean 'agent.py'?)"` with the nearest name in the same folder, or nothing."""
    folder = missing.parent
    if not folder.is_dir():
        return ""
    close = nearest(missing.name, [path.name for path in folder.iterdir()])
    return f" (did you mean {str(folder / close)!r}?)" if close is not None else ""
