"""How much of a failure must be survived: `latency margin >= 150 ms (RD <= 0.30)`.

It is the requirement at that severity, `RD under 150 ms latency <= 0.30`, said from the other side: judged by the same
rule, and when it is not met the message says how far the agent does get (`drive.largest`). The other severities of the
failure have their defaults; for others use `drive.largest` on an object.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from pytest_drive_robust.errors import PerturbationError, RequirementError, nearest
from pytest_drive_robust.perturbations.base import Perturbation, Setting
from pytest_drive_robust.perturbations.ladder import Ladder, failure_word, ladder_of
from pytest_drive_robust.verdict.known import known_metric
from pytest_drive_robust.verdict.model import Requirement, slug

__all__ = ["DEFAULT_LIMIT", "MarginRequirement", "parse_margin"]

DEFAULT_LIMIT = 0.30
"""The RD that a margin allows when its sentence does not say."""

_TICK_S = 0.05
"""Any will do: a ladder is built here for its field and unit, not for its steps."""

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_MARGIN = re.compile(
    rf"(?P<words>.+?)\s+margin\s*(?:>=|≥)\s*(?P<level>{_NUMBER})\s*(?P<unit>[a-z]*)"
    rf"(?:\s*\((?P<metric>\w+)\s*(?P<comparison><=|>=|≤|≥)\s*(?P<limit>{_NUMBER})\))?",
    re.IGNORECASE,
)
_COMPARISONS = {"≤": "<=", "≥": ">="}


class MarginRequirement(Requirement):
    """A requirement on one failure at one severity, shown as the margin that it is."""

    @classmethod
    def of(cls, perturbation: Perturbation, metric: str, comparison: str, limit: float) -> MarginRequirement:
        """`metric comparison limit` up to the severity of `perturbation`. Raises `RequirementError`."""
        return cls(metric, Setting.of(perturbation), comparison, limit)

    @property
    def perturbation(self) -> Perturbation:
        """The failure at the severity that must be survived."""
        return self.setting.perturbations[0]

    @property
    def id(self) -> str:
        """A test id: `"latency-margin-ge-150ms-rd-le-0.30"`."""
        return slug(str(self).replace(">=", "ge").replace("<=", "le"))

    def __str__(self) -> str:
        ladder = ladder_of(self.perturbation, dt_s=_TICK_S)
        level = ladder.label(ladder.level_of(self.perturbation))
        limit = known_metric(self.metric).format_limit(self.limit)
        return f"{ladder.word} margin >= {level} ({self.metric} {self.comparison} {limit})"


def parse_margin(sentence: str, known: Mapping[str, type[Perturbation]]) -> MarginRequirement | None:
    """The requirement of a sentence such as `latency margin >= 150 ms`, or None when it is no such sentence.

    Raises `RequirementError` for a failure that nobody knows and for the wrong unit, `PerturbationError` for a severity
    that the failure cannot have.
    """
    found = _MARGIN.fullmatch(sentence)
    if found is None:
        return None
    ladder = _ladder(found["words"], known)
    unit = found["unit"].lower()
    if unit != ladder.unit:
        given = f"has the unit {unit!r}" if unit else "has no unit"
        raise RequirementError(
            f"the severity {found['level']} {given}. Expected {ladder.unit or 'none'}: "
            f"'{ladder.word} margin >= {found['level']} {ladder.unit}'.".replace(" '.", "'.")
        )
    metric = found["metric"] or "RD"
    usual = ">=" if known_metric(metric).higher_is_better else "<="
    comparison = found["comparison"] or usual
    limit = float(found["limit"]) if found["limit"] else DEFAULT_LIMIT
    perturbation = ladder.at(float(found["level"]))
    return MarginRequirement.of(perturbation, metric, _COMPARISONS.get(comparison, comparison), limit)


def _ladder(words: str, known: Mapping[str, type[Perturbation]]) -> Ladder:
    by_word = {failure_word(cls).lower(): cls for cls in known.values()}
    cls = by_word.get(" ".join(words.lower().split()))
    if cls is None:
        close = nearest(words, by_word)
        hint = f" Did you mean {close!r}?" if close else ""
        raise RequirementError(
            f"there is no failure called {words!r}.{hint} Expected one of {', '.join(sorted(by_word))}."
        )
    try:
        return ladder_of(cls, dt_s=_TICK_S)
    except PerturbationError as error:
        raise RequirementError(str(error)) from None
