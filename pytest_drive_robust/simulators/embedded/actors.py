"""Collect the actors of an episode: sizes by kind, triggers, and rows for the kernels."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from pytest_drive_robust.domain.truth import ActorKind, ActorState
from pytest_drive_robust.jit.arrays import Floats, Ints
from pytest_drive_robust.simulators.embedded import state as c


class Size(NamedTuple):
    """Length, width and height of an actor in metres."""

    length_m: float
    width_m: float
    height_m: float


SIZES: dict[ActorKind, Size] = {
    ActorKind.CAR: Size(4.6, 1.9, 1.5),
    ActorKind.VAN: Size(5.6, 2.1, 2.3),
    ActorKind.TRUCK: Size(9.0, 2.5, 3.4),
    ActorKind.EMERGENCY: Size(5.9, 2.2, 2.6),
    ActorKind.BICYCLE: Size(1.8, 0.6, 1.7),
    ActorKind.PEDESTRIAN: Size(0.5, 0.6, 1.75),
    ActorKind.CONE: Size(0.4, 0.4, 0.8),
    ActorKind.BARRIER: Size(2.0, 0.5, 1.0),
    ActorKind.CONTAINER: Size(2.4, 1.6, 2.2),
    ActorKind.WARNING_SIGN: Size(0.3, 1.0, 1.6),
    ActorKind.BUILDING: Size(12.0, 10.0, 9.0),
    ActorKind.DOOR: Size(0.9, 0.9, 1.1),
    ActorKind.DIRT: Size(4.0, 3.0, 0.02),
}


@dataclass(frozen=True, slots=True)
class ActorSpec:
    """An actor on a path: its place, its speed, and its behaviour.

    The actor starts `s_m` along the path, `right_m` to the right of the path, and drives to `end_m`. At `end_m` the
    actor stays, or disappears if it `leaves`. Its speed changes from `speed_mps` to `target_mps` (None: stays equal).
    `background` actors count for the driving efficiency. `leash` keeps the actor near the ego, `sync_m` keeps the actor
    that far ahead of the ego, and `appears` means that the actor does not exist before its script starts. `sees` says
    for whom the actor brakes: for all bodies ahead (`SEES_ALL`), only for bodies already in the middle of its lane
    (`SEES_LATE`), or for nobody (`SEES_NOBODY`; a flow changes to `SEES_ALL` once one of its cars was hit). `yaw_rad`
    turns a standing actor against its path; `state` are the lamps of the actor.
    """

    kind: ActorKind
    path: int
    s_m: float
    speed_mps: float = 0.0
    mode: int = c.MODE_DRIVE
    right_m: float = 0.0
    yaw_rad: float = 0.0
    target_mps: float | None = None
    end_m: float = np.inf
    leaves: bool = False
    lateral_mps: float = 1.2
    brake_mps2: float = 6.0
    accel_mps2: float = 2.0
    background: bool = False
    obeys_lights: bool = False
    leash: bool = False
    sync_m: float = 0.0
    appears: bool = False
    sees: int = c.SEES_ALL
    state: ActorState = ActorState.NONE


@dataclass(frozen=True, slots=True)
class Script:
    """Motion after a trigger: wait `delay_s`, drive `speed_mps` towards `right_m` for `seconds`, then `after_mps`.

    `relative` gives the unit of the speed: metres per second (`SPEED_OWN`), a share of the ego's speed at that moment
    (`SPEED_SHARE`), or metres per second above the ego's speed (`SPEED_ABOVE`).
    """

    speed_mps: float
    right_m: float = 0.0
    seconds: float = np.inf
    after_mps: float = 0.0
    delay_s: float = 0.0
    relative: int = c.SPEED_OWN


@dataclass(frozen=True, slots=True)
class Arrival:
    """The ego is nearer than `within_m` to the actor's conflict point, or less than `tta_s` away at its speed."""

    tta_s: float
    within_m: float


@dataclass(frozen=True, slots=True)
class Passing:
    """The ego has passed `progress_m` metres of the route."""

    progress_m: float


Trigger = Arrival | Passing


@dataclass(slots=True)
class Cast:
    """Collects actors and flows; `freeze` returns the arrays of `State`."""

    rows: list[Floats] = field(default_factory=list)
    ints: list[Ints] = field(default_factory=list)
    flow_rows: list[list[float]] = field(default_factory=list)
    flow_ints: list[list[int]] = field(default_factory=list)
    flow_gaps: list[Floats] = field(default_factory=list)

    def add(self, spec: ActorSpec) -> int:
        """Add one actor and return its number. An actor without a script follows its mode."""
        row, whole = np.zeros(c.ACTOR_COLUMNS), np.zeros(c.ACTOR_INTS, dtype=np.int64)
        row[[c.A_LENGTH, c.A_WIDTH, c.A_HEIGHT]] = SIZES[spec.kind]
        row[[c.A_ALONG_M, c.A_RIGHT_M, c.A_TARGET_RIGHT_M]] = spec.s_m, spec.right_m, spec.right_m
        row[[c.A_V, c.A_TARGET_V]] = spec.speed_mps, spec.speed_mps if spec.target_mps is None else spec.target_mps
        row[[c.A_LATERAL_MPS, c.A_END_M, c.A_SYNC_M]] = spec.lateral_mps, spec.end_m, spec.sync_m
        row[[c.A_BRAKE_MAX, c.A_ACCEL_MAX, c.A_TURNED]] = spec.brake_mps2, spec.accel_mps2, spec.yaw_rad
        whole[[c.I_KIND, c.I_MODE, c.I_PATH]] = int(spec.kind), spec.mode, spec.path
        whole[c.I_AT_END] = c.AT_END_LEAVE if spec.leaves else c.AT_END_STAY
        whole[c.I_ACTIVE] = c.NOT_YET if spec.appears else c.PRESENT
        whole[[c.I_SOLID, c.I_LAST_HIT, c.I_FLOW]] = 1, c.NEVER_HIT, -1
        whole[[c.I_BACKGROUND, c.I_OBEYS_LIGHTS, c.I_LEASH]] = spec.background, spec.obeys_lights, spec.leash
        whole[[c.I_SEES, c.I_STATE, c.I_PHASE]] = spec.sees, int(spec.state), c.PHASE_DONE
        if spec.kind is ActorKind.DIRT:
            whole[c.I_SOLID] = 0
        if spec.kind is ActorKind.EMERGENCY:
            whole[c.I_STATE] = int(ActorState.SIREN)
        self.rows.append(row)
        self.ints.append(whole)
        return len(self.rows) - 1

    def script(self, actor: int, trigger: Trigger, script: Script, *, at: tuple[float, float] = (0.0, 0.0)) -> None:
        """Start `script` for an actor when `trigger` fires; `at` is the conflict point of an `Arrival`."""
        row, whole = self.rows[actor], self.ints[actor]
        whole[c.I_PHASE] = c.PHASE_WAITING
        whole[c.I_RELATIVE] = script.relative
        row[[c.A_SCRIPT_V, c.A_SCRIPT_RIGHT_M, c.A_SCRIPT_S]] = script.speed_mps, script.right_m, script.seconds
        row[[c.A_AFTER_V, c.A_DELAY_S]] = script.after_mps, script.delay_s
        if isinstance(trigger, Arrival):
            whole[c.I_TRIGGER] = c.TRIGGER_ARRIVAL
            row[[c.A_TRIGGER_TTA_S, c.A_TRIGGER_M]] = trigger.tta_s, trigger.within_m
            row[[c.A_TRIGGER_X, c.A_TRIGGER_Y]] = at
        elif isinstance(trigger, Passing):
            whole[c.I_TRIGGER] = c.TRIGGER_PROGRESS
            row[c.A_TRIGGER_PROGRESS_M] = trigger.progress_m

    def flow(self, car: ActorSpec, *, kinds: tuple[ActorKind, ...], gaps_m: Floats) -> None:
        """Add a flow of cars like `car`, of `kinds` in turn, that appear at `s_m` and disappear at `end_m`.

        `gaps_m` are the distances between consecutive cars in metres, drawn beforehand.
        """
        slots = int((car.end_m - car.s_m) / float(np.min(gaps_m))) + 3
        first = len(self.rows)
        for k in range(slots):
            actor = self.add(replace(car, kind=kinds[k % len(kinds)], leaves=True))
            self.ints[actor][[c.I_ACTIVE, c.I_FLOW]] = c.ABSENT, len(self.flow_rows)
        self.flow_rows.append([car.s_m, car.end_m, car.speed_mps, float(gaps_m[0]), car.right_m])
        self.flow_ints.append([car.path, first, first + slots, -1, 1])
        self.flow_gaps.append(gaps_m)

    def freeze(self) -> tuple[Floats, Ints, Floats, Ints, Floats]:
        """Return (actors, actor ints, flows, flow ints, flow gaps); empty tables keep their columns."""
        return (
            np.array(self.rows).reshape(-1, c.ACTOR_COLUMNS),
            np.array(self.ints, dtype=np.int64).reshape(-1, c.ACTOR_INTS),
            np.array(self.flow_rows, dtype=float).reshape(-1, c.FLOW_COLUMNS),
            np.array(self.flow_ints, dtype=np.int64).reshape(-1, c.FLOW_INTS),
            np.array(self.flow_gaps, dtype=float) if self.flow_gaps else np.zeros((0, 1)),
        )
