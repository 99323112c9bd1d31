"""Finds what went wrong first in an episode, in which tick, and what the ego was doing then."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pytest_drive_robust.arithmetic.series import wrap_angle
from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind, Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.report.failures.road import Road
from pytest_drive_robust.verdict.explain import infraction_s

_WHAT = {
    InfractionKind.COLLISION_PEDESTRIAN: "Hit a pedestrian",
    InfractionKind.COLLISION_VEHICLE: "Hit a vehicle",
    InfractionKind.COLLISION_LAYOUT: "Hit an obstacle",
    InfractionKind.RED_LIGHT: "Ran a red light",
    InfractionKind.STOP_SIGN: "Ran a stop sign",
    InfractionKind.YIELD_EMERGENCY: "Did not yield to an emergency vehicle",
}
"""The words for infractions that happen in one tick. Other kinds are sums over the route, or ends."""
_STANDING_MPS = 0.3
"""An ego that is not faster stands."""
_STANDING_S = 10.0
"""An ego that stands for longer at the end of its episode stood still to the end."""
_WRONG_WAY_RAD = np.radians(120.0)
"""An ego turned farther from its lane's direction drives against the traffic."""
_EVERY_S = 0.2
"""Time between two places that are looked up on the map."""
_GAP_M = 11.0
"""Largest gap to an actor ahead behind which the ego stands."""
_EGO_LENGTH_M, _EGO_WIDTH_M = 4.9, 1.85
"""Size of the ego, CARLA's Lincoln MKZ."""
_ROOM_M = 0.7
"""The least room beside the ego; an actor with less room blocks the way."""

_TURN_RAD = np.radians(35.0)
"""A road that bends farther turns."""
_TURNED_RAD = np.radians(45.0)
"""An ego that has turned farther within `_TURNED_S` turns, whatever the road does."""
_TURNED_S, _BESIDE_S = 3.0, 4.0
"""How far back a turn and a change of lanes are looked for."""
_ROWS_BEHIND, _ROWS_AHEAD = 10, 15
"""Rows of the route, a metre apart, within which it is looked at for a bend."""
_TURN_BEHIND = 18
"""Rows for which a turn lasts behind its junction."""
_JUNCTION_BEHIND, _JUNCTION_AHEAD = 3, 8
"""Rows behind and ahead within which a junction is being crossed."""
_OTHER_LANE_M = 1.75
"""An ego farther beside its lane's middle is in another lane, if there is one."""
_OFF_ROAD_M = 1.5
"""An ego farther outside all lanes is off the road."""


class Moment(NamedTuple):
    """What went wrong, as the beginning of a sentence, and in which tick.

    `moves` says that the tick is known and the ego was moving, so that a manoeuvre can be named. `leaving` says that
    the ego left its lane or route.
    """

    what: str
    tick: int
    moves: bool = True
    leaving: bool = False


def first_failure(result: EpisodeResult, road: Road | None) -> Moment:
    """Return what went wrong first in an episode without success.

    Driving outside the lanes is a sum that is known only at the end, so it counts only when no infraction with a tick
    (a collision, a red light) happened. Standing still comes after that, because it is mostly a consequence.
    """
    if result.outcome is Outcome.AGENT_ERROR:
        return Moment("The agent broke", result.ticks, moves=False)
    if result.outcome is Outcome.INFRA_ERROR:
        return Moment("The simulation broke", result.ticks, moves=False)
    timed = [item for item in result.infractions if item.kind in _WHAT]
    if timed:
        first = min(timed, key=lambda item: item.tick)
        return Moment(_words(first), first.tick, moves=infraction_s(first, result.dt_s) is not None)
    kinds = {item.kind for item in result.infractions}
    if result.end is End.DEVIATED:
        return Moment("Left its route", _left_at(result, road), leaving=True)
    if InfractionKind.OUTSIDE_LANES in kinds:
        return Moment("Left its lane", _left_at(result, road), leaving=True)
    stood = _stood_from(result)
    if stood is not None:
        return Moment(f"Stood still {_before(result, stood)}", stood, moves=False)
    if InfractionKind.SCENARIO_TIMEOUT in kinds or result.end is not End.COMPLETED:
        return Moment("Ran out of time", result.ticks, moves=False)
    return Moment("Did not succeed", result.ticks, moves=False)


def _words(item: Infraction) -> str:
    bicycle = item.kind is InfractionKind.COLLISION_VEHICLE and "bicycle" in item.detail
    return "Hit a cyclist" if bicycle else _WHAT[item.kind]


def _left_at(result: EpisodeResult, road: Road | None) -> int:
    """Return the first tick outside all lanes; else the middle of the first stretch against the traffic.

    If there is neither, return the tick farthest from its lane; without a road or a trace, the last tick.
    """
    x, y, yaw = result.trace.columns("x_m", "y_m", "yaw_rad")
    every = max(1, round(_EVERY_S / result.dt_s))
    places = np.column_stack((x, y))[::every]
    if road is None or not len(places):
        return result.ticks
    seen = road.lanes_at(places)
    if bool(seen.outside.any()):
        return int(np.argmax(seen.outside)) * every
    turned = wrap_angle(yaw[::every] - seen.heading_rad)
    wrong = (np.abs(turned) > _WRONG_WAY_RAD) & ~seen.junction
    if not bool(wrong.any()):
        return int(np.argmax(seen.beyond_m)) * every
    first = int(np.argmax(wrong))
    length = int(np.argmin(wrong[first:])) or len(wrong) - first
    return (first + length // 2) * every


def _stood_from(result: EpisodeResult) -> int | None:
    """Return the tick from which the ego stood still until the end, or None when it did not stand for long."""
    (speed,) = result.trace.columns("speed_mps")
    if not len(speed):  # without a stored trace, only the end of the episode tells
        return result.ticks if result.end in (End.BLOCKED, End.STUCK) else None
    moved = np.flatnonzero(speed > _STANDING_MPS)
    last = int(moved[-1]) if len(moved) else 0
    if result.end is End.TICK_CAP and float(np.mean(speed < _STANDING_MPS)) > 0.5:
        return min(last + 1, result.ticks)  # the ego stood most of the time, but crept on now and then
    return last + 1 if (result.ticks - last) * result.dt_s > _STANDING_S else None


def _before(result: EpisodeResult, tick: int) -> str:
    """Return the words for the actor that the ego stood behind in `tick`, from the tracks."""
    tracks = result.tracks
    if tracks is None or not len(result.trace.rows):
        return "to the end"
    x, y, yaw = (float(column[min(tick, result.ticks - 1)]) for column in result.trace.columns("x_m", "y_m", "yaw_rad"))
    sample, nearest = tick // tracks.every_ticks, (_GAP_M, "with a free way ahead")
    start = 0
    for _, kind, length, width, first, count in tracks.actors.tolist():
        within = min(sample - first, count - 1)
        if 0 <= sample - first <= count:
            east, south = tracks.motion[start + within, :2] / 100.0 - (x, y)
            ahead, right = np.cos(yaw) * east + np.sin(yaw) * south, -np.sin(yaw) * east + np.cos(yaw) * south
            gap = float(ahead) - (length / 100.0 + _EGO_LENGTH_M) / 2.0
            beside = abs(float(right)) - (width / 100.0 + _EGO_WIDTH_M) / 2.0
            if -2.0 < gap < nearest[0] and beside < _ROOM_M and kind != ActorKind.DIRT:
                user = kind <= ActorKind.PEDESTRIAN
                nearest = gap, "behind another road user" if user else "behind an obstacle"
        start += count
    return nearest[1]


def manoeuvre(result: EpisodeResult, tick: int, road: Road | None, *, leaving: bool) -> str:
    """Return the end of a sentence such as `"while turning left"`. Without a road only the ego's own turn is known.

    `leaving` says that the ego left its lane in this tick, so that "off the road" is not repeated.
    """
    if not len(result.trace.rows):
        return ""
    at = int(np.clip(tick, 1, result.ticks)) - 1
    x, y, yaw, progress = result.trace.columns("x_m", "y_m", "yaw_rad", "progress_m")
    before = max(0, at - round(_TURNED_S / result.dt_s))
    turned = float(np.sum(wrap_angle(np.diff(yaw[before : at + 1]))))
    if road is None:
        return _turn(turned) if abs(turned) > _TURNED_RAD else "while following the road"
    place = np.array((x[at], y[at]))
    row = road.row_of(place, float(progress[at]))
    if not leaving and float(road.lanes_at(place[None])[0][0]) > _OFF_ROAD_M:
        return "off the road"
    bend = road.turn_rad(row, _ROWS_BEHIND, _ROWS_AHEAD)
    junction = road.in_junction(row, _TURN_BEHIND, _ROWS_AHEAD)
    if junction and (abs(bend) > _TURN_RAD or abs(turned) > _TURNED_RAD):  # outside a junction, the road bends
        return _turn(bend if abs(bend) > _TURN_RAD else turned)
    if road.in_junction(row, _JUNCTION_BEHIND, _JUNCTION_AHEAD):
        return "while crossing a junction"
    return "while changing lanes" if _was_in_other_lane(result, at, road) else "while following the road"


def _turn(radians: float) -> str:
    return "while turning right" if radians > 0.0 else "while turning left"


def _was_in_other_lane(result: EpisodeResult, at: int, road: Road) -> bool:
    """Return True when the ego was beside its own lane but within another lane, up to `_BESIDE_S` before tick `at`."""
    x, y, progress = result.trace.columns("x_m", "y_m", "progress_m")
    ticks = range(max(0, at - round(_BESIDE_S / result.dt_s)), at + 1, max(1, round(_EVERY_S / result.dt_s)))
    places = np.array([(x[tick], y[tick]) for tick in (*ticks, at)])
    rows = [road.row_of(place, float(progress[tick])) for place, tick in zip(places, (*ticks, at), strict=True)]
    beside = [abs(road.beside_m(place, row)) > _OTHER_LANE_M for place, row in zip(places, rows, strict=True)]
    return bool((np.array(beside) & (road.lanes_at(places).beyond_m < 0.0)).any())
