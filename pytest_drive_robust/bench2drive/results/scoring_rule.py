"""Does a record's score follow from its infractions by the rule that we know?"""

from __future__ import annotations

from collections.abc import Mapping
from math import prod

from pytest_drive_robust.bench2drive.results.messages import outside_lanes_pct
from pytest_drive_robust.bench2drive.results.official_record import OfficialRecord
from pytest_drive_robust.domain.outcome import InfractionKind
from pytest_drive_robust.metrics.score import PENALTIES

__all__ = ["follows_from_infractions", "lane_shares_pct"]

_LANES = InfractionKind.OUTSIDE_LANES.value
_SHARE_TOLERANCE_PCT = 0.0051
"""The sentences give the share with two digits."""
_SCORE_TOLERANCE = 2e-6


def follows_from_infractions(record: OfficialRecord) -> bool:
    """Return True when route completion times the penalties of the lists is the score, as far as rounding can tell."""
    return lane_shares_pct(record) is not None


def lane_shares_pct(record: OfficialRecord) -> tuple[float, ...] | None:
    """Return the share of each sentence about lanes: as it says, but of the last one what makes the score come out.

    None when the score does not follow from the infractions.
    """
    told = [outside_lanes_pct(message) for message in record.infractions[_LANES]]
    if None in told:
        return None
    shares = [share for share in told if share is not None]
    rest = record.route_pct * _fixed_penalty(record.infractions)
    for share in shares[:-1]:
        rest *= 1.0 - share / 100.0
    if not shares or rest <= 0.0:
        expected = rest * (1.0 - shares[-1] / 100.0) if shares else rest
        return tuple(shares) if abs(record.score - expected) <= _SCORE_TOLERANCE else None
    last = 100.0 * (1.0 - record.score / rest)
    # A small score tells the share only roughly: its sixth digit is what it was rounded to.
    tolerance = _SHARE_TOLERANCE_PCT * max(len(shares), 1) + 100.0 * _SCORE_TOLERANCE / rest
    if abs(last - shares[-1]) > tolerance:
        return None
    return (*shares[:-1], min(max(last, 0.0), 100.0))


def _fixed_penalty(infractions: Mapping[str, tuple[str, ...]]) -> float:
    return prod(factor ** len(infractions[kind.value]) for kind, factor in PENALTIES.items())
