"""Route XML as the leaderboard writes it, drawn by ourselves: dense waypoints, none in junctions, jumps to other lanes.

Nothing in here comes from the leaderboard's files.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pytest_drive_robust.domain.route import Route, ScenarioSpec, TriggerPoint, Waypoint
from pytest_drive_robust.simulators.embedded.traced.schema import SCHEMA, Place

Point = tuple[float, float]
Pose = tuple[float, float, float]
LEFT = ("NonSignalizedJunctionLeftTurn", "SignalizedJunctionLeftTurn", "CrossingBicycleFlow")


@dataclass(frozen=True)
class Shape:
    """How a route is drawn: metres before and without waypoints, degrees of the turn, the side of ramps."""

    before_m: float = 22.0
    gap_m: float = 24.0
    turn_deg: float = 90.0
    side: float = 1.0
    heading_deg: float = 0.0
    at: Point = (1234.5, -876.5)


def shape_for(kind: str, number: int = 0) -> Shape:
    """Return something that a type can use; other numbers give other headings, sizes and sides."""
    place, odd = SCHEMA[kind].roads.place, number % 2 == 1
    turn = -90.0 if any(kind.startswith(name) for name in LEFT) or (odd and "RightTurn" not in kind) else 90.0
    heading, at = 37.0 * number, (1234.5 + 511.0 * number, -876.5)
    if place is Place.STREET:
        return Shape(turn_deg=-40.0 if odd else 0.0, heading_deg=heading, at=at)
    if place is Place.JUNCTION:
        return Shape(gap_m=22.0 + 3.0 * (number % 3), turn_deg=turn, heading_deg=heading, at=at)
    side = -1.0 if odd else 1.0
    return Shape(gap_m=110.0 - 15.0 * number, turn_deg=18.0 * side, side=side, heading_deg=heading, at=at)


def draw(kind: str, shape: Shape | None = None, *, route_id: str = "1", **given: object) -> Route:
    """Draw a route of a type. `given` are parameter elements: a number, a word, or a mapping of attributes."""
    shape = shape or shape_for(kind)
    place = SCHEMA[kind].roads.place
    pose: Pose = (*shape.at, math.radians(shape.heading_deg))
    parameters: dict[str, dict[str, float]] = {}
    if kind == "SequentialLaneChange":
        points = _jumps(pose)
    elif place is Place.STREET:
        points = _bend(pose, math.radians(shape.turn_deg), 130.0)
    elif place is Place.CUT_IN:
        points = _straight(pose, shape.before_m) + _straight(_ahead(pose, shape.before_m + shape.gap_m), 28.0)
        parameters["other_actor_location"] = _location(_ahead(pose, 30.0, 12.5 * shape.side))
        parameters["end_location"] = _location(_ahead(pose, shape.before_m + shape.gap_m + 10.0))
    else:
        points, flow = _parting(pose, shape, place)
        if "start_actor_flow" in SCHEMA[kind].locations:
            parameters |= flow
    texts = {}
    for name, value in given.items():
        if isinstance(value, str):
            texts[name] = value
        else:
            parameters[name] = dict(value) if isinstance(value, dict) else {"value": float(value)}  # type: ignore[arg-type]
    x, y, heading = _ahead(pose, 8.0)
    trigger = TriggerPoint(round(x, 1), round(y, 1), 0.0, round(math.degrees(heading), 1))
    waypoints = tuple(Waypoint(round(float(x), 1), round(float(y), 1), 3.5) for x, y in points)
    return Route(route_id, "Town12", waypoints, ScenarioSpec(f"{kind}_1", kind, trigger, parameters, texts))


def _ahead(pose: Pose, metres: float, right: float = 0.0) -> Pose:
    x, y, heading = pose
    cos, sin = math.cos(heading), math.sin(heading)
    return x + metres * cos - right * sin, y + metres * sin + right * cos, heading


def _location(pose: Pose) -> dict[str, float]:
    return {"x": round(pose[0], 1), "y": round(pose[1], 1), "z": 3.5}


def _straight(pose: Pose, length: float) -> list[Point]:
    return [_ahead(pose, float(s))[:2] for s in np.arange(0.0, length + 0.1, 2.0)]


def _bend(pose: Pose, turn: float, length: float) -> list[Point]:
    points, at = [pose[:2]], pose
    for _ in range(int(length / 2.0)):
        at = _ahead((at[0], at[1], at[2] + turn * 2.0 / length), 2.0)
        points.append(at[:2])
    return points


def _jumps(pose: Pose) -> list[Point]:
    """Draw two changes to the left, each from one waypoint to the next."""
    first = _straight(pose, 34.0)
    second = _straight(_ahead(pose, 39.0, -3.5), 40.0)
    third = _straight(_ahead(pose, 84.0, -7.0), 36.0)
    return first + second + third


def _parting(pose: Pose, shape: Shape, place: Place) -> tuple[list[Point], dict[str, dict[str, float]]]:
    """Draw a stretch before, none where roads cross or part, one after; and from where to where the flow goes."""
    start, turn = _ahead(pose, shape.before_m), math.radians(shape.turn_deg)
    along, aside = shape.gap_m * math.cos(turn / 2.0), shape.gap_m * math.sin(turn / 2.0)
    x, y, _ = _ahead(start, along, aside)
    end: Pose = (x, y, pose[2] + turn)
    points = _straight(pose, shape.before_m) + _straight(end, 28.0)
    if place is Place.EXIT:
        flow = _ahead(start, -45.0, 3.5 * shape.side), _ahead(start, along + 12.0, 3.5 * shape.side)
    elif place is Place.ENTRY:
        flow = _ahead(end, -130.0, 1.0), _ahead(end, 12.0)
    else:  # from the other end of the road into which the route turns
        flow = _ahead(end, -2.0 * abs(aside) - 20.0), _ahead(end, 10.0)
    return points, {"start_actor_flow": _location(flow[0]), "end_actor_flow": _location(flow[1])}
