"""The date and the time, in one place that tests can replace; call as `clock.today()` and `clock.now()`."""

from __future__ import annotations

from datetime import date, datetime, timezone


def today() -> date:
    """Return the local date: a waiver ends at the owner's midnight."""
    return date.today()


def now() -> datetime:
    """Return the time in UTC, to the second."""
    return datetime.now(timezone.utc).replace(microsecond=0)
