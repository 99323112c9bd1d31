"""The date and the time, in one place that tests can replace; call as `clock.today()` and `clock.now()`."""

from __future__ import annotations

from datetime import date, datetime, timezone


def today() -> date:
    """Return the local date: a waiver ends at the owner's midnight."""
    return date.today()


def now() -> datetime:
    """Return the time in UTC, to the second."""
    return datetime.now(timezone.utc).replace(microsecond=0)


def minute_text(stored: str) -> str:
    """Return a stored time to the minute in UTC; a date, or text that is no time, stays as it is.

    >>> minute_text("2026-11-30T01:03:50+01:00"), minute_text("2026-11-30")
    ('2026-11-30 00:03 UTC', '2026-11-30')
    """
    try:
        time = datetime.fromisoformat(stored) if "T" in stored else None
    except ValueError:
        time = None
    return stored if time is None else f"{time.astimezone(timezone.utc):%Y-%m-%d %H:%M} UTC"
