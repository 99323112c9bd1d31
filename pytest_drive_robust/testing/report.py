"""The report of a contract check: one line for each promise."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from pytest_drive_robust.errors import AgentError, UnknownNameError
from pytest_drive_robust.runner.episode.contract import BLAMED, blame


@dataclass(frozen=True, slots=True)
class Check:
    """The result for one promise. `sentence` says what was found, and for a failed check, what to do.

    `of_simulator`: the check failed because the simulator broke, which is not the subject's fault.
    """

    name: str
    ok: bool
    sentence: str
    of_simulator: bool = False

    def line(self, width: int) -> str:
        """Return a line of the report, with `width` columns for the name."""
        return f"  {'ok    ' if self.ok else 'FAILED'}  {self.name:{width}}  {self.sentence}"


@dataclass(frozen=True, slots=True)
class ContractReport:
    """All checks of one subject, in the order of their runs; checks that need a broken promise are left out.

    `bool(report)` is `report.ok`. Iterate over the checks, or take a check by its name: `report["controls"]`.
    """

    subject: str
    checks: tuple[Check, ...]

    @property
    def ok(self) -> bool:
        """True when there is at least one check and no check failed."""
        return bool(self.checks) and all(check.ok for check in self.checks)

    def __bool__(self) -> bool:
        return self.ok

    def __iter__(self) -> Iterator[Check]:
        return iter(self.checks)

    def __getitem__(self, name: str) -> Check:
        """Return the check called `name`. Raises `UnknownNameError` for a check that was left out or does not exist."""
        found = {check.name: check for check in self.checks}
        if name not in found:
            raise UnknownNameError.of("check in this report", name, found)
        return found[name]

    def __str__(self) -> str:
        width = max((len(check.name) for check in self.checks), default=0)
        return "\n".join([self.verdict, *(check.line(width) for check in self.checks)])

    @property
    def verdict(self) -> str:
        """The first line: whether the subject keeps the contract."""
        failed = [check for check in self.checks if not check.ok]
        if failed and all(check.of_simulator for check in failed):
            return f"the simulator breaks: whether {self.subject} keeps the contract is not known"
        return f"{self.subject} {'keeps' if self.ok else 'breaks'} the contract"


class Broken(Exception):  # noqa: N818 - a promise is broken, which is what the check was for
    """A promise is broken. The text says what was found, and what to do; `of_simulator` is that of `Check`."""

    def __init__(self, sentence: str, *, of_simulator: bool = False) -> None:
        super().__init__(sentence)
        self.of_simulator = of_simulator


def attempt(whose: str, promise: Callable[..., str], *arguments: object) -> Check:
    """Return the check of a promise, under its own name.

    The promise returns what it found, or raises `Broken`. If the code of `whose` raises, the check names the error.
    """
    name = promise.__name__.lstrip("_")
    try:
        return Check(name, True, promise(*arguments))
    except Broken as broken:
        return Check(name, False, str(broken), broken.of_simulator)
    except AgentError as error:  # it says whose call it was
        return Check(name, False, f"{error}.")
    except BLAMED as error:
        return Check(name, False, f"{blame(whose, error)}.")
