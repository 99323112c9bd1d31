"""Action dreaming: the drive of somebody who obeys another instruction, computed kinematically from one real moment.

One picture gives many samples (instruction, path, speeds), which differ only by the instruction, so the network has to
read the instruction. Actors do not react to the dream, which is a replay (SimLingo, section on action dreaming;
`dataset_generation/dreamer_data`, re-written from its idea). Ego frame: x forward, y right, metres.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from drive_robust_agents._nets.prompts import PHRASES, THINGS, Instruction, Kind
from drive_robust_agents.training.data.reasons import hindrances
from pytest_drive_robust.jit.arrays import Floats

__all__ = [
    "PATH_POINTS", "STEP_S", "WAYPOINTS", "Dream", "DreamStart", "applicable", "draw_instruction", "dream", "is_safe",
]  # fmt: skip

PATH_POINTS, WAYPOINTS, STEP_S = 20, 10, 0.25
_TIMES_S = STEP_S * np.arange(WAYPOINTS + 1)
GAIN_MPS2, GAIN_MPS, REACH_MPS2 = 2.0, 4.0, 2.5
BRAKE_MPS2, STOPPED_S = 4.0, 2.2
SLOWER_SHARE, SLOWER_S = 0.5, 1.5
MOST_MPS = 20.0
_OFF_M, _OFF_WITHIN_M = 6.0, 16.0
_SETTLE_M = 4.0
_ROOM_M = 15.0
_MOVES_MPS, _NEAR_M = 2.0, 35.0
_MOST_TOLD_MPS = 15.0
_LANES: Mapping[Kind, str] = {Kind.LEFT: "lane_left", Kind.RIGHT: "lane_right"}
_USUAL = frozenset({Kind.FASTER, Kind.SLOWER, Kind.STOP, Kind.LEFT, Kind.RIGHT})


@dataclass(frozen=True, slots=True)
class DreamStart:
    """The start of a dream: the expert's line, its speed now, its speeds from now on, and the facts by name.

    The line is (n >= 20, 2), one point a metre; the speeds are (n >= 10) at every 0.25 s.
    """

    line: Floats
    speed_mps: float
    speeds: Floats
    facts: Mapping[str, float]


class Dream(NamedTuple):
    """A dreamt drive: `path` (20, 2), one point a metre; `waypoints` (10, 2), every 0.25 s."""

    path: Floats
    waypoints: Floats


def applicable(moment: DreamStart, *, safety: bool) -> list[Kind]:
    """Return the kinds of instructions that make a difference here; without `safety` only changes to existing lanes."""
    facts, kinds = moment.facts, [Kind.FASTER, Kind.SPEED, Kind.OFF_LEFT, Kind.OFF_RIGHT]
    mean_mps = float(np.mean(moment.speeds[:WAYPOINTS]))
    kinds += [Kind.SLOWER] if mean_mps > _MOVES_MPS else []
    kinds += [Kind.STOP] if max(mean_mps, moment.speed_mps) > _MOVES_MPS else []
    if facts["junction_m"] > _ROOM_M:
        kinds += [kind for kind, lane in _LANES.items() if safety or facts[lane] > 0.5]
    if _things_ahead(facts):
        kinds.append(Kind.CRASH)
    return kinds


def draw_instruction(moment: DreamStart, rng: np.random.Generator, *, safety: bool) -> Instruction:
    """Draw an applicable instruction in any wording; the instructions that people give most are twice as likely."""
    kinds = applicable(moment, safety=safety)
    weights = np.array([2.0 if kind in _USUAL else 1.0 for kind in kinds])
    kind = kinds[int(rng.choice(len(kinds), p=weights / weights.sum()))]
    things = _things_ahead(moment.facts)
    return Instruction(
        kind,
        mps=round(float(rng.uniform(0.0, _MOST_TOLD_MPS)), 1) if kind is Kind.SPEED else None,
        thing=things[int(rng.integers(len(things)))] if kind is Kind.CRASH else None,
        phrase=int(rng.integers(len(PHRASES[kind]))),
    )


def dream(told: Instruction, moment: DreamStart) -> Dream:
    """Return the drive that obeys an instruction."""
    line, aside = _rolled_in(moment.line), _aside(told.kind, moment)
    return Dream(
        _along(_shifted(moment.line, aside), np.arange(1.0, PATH_POINTS + 1.0), first=False),
        _driven(_shifted(line, aside), _speeds(told, moment)),
    )


def is_safe(told: Instruction, moment: DreamStart) -> bool:
    """Return whether obeying is safe: lane changes only into lanes, more speed only on a free way, no crash."""
    if told.kind in (Kind.SLOWER, Kind.STOP):
        return True
    if told.kind in _LANES:
        return moment.facts[_LANES[told.kind]] > 0.5
    if told.kind not in (Kind.FASTER, Kind.SPEED):
        return False
    speeds = _speeds(told, moment)
    if float(speeds.max()) > max(moment.facts["limit_mps"] + 3.0, moment.speed_mps + 0.1):
        return False
    driven = float(STEP_S * speeds.sum())
    hinder = hindrances(moment.facts, float(speeds[-1]))
    slower = float(speeds[-1]) < moment.speed_mps and float(speeds[-1]) <= float(moment.speeds[WAYPOINTS - 1]) + 0.5
    return slower or not hinder or hinder[0][0] > driven + float(speeds[-1])


# --- speeds ---


def _speeds(told: Instruction, moment: DreamStart) -> Floats:
    """Return (11,) m/s at 0, 0.25 ... 2.5 s."""
    now, told_mps = moment.speed_mps, told.mps
    wanted: Floats = np.concatenate([[now], moment.speeds[:WAYPOINTS]])
    if told.kind in (Kind.FASTER, Kind.CRASH):
        gain = np.minimum(GAIN_MPS2 * _TIMES_S, GAIN_MPS)
        wanted = np.minimum(np.maximum(wanted, now) + gain, max(MOST_MPS, now))
    elif told.kind is Kind.SLOWER:
        wanted = np.minimum(wanted, now) * (1.0 - SLOWER_SHARE * np.minimum(_TIMES_S / SLOWER_S, 1.0))
    elif told.kind is Kind.STOP:
        wanted = np.minimum(wanted, np.maximum(now - max(BRAKE_MPS2, now / STOPPED_S) * _TIMES_S, 0.0))
    elif told.kind is Kind.SPEED and told_mps is not None:
        least, most = np.maximum(now - BRAKE_MPS2 * _TIMES_S, 0.0), now + REACH_MPS2 * _TIMES_S
        wanted = np.minimum(np.maximum(told_mps, least), most)
    return wanted


# --- ways ---


def _aside(kind: Kind, moment: DreamStart) -> Floats:
    """Return (n,) metres to the right of each point of the line."""
    metres = np.arange(1.0, len(moment.line) + 1.0)
    if kind in (Kind.OFF_LEFT, Kind.OFF_RIGHT):
        side = -1.0 if kind is Kind.OFF_LEFT else 1.0
        return side * _OFF_M * _smooth((metres - 1.0) / _OFF_WITHIN_M)
    if kind in _LANES:
        within = float(np.clip(2.5 * moment.speed_mps, 9.0, 16.0))
        side = -1.0 if kind is Kind.LEFT else 1.0
        return side * moment.facts["lane_width_m"] * _smooth((metres - 1.0) / within)
    return np.zeros(len(metres))


def _smooth(share: Floats) -> Floats:
    inside: Floats = np.clip(share, 0.0, 1.0)
    return inside * inside * (3.0 - 2.0 * inside)


def _shifted(line: Floats, aside: Floats) -> Floats:
    along = np.gradient(line, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-6)
    shifted: Floats = line + aside[:, None] * np.column_stack([-along[:, 1], along[:, 0]])
    return shifted


def _rolled_in(line: Floats) -> Floats:
    """Return the way of a vehicle that begins at the origin and settles onto the line."""
    off = line[1] - 2.0 * line[0]
    fading = np.exp(-np.arange(1.0, len(line) + 1.0) / _SETTLE_M)
    rolled: Floats = line + fading[:, None] * off
    return rolled


def _driven(line: Floats, speeds: Floats) -> Floats:
    """Return the places (10, 2) every 0.25 s of a vehicle with these speeds on the line."""
    metres = np.cumsum(0.5 * STEP_S * (speeds[1:] + speeds[:-1]))
    return _along(line, metres, first=True)


def _along(line: Floats, metres: Floats, *, first: bool) -> Floats:
    """Return points `metres` along a line with a straight end, from the origin or from a metre before its start."""
    start = np.zeros(2) if first else 2.0 * line[0] - line[1]
    end = line[-1] + 100.0 * (line[-1] - line[-2])
    points = np.concatenate([start[None], line, end[None]])
    at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return np.column_stack([np.interp(metres, at, points[:, 0]), np.interp(metres, at, points[:, 1])])


def _things_ahead(facts: Mapping[str, float]) -> list[str]:
    """Return the `THINGS` to crash into here; bicycles and pedestrians are one fact, so both may be named."""
    near = {"vehicle": facts["lead_m"], "obstacle": facts["obstacle_m"]}
    near |= {"pedestrian": facts["walker_m"], "bicycle": facts["walker_m"]}
    return [thing for thing in THINGS if near[thing] < _NEAR_M]
