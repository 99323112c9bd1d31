"""`path/to/agent_file.py+path/to/config`: the leaderboard's `--agent` and `--agent-config` in one text."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from pytest_drive_robust.errors import UsageError, nearest

__all__ = ["Reference"]

_SYNTAX = "expected leaderboard:path/to/agent_file.py, or leaderboard:path/to/agent_file.py+path/to/config"
_LOOKS_LIKE_A_FILE = re.compile(r".*[/\\].*|.+\.[A-Za-z]\w*")


@dataclass(frozen=True, slots=True)
class Reference:
    """An agent file, and the text that its `setup` is given; the text may name files, joined by `+`."""

    file: Path
    config: str

    @classmethod
    def parse(cls, text: str) -> Reference:
        """Read the text. Relative paths are from the current folder. Raises `UsageError` for files that are not there.

        >>> Reference.parse("")
        Traceback (most recent call last):
        pytest_drive_robust.errors.UsageError: leaderboard names no agent file: expected \
leaderboard:path/to/agent_file.py, or leaderboard:path/to/agent_file.py+path/to/config.
        """
        name, _, config = text.partition("+")
        if not name:
            raise UsageError(f"leaderboard names no agent file: {_SYNTAX}.")
        file = Path(name).expanduser()
        if not file.is_file():
            raise UsageError(f"there is no agent file {name!r}{_instead(file)}: {_SYNTAX}.")
        if file.suffix != ".py":
            raise UsageError(f"the agent file {name!r} is no Python file: {_SYNTAX}.")
        for part in filter(None, config.split("+")):
            if _LOOKS_LIKE_A_FILE.fullmatch(part) and not Path(part).expanduser().exists():
                raise UsageError(
                    f"there is no {part!r}{_instead(Path(part))}, which leaderboard:{text} names as configuration of "
                    f"the agent: {_SYNTAX}."
                )
        return cls(file.resolve(), config)

    @property
    def config_files(self) -> tuple[Path, ...]:
        """Every file that the configuration names, those within its folders included."""
        found: list[Path] = []
        for part in filter(None, self.config.split("+")):
            path = Path(part).expanduser()
            if path.is_file():
                found.append(path)
            elif path.is_dir():
                found += sorted(file for file in path.rglob("*") if file.is_file() and "__pycache__" not in file.parts)
        return tuple(found)


def _instead(missing: Path) -> str:
    """Return `" (did you mean 'agent.py'?)"`, or nothing."""
    folder = missing.parent
    if not folder.is_dir():
        return ""
    close = nearest(missing.name, [path.name for path in folder.iterdir()])
    return f" (did you mean {str(folder / close)!r}?)" if close is not None else ""
