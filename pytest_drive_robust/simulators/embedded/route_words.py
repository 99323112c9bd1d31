"""What we understood of a route, in words: its road, its junction, what the file says about its scenario."""

from __future__ import annotations

import math

import numpy as np

from pytest_drive_robust.arithmetic import scalars
from pytest_drive_robust.domain.route import ScenarioSpec
from pytest_drive_robust.domain.truth import Lane, LaneKind, LaneMap
from pytest_drive_robust.simulators.embedded.dense_route import DenseRoute

__all__ = ["describe_parameters", "describe_road"]

_STRAIGHT_RAD = math.radians(35.0)


def describe_road(dense: DenseRoute) -> str:
    """Return `"1 + 1 lanes, parking, left turn at 24 m, lights"`: lanes of the route's way + lanes of the other."""
    lanes = dense.lane_map.lanes
    own = lanes[int(dense.lanes[int(np.searchsorted(dense.s, dense.trigger_m).clip(0, len(dense.s) - 1))])]
    if own.junction:
        own = lanes[int(dense.lanes[0])]
    words = [_lanes(dense.lane_map, own)]
    way = dense.first_passage()
    if way is not None:
        row = dense.first_junction_row()
        assert row is not None
        turn = "straight on" if abs(way.turn_rad) < _STRAIGHT_RAD else "right turn" if way.turn_rad > 0 else "left turn"
        words.append(f"{turn} at {dense.s[row]:.0f} m")
        stops = dense.junction_stops()
        if stops:
            words.append("lights" if dense.lane_map.stop_lines[stops[0]].is_light else "stop signs")
    for start, _, side in dense.lane_changes():
        words.append(f"{'right' if side > 0 else 'left'} lane at {dense.s[start]:.0f} m")
    return ", ".join(words)


def _lanes(lane_map: LaneMap, own: Lane) -> str:
    lanes = lane_map.lanes
    slice_ = [own]
    for side in ("left", "right"):
        lane, outward = own, side
        for _ in lanes:
            index, same_way = (
                (lane.left, lane.left_same_way) if outward == "left" else (lane.right, lane.right_same_way)
            )
            if index < 0:
                break
            lane = lanes[index]
            slice_.append(lane)
            if not same_way:  # seen from the other way, one goes on to the other side
                outward = "right" if outward == "left" else "left"
    driving = [lane for lane in slice_ if lane.kind is LaneKind.DRIVING]
    along = sum(scalars.cos(lane.centre[0, 2] - own.centre[0, 2]) > 0.0 for lane in driving)
    others = len(driving) - along
    words = f"{along} + {others} lanes" if others else f"{along} lane{'s' * (along > 1)}, one way"
    kinds = {lane.kind for lane in slice_}
    return words + ", parking" * (LaneKind.PARKING in kinds) + ", bicycles" * (LaneKind.BIKING in kinds)


def describe_parameters(spec: ScenarioSpec) -> str:
    """Return `"distance 40, flow_speed 9, source_dist_interval 15 to 25"`: what the file says, places left out."""
    words = [f"{name} {text}" for name, text in spec.texts.items()]
    for name, given in spec.parameters.items():
        if "value" in given:
            words.append(f"{name} {given['value']:g}")
        elif "from" in given and "to" in given:
            words.append(f"{name} {given['from']:g} to {given['to']:g}")
        elif "x" in given:
            words.append(name)
    return ", ".join(words)
