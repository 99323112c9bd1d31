"""A junction: lanes that connect the arms, crosswalks, lights or stop signs at the entries."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pytest_drive_robust.arithmetic import scalars
from pytest_drive_robust.domain.truth import LaneKind
from pytest_drive_robust.simulators.embedded.geometry import moved
from pytest_drive_robust.simulators.embedded.towns.pieces import PLAIN, piece, road
from pytest_drive_robust.simulators.embedded.towns.town import Arm, JunctionControl, Town

_RIGHT_ANGLE = math.pi / 2.0
_OFF_KERB_M = 0.6


@dataclass(frozen=True, slots=True)
class Connection:
    """A way through a junction: from lane `lane` of an arm, turning `"left"`, `"straight"` or `"right"`."""

    source: Arm
    turn: str
    lane: int
    target: Arm
    key: int


def draw_arms(town: Town, arms: list[Arm], *, length_m: float, crosswalks: bool = True) -> None:
    """Draw the roads that lead away from a junction."""
    for arm in arms:
        road(town, arm.name, arm.edge(), [(length_m, 0.0)], arm.section)
        if crosswalks:
            crosswalk(town, arm)


def crosswalk(town: Town, arm: Arm) -> None:
    """Draw a crossing for pedestrians where the arm meets the box."""
    half_m = arm.section.forward * arm.section.width_m + arm.section.biking_m
    x, y, heading = arm.edge()
    ahead = np.array([scalars.cos(heading), scalars.sin(heading)])
    right = np.array([-ahead[1], ahead[0]])
    edge = np.array([x, y])
    near, far = edge + 0.6 * ahead, edge + 3.6 * ahead
    town.crosswalks.append(
        np.array([near - half_m * right, far - half_m * right, far + half_m * right, near + half_m * right])
    )


def turn_between(source: Arm, target: Arm) -> str:
    """Return the turn from one arm into another, `"left"`, `"straight"` or `"right"`; arms stand at right angles."""
    turned = math.remainder(target.heading_rad - source.heading_rad - math.pi, math.tau)
    if abs(turned) < 0.1:
        return "straight"
    return "right" if turned > 0.0 else "left"


def connect(town: Town, arms: list[Arm], *, controls: dict[str, str]) -> list[Connection]:
    """Connect the arms of one junction. `controls` maps the names of arms to `"light"` or `"stop"`.

    The innermost lane turns left, the outermost right, all go straight; biking lanes go straight over. All arms have
    the same number of lanes and the same box.
    """
    junction = town.new_junction()
    made: list[Connection] = []
    for source in arms:
        lanes = source.section.forward
        for lane in range(lanes):
            for target in arms:
                turns_from = {"left": 0, "straight": lane, "right": lanes - 1}
                if target is not source and turns_from.get(turn_between(source, target)) == lane:
                    made.append(_connection(town, source, target, lane, junction=junction))
            if source.name in controls:
                key = town.chains[source.inward(str(lane))][-1]
                town.controls.append(control_of(source, key, controls[source.name]))
    for source in arms:
        for target in arms:
            if source.section.biking_m and target is not source and turn_between(source, target) == "straight":
                _bike_connection(town, source, target, junction=junction)
    return made


def chains_through(town: Town, connections: list[Connection]) -> None:
    """Name the chains of a single junction: `<arm>.left0`, ... from the end of one arm to the end of another."""
    for made in connections:
        town.chains[f"{made.source.name}.{made.turn}{made.lane}"] = [
            *town.chains[made.source.inward(str(made.lane))],
            made.key,
            *town.chains[made.target.outward(str(made.lane))],
        ]


def control_of(arm: Arm, lane: int, what: str) -> JunctionControl:
    """Return a light in the far corner, halfway round the kerb along which cars turn right, or a stop sign."""
    edge = arm.section.forward * arm.section.width_m + arm.section.biking_m
    aside = (1.0 - math.sqrt(0.5)) * (arm.box_m - edge) + _OFF_KERB_M
    return JunctionControl(lane, what, arm.box_m + edge + aside, aside)


def _connection(town: Town, source: Arm, target: Arm, lane: int, *, junction: int) -> Connection:
    section, turn = source.section, turn_between(source, target)
    offset = (lane + 0.5) * section.width_m
    speed = min(section.speed_mps, target.section.speed_mps) if turn != "straight" else section.speed_mps
    drawn = piece(
        _entry(source, offset), *_arc(turn, source.box_m, offset),
        width_m=section.width_m, lines=PLAIN, speed_mps=speed, junction=junction,
    )  # fmt: skip
    return Connection(source, turn, lane, target, town.add(drawn))


def _bike_connection(town: Town, source: Arm, target: Arm, *, junction: int) -> None:
    section = source.section
    offset = section.forward * section.width_m + section.biking_m / 2.0
    drawn = piece(
        _entry(source, offset), 2.0 * source.box_m, 0.0,
        width_m=section.biking_m, lines=PLAIN, speed_mps=section.speed_mps, kind=LaneKind.BIKING, junction=junction,
    )  # fmt: skip
    before, after = town.chains[source.inward("bike")], town.chains[target.outward("bike")]
    town.chains[f"{source.name}.bike"] = [*before, town.add(drawn), *after]


def _entry(arm: Arm, offset: float) -> tuple[float, float, float]:
    x, y, heading = arm.edge()
    return moved((x, y, heading + math.pi), 0.0, offset)


def _arc(turn: str, box_m: float, offset: float) -> tuple[float, float]:
    if turn == "straight":
        return 2.0 * box_m, 0.0
    radius = box_m + offset if turn == "left" else box_m - offset
    return radius * _RIGHT_ANGLE, (-1.0 if turn == "left" else 1.0) / radius
