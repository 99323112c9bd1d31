"""Make `simlingo`'s commentary of a moment: the expert's action, from its own future, and the reason.

The published labels are made from the simulator's state, too (SimLingo `dataset_generation`); the rules here are our
own. A reason is a thing that the front camera may see: the nearest hindrance.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents.training.data.commentary import Action, Commentary, Reason
from pytest_drive_robust.domain.truth import LightState

__all__ = ["action_of", "commentary", "hindrances", "turn_ahead_rad"]

Numbers = NDArray[np.floating]

STANDS_MPS, CHANGE_MPS = 0.4, 0.8
_LATER = 7
"""Index of the future speed, at 2 s, that is compared with the present speed."""
_LIGHT_M, _SIGN_M = 40.0, 30.0
_CURVE_RAD = math.radians(25.0)
_LIGHTS = {LightState.RED: Reason.RED, LightState.YELLOW: Reason.YELLOW, LightState.STOP_SIGN: Reason.SIGN}


def commentary(facts: Mapping[str, float], speed_mps: float, speeds: Numbers, path: Numbers) -> Commentary:
    """Return the sentence for a sample.

    `facts` are the values of `training.data.facts.FACTS` by name, `speeds` (n >= 8,) the expert's speeds in m/s every
    0.25 s from now, and `path` (n, 2) its path in metres.
    """
    action = action_of(speed_mps, speeds)
    if action in (Action.REMAIN, Action.STOP, Action.SLOW):
        return Commentary(action, _why_slower(facts, speed_mps, path, stands=action is not Action.SLOW))
    if facts["passing"] > 0.5:
        return Commentary(action, Reason.SIREN if facts["siren"] > 0.5 else Reason.PASS)
    if action is Action.GO:
        freed = facts["light"] == LightState.GREEN and facts["light_m"] < _SIGN_M and speed_mps < 4.0
        return Commentary(action, Reason.GREEN if freed else Reason.CLEAR)
    follows = facts["lead_m"] < _reach_m(speed_mps)
    return Commentary(action, Reason.FOLLOW if follows else Reason.CLEAR)


def action_of(speed_mps: float, speeds: Numbers) -> Action:
    """Return the action of a driver with this present speed and these future speeds."""
    if speed_mps < STANDS_MPS:
        return Action.REMAIN if float(np.max(speeds)) < STANDS_MPS else Action.GO
    if float(np.min(speeds)) < STANDS_MPS:
        return Action.STOP
    change = float(speeds[_LATER]) - speed_mps
    if abs(change) < CHANGE_MPS:
        return Action.KEEP
    return Action.GO if change > 0.0 else Action.SLOW


def hindrances(facts: Mapping[str, float], speed_mps: float) -> list[tuple[float, Reason]]:
    """Return (metres, reason) of each thing ahead that requires less speed, nearest first."""
    reach = _reach_m(speed_mps)
    found = []
    light = _LIGHTS.get(LightState(int(facts["light"]))) if facts["light"] >= 0.0 else None
    if light is not None and facts["light_m"] < (_SIGN_M if light is Reason.SIGN else _LIGHT_M):
        found.append((facts["light_m"], light))
    if facts["lead_m"] < reach and facts["lead_mps"] < speed_mps + 0.5:
        found.append((facts["lead_m"], Reason.VEHICLE))
    found += [
        (facts[name], reason)
        for name, reason in (("walker_m", Reason.PEDESTRIAN), ("obstacle_m", Reason.OBSTACLE))
        if facts[name] < reach
    ]
    return sorted(found, key=lambda hindrance: hindrance[0])


def turn_ahead_rad(path: Numbers) -> float:
    """Return the turn in radians of a path (n, 2) from beginning to end."""
    steps = np.diff(np.asarray(path, dtype=np.float64), axis=0)
    angles = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    return float(np.max(np.abs(angles - angles[0])))


def _why_slower(facts: Mapping[str, float], speed_mps: float, path: Numbers, *, stands: bool) -> Reason:
    if facts["waiting"] > 0.5:
        return Reason.GAP
    if facts["siren"] > 0.5:
        return Reason.SIREN
    hindering = hindrances(facts, speed_mps)
    if hindering:
        return hindering[0][1]
    if facts["junction_m"] < _reach_m(speed_mps):
        return Reason.GAP if stands else Reason.JUNCTION
    if turn_ahead_rad(path) > _CURVE_RAD:
        return Reason.CURVE
    return Reason.LIMIT if speed_mps > facts["limit_mps"] + 0.5 else Reason.NONE


def _reach_m(speed_mps: float) -> float:
    """Return within how many metres a thing ahead matters at this speed."""
    return 8.0 + 2.5 * max(speed_mps, 0.0)
