"""What the ego was doing in a tick: turning, crossing, changing lanes, following the road, or off it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.report.failures.road import Road

__all__ = ["manoeuvre"]

_TURN_RAD = np.radians(35.0)
_TURNED_RAD = np.radians(45.0)
_TURNED_S, _BESIDE_S, _EVERY_S = 3.0, 4.0, 0.2
_ROWS_BEHIND, _ROWS_AHEAD = 10, 15
_TURN_BEHIND = 18
_JUNCTION_BEHIND, _JUNCTION_AHEAD = 3, 8
_OTHER_LANE_M = 1.75
_OFF_ROAD_M = 1.5


def manoeuvre(result: EpisodeResult, tick: int, road: Road | None, *, leaving: bool = False) -> str:
    """Return the end of a sentence: `"while turning left"`. Without a road only the ego's own turn is known.

    `leaving`: it left its lane in this tick, so that being off the road is no news.
    """
    if not len(result.trace.rows):
        return ""
    at = int(np.clip(tick, 1, result.ticks)) - 1
    x, y, yaw, progress = result.trace.columns("x_m", "y_m", "yaw_rad", "progress_m")
    before = max(0, at - round(_TURNED_S / result.dt_s))
    turned = float(np.sum((np.diff(yaw[before : at + 1]) + np.pi) % (2.0 * np.pi) - np.pi))
    if road is None:
        return _turn(turned) if abs(turned) > _TURNED_RAD else "while following the road"
    place = np.array((x[at], y[at]))
    row = road.row_of(place, float(progress[at]))
    if not leaving and float(road.lanes_at(place[None])[0][0]) > _OFF_ROAD_M:
        return "off the road"
    bend = road.turn_rad(row, _ROWS_BEHIND, _ROWS_AHEAD)
    junction = road.in_junction(row, _TURN_BEHIND, _ROWS_AHEAD)
    if abs(bend) > _TURN_RAD or (junction and abs(turned) > _TURNED_RAD):
        return _turn(bend if abs(bend) > _TURN_RAD else turned)
    if road.in_junction(row, _JUNCTION_BEHIND, _JUNCTION_AHEAD):
        return "while crossing a junction"
    return "while changing lanes" if _was_in_other_lane(result, at, road) else "while following the road"


def _turn(radians: float) -> str:
    return "while turning right" if radians > 0.0 else "while turning left"


def _was_in_other_lane(result: EpisodeResult, at: int, road: Road) -> bool:
    """Return True when the ego was beside its own lane but within another, a moment ago or now."""
    x, y, progress = result.trace.columns("x_m", "y_m", "progress_m")
    ticks = range(max(0, at - round(_BESIDE_S / result.dt_s)), at + 1, max(1, round(_EVERY_S / result.dt_s)))
    places = np.array([(x[tick], y[tick]) for tick in (*ticks, at)])
    rows = [road.row_of(place, float(progress[tick])) for place, tick in zip(places, (*ticks, at), strict=True)]
    beside = [abs(road.beside_m(place, row)) > _OTHER_LANE_M for place, row in zip(places, rows, strict=True)]
    return bool((np.array(beside) & (road.lanes_at(places).beyond_m < 0.0)).any())
