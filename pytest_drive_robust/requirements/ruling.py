"""By which rule a requirement is judged: what counts as shown, how sure one wants to be, when reading may stop."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.requirements.known import known_metric

if TYPE_CHECKING:
    from pytest_drive_robust.requirements.model import Requirement
    from pytest_drive_robust.stats.rules import Rule

__all__ = ["VERDICT_KINDS", "Ruling", "margin_of", "reads_routes", "rule_of"]

VERDICT_KINDS = ("evidence", "list", "point")
_SCORE_RANGE = 100.0


@dataclass(frozen=True, slots=True)
class Ruling:
    """How verdicts come about.

    `kind`: `"evidence"` asks about routes and seeds like these, in three verdicts, wrong at most `alpha` of the time a
    side; `"list"` about exactly the given routes and seeds; `"point"` compares the value of all of them with the limit.
    The first two read routes in planned order and stop once the verdict is in. `margin` is how far beyond the limit
    "pass" may reach, as a share of the metric's range (0.10 is 0.10 RD or SR, 10 points of DS). Below `clean_floor`
    (mean clean driving score, 0..100) an RD says nothing and is inconclusive.

    Raises `UsageError` for values that cannot be used.
    """

    kind: str = "evidence"
    margin: float = 0.10
    alpha: float = 0.05
    clean_floor: float = 30.0

    def __post_init__(self) -> None:
        if self.kind not in VERDICT_KINDS:
            raise UnknownNameError.of("verdict rule", self.kind, VERDICT_KINDS, hint="Set it with --drive-verdict.")
        for name, low, high in (("margin", 0.0, 1.0), ("alpha", 0.0, 0.5)):
            value = getattr(self, name)
            if not (isinstance(value, (int, float)) and math.isfinite(value) and low < value < high):
                raise UsageError(f"the {name} of a verdict is {value!r}, expected a number between {low:g} and {high:g}.")
        if not 0.0 <= self.clean_floor <= _SCORE_RANGE:
            raise UsageError(f"the floor of the clean driving score is {self.clean_floor!r}, expected 0..100.")


def reads_routes(requirement: Requirement, ruling: Ruling) -> bool:
    """Whether the verdict is read route by route; a user's function over all episodes cannot be."""
    return ruling.kind != "point" and known_metric(requirement.metric).function is None


def margin_of(requirement: Requirement, ruling: Ruling) -> float:
    """The margin in the unit of the metric."""
    return ruling.margin * _range_of(requirement)


def rule_of(requirement: Requirement, ruling: Ruling) -> Rule:
    """The requirement as linear forms of one route's scores (see `stats.rules`)."""
    from pytest_drive_robust.stats.rules import degradation_rule, mean_rule

    metric = known_metric(requirement.metric)
    margin = margin_of(requirement, ruling)
    if metric.needs_clean:
        return degradation_rule(requirement.limit, margin, comparison=requirement.comparison)
    return mean_rule(requirement.limit, requirement.comparison, margin=margin, low=metric.low, high=metric.high)


def _range_of(requirement: Requirement) -> float:
    metric = known_metric(requirement.metric)
    if metric.needs_clean:
        return 1.0
    span = metric.high - metric.low
    return span if math.isfinite(span) else _SCORE_RANGE
