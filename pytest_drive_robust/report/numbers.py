"""Formats numbers for people, equally in every report."""

from __future__ import annotations

import math

_CONTROLS = {code: f"\\x{code:02x}" for code in (*range(32), 127) if chr(code) not in "\t\n"}

_SHARES = ("RD", "SR")
_SHORT_S = 15.0
_ROUNDING = 1e-9
"""The difference up to which two numbers count as equal, as in every verdict rule."""
_MOST_DECIMALS = 9


def shown(metric: str, value: float | None) -> str:
    """Return a value with two digits after the point, or `"-"` when there is no number."""
    if value is None or not math.isfinite(value):
        return "-"
    text = f"{value:.2f}"
    # "-0.00" reads like a loss where there is none.
    return "0.00" if text == "-0.00" and metric in _SHARES else text


def beside(value: float, *limits: float, decimals: int = 2, sign: str = "") -> str:
    """Return `value` with `decimals` digits or more, so that the text lies on the same side of each limit as `value`.

    >>> beside(0.3003, 0.30), beside(0.64, 0.30), beside(0.30, 0.30)
    ('0.3003', '0.64', '0.30')
    """
    text = f"{value:{sign}.{decimals}f}"
    if decimals >= _MOST_DECIMALS or all(_side(float(text), limit) == _side(value, limit) for limit in limits):
        return text
    return beside(value, *limits, decimals=decimals + 1, sign=sign)


def shown_beside(metric: str, value: float | None, *limits: float) -> str:
    """Return a value as `shown` does, with more decimals if needed to tell the value from the limits (see `beside`)."""
    text = "-" if value is None or not math.isfinite(value) else beside(value, *limits)
    return shown(metric, value) if text == "-0.00" else text


def _side(value: float, limit: float) -> int:
    """Return -1 below the limit, 1 above the limit, and 0 when both differ only by rounding."""
    if math.isclose(value, limit, rel_tol=_ROUNDING, abs_tol=_ROUNDING):
        return 0
    return 1 if value > limit else -1


def interval_text(metric: str, low: float, high: float, *limits: float, confidence: float = 0.95) -> str:
    """Return `"95 % interval 0.33 to 0.53"`; `"95 % interval unknown"` when too few routes make an end infinite."""
    return f"{in_percent(confidence)} % interval {ends_text(metric, low, high, *limits)}"


def ends_text(metric: str, low: float, high: float, *limits: float) -> str:
    """Return `"0.33 to 0.53"`; `"unknown"` when too few routes make an end infinite.

    An end has more decimals if needed to tell whether the interval contains one of the limits.

    >>> ends_text("RD", 0.3003, 0.3996), ends_text("RD", 0.3003, 0.3996, 0.30, 0.40)
    ('0.30 to 0.40', '0.3003 to 0.3996')
    """
    if not (math.isfinite(low) and math.isfinite(high)):
        return "unknown"
    return f"{lower_end(metric, low, *limits)} to {shown_beside(metric, high, *limits)}"


def lower_end(metric: str, low: float, *limits: float) -> str:
    """Return the lower end of an interval; `"< -1"` for an RD below -1, which few routes may leave open."""
    return "< -1" if metric == "RD" and low < -1.0 else shown_beside(metric, low, *limits)


def in_percent(share: float) -> str:
    """Return a share in percent with all of its digits, because 0.1 % is not "0%" and 99.98 % is not "100 %".

    >>> in_percent(0.05), in_percent(0.025), in_percent(0.001), in_percent(1.0 - 2.0 * 0.0001)
    ('5', '2.5', '0.1', '99.98')
    """
    return f"{100.0 * share:.10g}"


def counted(number: int, noun: str) -> str:
    """Return number and noun, as in `"1 route"` or `"2 routes"`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def duration_text(seconds: float) -> str:
    """Return a duration as text, such as `"0 s"`, `"12 s"`, `"90 s"`, `"2.5 min"`, `"30 min"`, `"1.5 h"`."""
    if seconds < 100:
        return f"{max(1, round(seconds)) if seconds > 0 else 0} s"
    if seconds < 570:
        return f"{round(seconds / 30) / 2:g} min"
    return f"{seconds / 60:.0f} min" if seconds < 3600 else f"{seconds / 3600:.1f} h"


def left_text(seconds: float) -> str:
    """Return `"about 2.5 min"`; `"less than 30 s"` below 15 s, where a single verdict changes the estimate too much."""
    return f"less than {2 * _SHORT_S:.0f} s" if seconds < _SHORT_S else f"about {duration_text(seconds)}"


def legible(text: str, *, controls: bool = False) -> str:
    """Return `text` in a form that every terminal, file and channel accepts.

    Lone surrogates, which names of routes and texts of agents may hold, are spelled out. Control characters except tab
    and line feed are also spelled out, unless `controls` keeps them.
    """
    plain = text.encode("utf-8", "backslashreplace").decode("utf-8")
    return plain if controls else plain.translate(_CONTROLS)
