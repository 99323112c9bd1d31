"""The numbers inside the sentences of a record, and the sentences that official tools read numbers from."""

from __future__ import annotations

import math
import re
from decimal import Decimal

from pytest_drive_robust.bench2drive.results.official_record import SPEED_LIST, OfficialRecord
from pytest_drive_robust.bench2drive.results.safe_json import shown
from pytest_drive_robust.errors import UsageError

# The same language as the official `\b\d+\.?\d*%`, which takes quadratic time on long rows of digits.
_OFFICIAL = re.compile(r"\b\d+(?:\.\d*)?%")
_NUMBER = r"(?<![\w.+-])([-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)"
_SPEED = re.compile(_NUMBER + "%")
_LANES = re.compile(r"\(" + r"(\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)" + r"% of the completed route\)")
LARGEST_PCT = 1e18
"""Traffic that creeps at a micrometre per hour; sums of such numbers are still numbers."""
_PLACE = re.compile(r"\(x=(-?\d+(?:\.\d+)?), y=(-?\d+(?:\.\d+)?)(?:, z=-?\d+(?:\.\d+)?)?\)")


def official_speed_pct(message: str) -> float | None:
    """Return what the official tool reads: `2e+16%` is 16 there, `-5%` is 5. None where it stops with an error."""
    found = _OFFICIAL.search(message)
    return None if found is None else float(found.group().rstrip("%"))


def speed_pct(message: str) -> float | None:
    """Return the ego's speed in percent of the traffic's, or None where the sentence tells none that a car can have."""
    found = _SPEED.search(message)
    value = math.nan if found is None else float(found.group(1))
    return value if 0.0 <= value <= LARGEST_PCT else None


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


def outside_lanes_pct(message: str) -> float | None:
    """Return the share of the driven route outside its lanes, 0..100, or None where the sentence does not tell."""
    found = _LANES.search(message)
    value = math.nan if found is None else float(found.group(1))
    return value if 0.0 <= value <= 100.0 else None


def place_of(message: str) -> tuple[float, float]:
    """Return where it happened in metres; zeros where the sentence does not tell."""
    found = _PLACE.search(message)
    x_m, y_m = (0.0, 0.0) if found is None else (float(found.group(1)), float(found.group(2)))
    return (x_m, y_m) if math.isfinite(x_m) and math.isfinite(y_m) else (0.0, 0.0)


def speed_message(pct: float) -> str:
    """Return the official sentence, exact and never with an exponent."""
    return f"Average speed is {_plain(pct)}% of the surrounding traffic's one"


def lanes_message(share_pct: float, driven_m: float) -> str:
    """Return the official sentence; its ninth word is a number too, which the global record is made of."""
    metres = round(share_pct / 100.0 * driven_m, 3)
    return (
        f"Agent went outside its route lanes for about {_plain(metres)} meters "
        f"({_plain(share_pct)}% of the completed route)"
    )


def _plain(value: float) -> str:
    """Return the shortest exact digits without an exponent."""
    return f"{Decimal(repr(float(value))):f}"
