"""Words an infraction for people: with the speed in km/h, as beside it on pages and films; records have m/s."""

from __future__ import annotations

import re

_SPEED = re.compile(r"(\d+(?:\.\d+)?) m/s(?![\w²³^])")
_EMERGENCY = "hit emergency at "
"""Simulators write the kind of an actor, and an emergency vehicle is of the kind `EMERGENCY`."""


def infraction_words(detail: str) -> str:
    """Return the `detail` of an infraction as people read it; official sentences have no speed and stay as they are.

    >>> infraction_words("hit emergency at 9.3 m/s"), infraction_words("hit van at 0.1 m/s")
    ('hit emergency vehicle at 33 km/h', 'hit van at 0.4 km/h')
    """
    if detail.startswith(_EMERGENCY):
        detail = f"hit emergency vehicle at {detail.removeprefix(_EMERGENCY)}"
    return _SPEED.sub(lambda found: _kmh(float(found[1])), detail)


def hit_words(detail: str) -> str:
    """Return what a collision hit, short enough for a second behind it; empty for any other `detail`.

    >>> hit_words("hit van at 9.3 m/s"), hit_words("Agent collided against object")
    ('hit van (33 km/h)', '')
    """
    what, at, speed = infraction_words(detail).rpartition(" at ")
    return f"{what} ({speed})" if at and what.startswith("hit ") else ""


def _kmh(speed_mps: float) -> str:
    speed_kmh = 3.6 * speed_mps
    return f"{speed_kmh:.1f} km/h" if speed_kmh < 1.0 else f"{speed_kmh:.0f} km/h"
