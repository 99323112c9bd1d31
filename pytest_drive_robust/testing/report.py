"""What a contract check found: one line for each promise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pytest_drive_robust.runner.episode.contract import BLAMED, blame


@dataclass(frozen=True, slots=True)
class Check:
    """One promise. `sentence` says what was seen, and when it failed, what to do."""

    name: str
    ok: bool
    sentence: str


@dataclass(frozen=True, slots=True)
class ContractReport:
    """All promises of one subject, in the order in which they were tried; those that need a broken one are left out."""

    subject: str
    checks: tuple[Check, ...]

    @property
    def ok(self) -> bool:
        """True when something was checked and nothing failed."""
        return bool(self.checks) and all(check.ok for check in self.checks)

    def __getitem__(self, name: str) -> Check:
        return next(check for check in self.checks if check.name == name)

    def __str__(self) -> str:
        width = max((len(check.name) for check in self.checks), default=0)
        marks = {True: "ok    ", False: "FAILED"}
        lines = [f"  {marks[check.ok]}  {check.name:{width}}  {check.sentence}" for check in self.checks]
        return "\n".join([f"{self.subject} {'keeps' if self.ok else 'breaks'} the contract", *lines])


def attempt(whose: str, check: Callable[..., Check], *arguments: object) -> Check:
    """Return what `check` finds; where it raises, a failed check of its name that says what `whose` code raised."""
    try:
        return check(*arguments)
    except BLAMED as error:
        return Check(check.__name__.lstrip("_"), False, f"{blame(whose, error)}.")
