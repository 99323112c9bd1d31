"""Driving efficiency of one record: the ego's speed in percent of the traffic's, out of the record's sentences."""

from __future__ import annotations

from pytest_drive_robust.bench2drive.results.messages import official_speed_pct, speed_pct
from pytest_drive_robust.bench2drive.results.official_record import SPEED_LIST, OfficialRecord
from pytest_drive_robust.bench2drive.results.safe_json import shown
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.metrics.averages import mean
from pytest_drive_robust.metrics.efficiency import LARGEST_RATIO_PCT

__all__ = ["official_efficiency", "official_ratios_pct", "ratios_pct", "true_efficiency"]


def official_efficiency(record: OfficialRecord) -> float | None:
    """Return the mean of what is at most 1000 %, None where nothing is: the official tool leaves out or stops there."""
    kept = [ratio for ratio in official_ratios_pct(record) if ratio <= LARGEST_RATIO_PCT]
    return mean(kept) if kept else None


def true_efficiency(record: OfficialRecord) -> float:
    """Return the mean of all, 0 for a car that never reached a checkpoint."""
    ratios = ratios_pct(record)
    return mean(ratios) if ratios else 0.0


def official_ratios_pct(record: OfficialRecord) -> list[float]:
    """Read the ratios as the official tool does. Raises `UsageError` where it stops with an error."""
    return [_required(official_speed_pct(message), message, record) for message in record.infractions[SPEED_LIST]]


def ratios_pct(record: OfficialRecord) -> list[float]:
    """Read the ratios as they are meant. Raises `UsageError` for a sentence without a number."""
    return [_required(speed_pct(message), message, record) for message in record.infractions[SPEED_LIST]]


def _required(ratio: float | None, message: str, record: OfficialRecord) -> float:
    if ratio is None:
        raise UsageError(
            f"{record.where}: {SPEED_LIST} holds {shown(message)}, expected a sentence like "
            '"Average speed is 62.41% of the surrounding traffic\'s one".'
        )
    return ratio
