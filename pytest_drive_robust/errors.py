"""Everything that can go wrong, as one tree.

::

    DriveRobustError
    ├── UsageError                the user gave something that we cannot use: exit code 4, nothing driven
    │   ├── UnknownNameError      no agent, perturbation, simulator, metric or route has that name
    │   ├── PerturbationError     a severity that no sensor or computer can have
    │   ├── RequirementError      a requirement that does not parse or can never be judged
    │   ├── RouteError            a route file that we do not understand
    │   └── PluginError           a third-party distribution that does not load
    ├── ComparisonError           two sets of episodes that must not be compared (an error, never a score)
    ├── BudgetSpentError          the time that the run was given is over (an error, never a score)
    ├── AgentError                the agent broke its contract during an episode (outcome `agent_error`)
    └── SimulationError           the simulator broke during an episode (outcome `infra_error`)
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

__all__ = [
    "AgentError",
    "BudgetSpentError",
    "ComparisonError",
    "DriveRobustError",
    "PerturbationError",
    "PluginError",
    "RequirementError",
    "RouteError",
    "SimulationError",
    "UnknownNameError",
    "UsageError",
    "did_you_mean",
    "nearest",
]


_MOST_NAMES = 8
"""The most known names that one message lists: nobody reads a longer list."""


class DriveRobustError(Exception):
    """Base of every error that this package raises on purpose."""


class UsageError(DriveRobustError):
    """The user gave something that we cannot use. pytest exits with code 4 before anything was driven."""


class UnknownNameError(UsageError):
    """No entry has this name. The message gives the nearest name, the known names and a hint."""

    @classmethod
    def of(
        cls, what: str, given: str, known: Iterable[str], *, hint: str = "", listed_by: str = ""
    ) -> UnknownNameError:
        """Return the error for the name `given`, which is not in `known`.

        The message lists the known names; of many only the nearest, and the command `listed_by`, which lists them all.
        """
        names = sorted(set(known))
        if not names:
            return cls(f"there is no {what} named {given!r}, nor any other. {hint}".rstrip())
        listed = f"Known: {', '.join(names)}."
        if len(names) > _MOST_NAMES:
            listed = f"Nearest of {len(names)}: {', '.join(_nearest_first(given, names)[:_MOST_NAMES])}."
            listed += f" `{listed_by}` lists all." if listed_by else ""
        return cls(f"there is no {what} named {given!r}.{did_you_mean(given, names)} {listed} {hint}".rstrip())


class PerturbationError(UsageError):
    """A severity that no sensor or computer can have: `ratio=1.5`, `ms=-100`."""


class RequirementError(UsageError):
    """A requirement that does not parse, or that can never be judged."""


class RouteError(UsageError):
    """A route file that we do not understand. The message names the file, the route and the element."""


class PluginError(UsageError):
    """A third-party entry point that does not load. The message names its distribution and version."""


class BudgetSpentError(DriveRobustError):
    """`--drive-budget` is used up before the episodes that a verdict needs were driven."""


class ComparisonError(DriveRobustError):
    """Two sets of episodes that must not be compared, or that hold no data to compare."""


class AgentError(DriveRobustError):
    """The agent broke its contract during an episode: exception, NaN, wrong type, out of range."""


class SimulationError(DriveRobustError):
    """The simulator broke during an episode. Such an episode is never scored."""


def nearest(given: str, known: Iterable[str]) -> str | None:
    """Return the known name that is closest to what was given, or None when nothing is close."""
    import difflib  # here: every pytest session imports this module

    lowered = {name.lower(): name for name in known}
    found = difflib.get_close_matches(str(given).lower(), lowered, n=1, cutoff=0.5)
    return lowered[found[0]] if found else None


def _nearest_first(given: str, names: Sequence[str]) -> list[str]:
    """Return the names, those first that are most like what was given, in the sense of `nearest`."""
    import difflib  # here, as in `nearest`

    compared = difflib.SequenceMatcher(b=str(given).lower())

    def likeness(name: str) -> float:
        compared.set_seq1(name.lower())
        return compared.ratio()

    return sorted(names, key=likeness, reverse=True)


def did_you_mean(given: str, known: Iterable[str]) -> str:
    """Return `" Did you mean 'expert'?"`, to append to a sentence; `""` when no known name is close."""
    close = nearest(given, known)
    return "" if close is None else f" Did you mean {close!r}?"


def first_few(names: Sequence[str], most: int) -> str:
    """Return `"a, b and 3 more"`: the first `most` names, and the number of the others."""
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")


def from_here(path: Path) -> Path:
    """Return a path as messages show it: relative to the current folder if it lies below that folder."""
    try:
        return path.relative_to(Path.cwd())
    except (ValueError, OSError):  # it lies elsewhere, or the current folder is gone
        return path
