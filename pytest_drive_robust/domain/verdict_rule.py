"""The rule that judges requirements: what counts as shown, how often a verdict may be wrong, when reading may stop."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from pytest_drive_robust.errors import UnknownNameError, UsageError

VERDICT_KINDS = ("auto", "evidence", "list", "point")
_FEWEST_FOR_EVIDENCE = 20
_TOP_SCORE = 100.0


@dataclass(frozen=True, slots=True)
class VerdictRule:
    """How episode scores become a verdict.

    `kind`: `"evidence"` judges all routes and seeds like the given ones, in three verdicts, each side wrong at most
    `alpha` of the time. `"list"` judges exactly the given routes and seeds. `"point"` compares the value over all given
    routes and seeds with the limit. `"evidence"` and `"list"` read routes in planned order and stop once the verdict is
    known. `"auto"` is `"evidence"` with 20 routes or more, which evidence needs, and `"list"` with fewer.

    `margin` is how far beyond the limit a pass may reach, as a share of the metric's range (0.10 is 0.10 RD or SR, 10
    points of DS). Below `clean_floor` (mean clean driving score, 0..100) an RD says nothing: with every `kind` a pass
    becomes inconclusive, and a fail stays a fail. `family` is the number of requirements among which a fail by evidence
    must stand: the alpha of a fail is divided by `family`, the alpha of a pass is not.

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
                raise UsageError(
                    f"the verdict's {name} is {value!r}, expected a number between {low:g} and {high:g}. "
                    f"Set it with --drive-{name}."
                )
        if not 0.0 <= self.clean_floor <= _TOP_SCORE:
            raise UsageError(f"the floor of the clean driving score is {self.clean_floor!r}, expected 0..100.")
        if self.family < 1:
            raise UsageError(f"the verdict's family is {self.family!r}, expected a whole number of 1 or more.")

    @property
    def fail_alpha(self) -> float:
        """How often a fail by evidence may be wrong: `alpha / family`."""
        return self.alpha / self.family

    def for_routes(self, count: int) -> VerdictRule:
        """Return this rule with `"auto"` resolved for `count` routes."""
        if self.kind != "auto":
            return self
        return replace(self, kind="evidence" if count >= _FEWEST_FOR_EVIDENCE else "list")
