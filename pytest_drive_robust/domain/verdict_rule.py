"""By which rule requirements are judged: what counts as shown, how sure one wants to be, when reading may stop."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from pytest_drive_robust.errors import UnknownNameError, UsageError

VERDICT_KINDS = ("auto", "evidence", "list", "point")
_FEWEST_FOR_EVIDENCE = 20
_TOP_SCORE = 100.0


@dataclass(frozen=True, slots=True)
class VerdictRule:
    """How verdicts come about.

    `kind`: `"evidence"` asks about routes and seeds like these, in three verdicts, wrong at most `alpha` of the time a
    side; `"list"` about exactly the given routes and seeds; `"point"` compares the value of all of them with the limit.
    The first two read routes in planned order and stop once the verdict is in; `"auto"` is evidence where there are 20
    routes or more, which is what it needs, and the list otherwise. `margin` is how far beyond the limit
    "pass" may reach, as a share of the metric's range (0.10 is 0.10 RD or SR, 10 points of DS). Below `clean_floor`
    (mean clean driving score, 0..100) an RD says nothing: by every kind it never passes but is inconclusive, and a fail
    stays a fail. `family` is among how many requirements a fail by evidence must stand: the alpha of a fail is divided
    by it, that of a pass is not.

    Raises `UsageError` for values that cannot be used.
    """

    kind: str = "auto"
    margin: float = 0.10
    alpha: float = 0.05
    clean_floor: float = 30.0
    family: int = 1

    def __post_init__(self) -> None:
        if self.kind not in VERDICT_KINDS:
            raise UnknownNameError.of("verdict rule", self.kind, VERDICT_KINDS, hint="Set it with --drive-verdict.")
        for name, low, high in (("margin", 0.0, 1.0), ("alpha", 0.0, 0.5)):
            value = getattr(self, name)
            if not (isinstance(value, (int, float)) and math.isfinite(value) and low < value < high):
                raise UsageError(f"the verdict's {name} is {value!r}, expected a number between {low:g} and {high:g}.")
        if not 0.0 <= self.clean_floor <= _TOP_SCORE:
            raise UsageError(f"the floor of the clean driving score is {self.clean_floor!r}, expected 0..100.")
        if self.family < 1:
            raise UsageError(f"the verdict's family is {self.family!r}, expected a whole number of 1 or more.")

    @property
    def fail_alpha(self) -> float:
        """How often a fail by evidence may be wrong."""
        return self.alpha / self.family

    def for_routes(self, count: int) -> VerdictRule:
        """Return the same with `"auto"` resolved for so many routes."""
        if self.kind != "auto":
            return self
        return replace(self, kind="evidence" if count >= _FEWEST_FOR_EVIDENCE else "list")
