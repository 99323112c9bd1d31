"""Choose the speed: the strongest acceleration without trouble; check whether a manoeuvre can be driven."""

from __future__ import annotations

import math

import numpy as np

from drive_robust_agents._planning.forecast import rollouts
from drive_robust_agents._planning.projection import leaders
from drive_robust_agents._planning.situation import Situation
from drive_robust_agents._planning.tracks import STEP_S
from pytest_drive_robust.jit.arrays import Floats, Ints

__all__ = ["SpeedChoice", "is_free"]

_START_MARGINS = np.array([1.2, 0.7, 0.5])

_ACCELERATIONS = np.array([4.5, 2.3, 1.2, 0.6, 0.0, -0.8, -1.6, -2.6, -4.0, -6.0, -8.0])
_COMFORT_ACCEL_MPS2 = 2.3
_HURRY_ACCEL_MPS2 = 4.0
_FALL_BACK_MPS2 = -1.2
"""Deceleration of an ego that is too near to a leader, while the leader does not brake."""
_FALL_BACK, _STEADY = np.array([[_FALL_BACK_MPS2, 2.5, 0.0]]), np.array([[0.0, 99.0, 0.0]])
_COMFORT_BRAKE_MPS2 = -3.2
_REACT_S = 0.4
_THEN_STOP = np.array([(a, _REACT_S, min(a, _COMFORT_BRAKE_MPS2)) for a in _ACCELERATIONS])
_THROUGH = np.array([(a, 99.0, a) for a in _ACCELERATIONS])
_THEN_STEADY = np.array([(a, _REACT_S + 1.0, 0.0) for a in _ACCELERATIONS])
"""Three continuations of each acceleration: (acceleration, seconds, acceleration after that)."""
_HORIZON_STEPS = 30
_GAP_MPS = 7.0
"""Speed below which the ego makes a quick start if only a quick start uses a gap."""
_PATIENCE_S = 8.0
_MARGINS, _TIGHT_MARGINS, _LEAST_MARGINS = (
    np.array([1.2, 0.7, 0.25]),
    np.array([0.5, 0.3, 0.1]),
    np.array([0.1, 0.06, 0]),
)
_STARTS = np.array([[4.0, 99.0, 4.0], [4.0, 2.4, 0.0], [4.0, 1.6, 0.0], [2.3, 99.0, 2.3]])
_MANOEUVRES = np.array(
    [[4.0, 99.0, 4.0], [2.3, 99.0, 2.3], [1.2, 99.0, 1.2], [0.0, 99.0, 0.0], [-1.2, 2.0, 0.0], [-2.4, 2.0, 0.0]]
)
"""Plans for a manoeuvre, from standstill and at speed: (acceleration, seconds, acceleration after that)."""
_FOLLOWER_BRAKES_MPS2, _NOBODY_BRAKES_MPS2 = 6.0, 0.01
"""Braking of a follower, and of a follower that does not brake, for whom the ego leaves room."""
_LEFT_ALONE_S = 0.5
_NO_JUNCTIONS = np.zeros((0, 2))


def is_free(
    now: Situation, profile: Floats, until_row: float, *, within_s: float = math.inf, room_s: float = 0.0
) -> bool:
    """Return whether a profile can be driven up to a row, or for `within_s` seconds, without hindering others much.

    Actors whose way the ego crosses get `room_s` more than they need.
    """
    plans = _MANOEUVRES if now.speed_mps > 4.0 else _STARTS
    traffic, scene = now.traffic, now.scene
    nobody = np.zeros(len(traffic.boxes), dtype=np.int64)
    margins = _with_room(_MARGINS if now.speed_mps > 4.0 else _START_MARGINS, room_s)
    found, driven = rollouts(
        now.path(profile), now.row, now.speed_mps, scene.size, traffic.forecast, traffic.boxes, nobody, plans,
        scene.limits, _NO_JUNCTIONS, now.stop_row, margins, _FOLLOWER_BRAKES_MPS2, traffic.forecast.shape[1] - 1,
    )  # fmt: skip
    return bool(np.any((found >= within_s - 1e-9) | (now.row + driven >= until_row)))


def _with_room(margins: Floats, room_s: float) -> Floats:
    """Return margins (length in m, width in m, seconds) with `room_s` more seconds."""
    roomy: Floats = margins + np.array([0.0, 0.0, room_s])
    return roomy


class SpeedChoice:
    """Chooses the acceleration of each tick; remembers how long the ego has waited."""

    def __init__(self) -> None:
        self._waited_s = 0.0
        self._pushing = False

    def choose(self, now: Situation, path: Floats, stop_row: float, *, cruise_mps: float, hurry: bool) -> float:
        """Return the acceleration in m/s2 without trouble; if none is, the acceleration with the latest trouble.

        `hurry` allows more than comfortable acceleration, in places where the ego must not stay.
        """
        v, scene = now.speed_mps, now.scene
        self._waited_s = self._waited_s + now.elapsed_s if v < 0.5 else 0.0
        self._pushing = self._waited_s > _PATIENCE_S or (self._pushing and v < _GAP_MPS)
        limit = min(float(scene.limits[scene.index(now.row + 0.3 * v)]), max(cruise_mps, 3.0))
        trial = _SpeedTrial(now, path, stop_row, pushy=self._pushing, hurry=hurry)
        hurry = trial.hurry
        followed = trial.is_pressed(_FALL_BACK)
        pressed = followed and trial.is_pressed(_STEADY)
        comfort = _HURRY_ACCEL_MPS2 if hurry or pressed else _COMFORT_ACCEL_MPS2
        wanted = min(max(1.2 * (limit - v), -2.5), comfort)
        if trial.survives(wanted):
            return wanted
        free, wary = trial.freest(never_wary=followed)
        safe = _ACCELERATIONS[free >= trial.whole_s]
        if len(safe) == 0:
            lost = free.max() <= _LEFT_ALONE_S and not hurry
            return -8.0 if lost else float(_ACCELERATIONS[int(np.argmax(free))])
        if not (wary or hurry or pressed):
            return min(float(safe[0]), wanted, 0.0 if followed else _FALL_BACK_MPS2)
        gentle = safe[safe <= comfort]
        if v < _GAP_MPS and safe[0] > comfort and (len(gentle) == 0 or gentle[0] < 0.5):
            return float(safe[0])  # only a quick start can use this gap
        return float(min(gentle[0], wanted)) if len(gentle) else float(safe[0])


class _SpeedTrial:
    """Tries plans on one path at one moment. A plan without trouble for `whole_s` is free of trouble."""

    def __init__(self, now: Situation, path: Floats, stop_row: float, *, pushy: bool, hurry: bool) -> None:
        traffic = now.traffic
        self.now, self.path, self.stop_row = now, path, stop_row
        self.leads = leaders(path, now.row, traffic.boxes)
        self.junctions = now.right_of_way.keep_clear(now.scene, traffic, path, self.leads)
        self.whole_s = STEP_S * _HORIZON_STEPS - 1e-9
        front, rear = now.row + now.scene.half_length_m, now.row - now.scene.half_length_m
        inside = any(first + 0.5 < front and rear < last for first, last in self.junctions.tolist())
        self.hurry = hurry or inside
        # inside a junction smaller margins apply, because stopping among crossing traffic helps nobody
        first = _TIGHT_MARGINS if inside else _with_room(_MARGINS, 0.0 if pushy else now.room_s)
        self._tiers: tuple[tuple[Floats, bool], ...] = (
            (first, True),
            (first, False),
            (_TIGHT_MARGINS, True),
            (_TIGHT_MARGINS, False),
        )
        if pushy:
            self._tiers += ((_LEAST_MARGINS, False),)

    def freest(self, *, never_wary: bool) -> tuple[Floats, bool]:
        """Return (`seconds`, whether leaders may brake hard) of the first tier with a plan without trouble.

        If there is none, return those of the last tier. `never_wary` skips tiers in which leaders may brake hard.
        """
        tiers = [(margins, wary) for margins, wary in self._tiers if not (wary and never_wary)]
        for margins, wary in tiers:
            free = self.seconds(margins, wary=wary)
            if free.max() >= self.whole_s:
                break
        return free, wary

    def survives(self, acceleration: float) -> bool:
        """Return whether the ego can still stop after driving on at `acceleration` for a moment."""
        plan = np.array([[acceleration, _REACT_S, min(acceleration, _COMFORT_BRAKE_MPS2)]])
        return bool(self._roll(plan, self._tiers[0][0], self.leads)[0] >= self.whole_s)

    def is_pressed(self, plan: Floats) -> bool:
        """Return whether a follower would have to brake for an ego that drives this plan."""
        nobody = np.zeros_like(self.leads)
        braking = self._roll(plan, _TIGHT_MARGINS, nobody)[0]
        return bool(self._roll(plan, _TIGHT_MARGINS, nobody, follower_mps2=_NOBODY_BRAKES_MPS2)[0] < braking)

    def seconds(self, margins: Floats, *, wary: bool) -> Floats:
        """Return the seconds until trouble for each of `_ACCELERATIONS`, driving through or stopping a moment later.

        `wary`: leaders may brake hard at any moment.
        """
        steady = np.zeros_like(self.leads)
        leads = self.leads if wary and not self.hurry else steady
        free = self._roll(_THEN_STOP, margins, self.leads if wary else steady)
        free = np.maximum(free, self._roll(_THROUGH, margins, leads))
        if self.hurry:  # a manoeuvre begun in a gap continues there: the leader keeps driving, and so does the ego
            free = np.maximum(free, self._roll(_THEN_STEADY, margins, leads))
        return free

    def _roll(
        self, plans: Floats, margins: Floats, leads: Ints, *, follower_mps2: float = _FOLLOWER_BRAKES_MPS2
    ) -> Floats:
        now, scene = self.now, self.now.scene
        found: Floats = rollouts(
            self.path, now.row, now.speed_mps, scene.size, now.traffic.forecast, now.traffic.boxes, leads, plans,
            scene.limits, self.junctions, self.stop_row, margins, follower_mps2, _HORIZON_STEPS,
        )[0]  # fmt: skip
        return found
