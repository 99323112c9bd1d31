"""The cast of an episode while it is being put on stage: sizes by kind, and rows for the kernels."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.domain.truth import ActorKind, ActorState
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.triggers import Arrival, Passing, Trigger

__all__ = ["SIZES_M", "Cast", "Script"]

SIZES_M: dict[ActorKind, tuple[float, float, float]] = {
    ActorKind.CAR: (4.6, 1.9, 1.5),
    ActorKind.VAN: (5.6, 2.1, 2.3),
    ActorKind.TRUCK: (9.0, 2.5, 3.4),
    ActorKind.EMERGENCY: (5.9, 2.2, 2.6),
    ActorKind.BICYCLE: (1.8, 0.6, 1.7),
    ActorKind.PEDESTRIAN: (0.5, 0.6, 1.75),
    ActorKind.CONE: (0.4, 0.4, 0.8),
    ActorKind.BARRIER: (2.0, 0.5, 1.0),
    ActorKind.CONTAINER: (2.4, 1.6, 2.2),
    ActorKind.WARNING_SIGN: (0.3, 1.0, 1.6),
    ActorKind.BUILDING: (12.0, 10.0, 9.0),
    ActorKind.DOOR: (0.9, 0.9, 1.1),
    ActorKind.DIRT: (4.0, 3.0, 0.02),
}
"""Length, width, height in metres."""


@dataclass(frozen=True, slots=True)
class Script:
    """What a trigger sets off: after `delay_s`, drive `speed_mps` towards `right_m` for `seconds`, then `after_mps`.

    `relative` 1 reads the speed as a share of the ego's speed at that moment, 2 as metres per second above the ego's.
    """

    speed_mps: float
    right_m: float = 0.0
    seconds: float = np.inf
    after_mps: float = 0.0
    delay_s: float = 0.0
    relative: int = 0


@dataclass(slots=True)
class Cast:
    """Collects actors and flows; `freeze` returns the arrays of `State`."""

    rows: list[NDArray[np.float64]] = field(default_factory=list)
    ints: list[NDArray[np.int64]] = field(default_factory=list)
    flow_rows: list[list[float]] = field(default_factory=list)
    flow_ints: list[list[int]] = field(default_factory=list)
    flow_gaps: list[NDArray[np.float64]] = field(default_factory=list)

    def add(
        self,
        kind: ActorKind,
        *,
        mode: int,
        path: int,
        s_m: float,
        right_m: float = 0.0,
        speed_mps: float = 0.0,
        target_mps: float | None = None,
        end_m: float = np.inf,
        at_end: int = c.AT_END_STAY,
        lateral_mps: float = 1.2,
        brake_mps2: float = 6.0,
        accel_mps2: float = 2.0,
        background: bool = False,
        obeys_lights: bool = False,
        leash: bool = False,
        sync_m: float = 0.0,
        appears: bool = False,
        blind: bool = False,
        late: bool = False,
        yaw_rad: float = 0.0,
    ) -> int:
        """Add one actor on a path; returns its number. Without a script it just does what its mode says.

        `background` actors count for the driving efficiency; `leash` keeps one near the ego; `sync_m` keeps it that far
        ahead of the ego; one that `appears` does not exist before its script starts; a `blind` one drives on whatever
        is ahead of it, a `late` one brakes only for who is in the middle of its lane already; `yaw_rad` turns a
        standing one against its path.
        """
        row, whole = np.zeros(c.ACTOR_COLUMNS), np.zeros(c.ACTOR_INTS, dtype=np.int64)
        row[[c.A_LENGTH, c.A_WIDTH, c.A_HEIGHT]] = SIZES_M[kind]
        row[[c.A_S, c.A_LAT, c.A_TARGET_LAT]] = s_m, right_m, right_m
        row[[c.A_V, c.A_TARGET_V]] = speed_mps, speed_mps if target_mps is None else target_mps
        row[[c.A_LAT_RATE, c.A_END_S, c.A_SYNC_M]] = lateral_mps, end_m, sync_m
        row[[c.A_BRAKE_MAX, c.A_ACCEL_MAX, c.A_TURNED]] = brake_mps2, accel_mps2, yaw_rad
        whole[[c.I_KIND, c.I_MODE, c.I_PATH, c.I_AT_END]] = int(kind), mode, path, at_end
        whole[[c.I_ACTIVE, c.I_SOLID, c.I_LAST_HIT, c.I_FLOW]] = 2 if appears else 1, 1, -100000, -1
        whole[[c.I_BACKGROUND, c.I_OBEYS_LIGHTS, c.I_LEASH]] = background, obeys_lights, leash
        whole[c.I_BLIND] = c.SEES_NOBODY if blind else c.SEES_LATE if late else c.SEES_ALL
        if kind is ActorKind.DIRT:
            whole[c.I_SOLID] = 0
        whole[c.I_PHASE] = c.PHASE_DONE
        if kind is ActorKind.EMERGENCY:
            whole[c.I_STATE] = int(ActorState.SIREN)
        self.rows.append(row)
        self.ints.append(whole)
        return len(self.rows) - 1

    def script(self, actor: int, trigger: Trigger, script: Script, *, at: tuple[float, float] = (0.0, 0.0)) -> None:
        """Give an actor something to do when its trigger comes; `at` is the conflict point of an `Arrival`."""
        row, whole = self.rows[actor], self.ints[actor]
        whole[c.I_PHASE] = c.PHASE_WAITING
        whole[c.I_RELATIVE] = script.relative
        row[[c.A_SCRIPT_V, c.A_SCRIPT_LAT, c.A_SCRIPT_S]] = script.speed_mps, script.right_m, script.seconds
        row[[c.A_AFTER_V, c.A_DELAY_S]] = script.after_mps, script.delay_s
        if isinstance(trigger, Arrival):
            whole[c.I_TRIGGER] = c.TRIGGER_ARRIVAL
            row[[c.A_TRIGGER_TTA_S, c.A_TRIGGER_M]] = trigger.tta_s, trigger.within_m
            row[[c.A_TRIGGER_X, c.A_TRIGGER_Y]] = at
        elif isinstance(trigger, Passing):
            whole[c.I_TRIGGER] = c.TRIGGER_PROGRESS
            row[c.A_TRIGGER_PROGRESS_M] = trigger.progress_m

    def flow(
        self,
        path: int,
        *,
        source_m: float,
        sink_m: float,
        speed_mps: float,
        gaps_m: NDArray[np.float64],
        background: bool,
        right_m: float,
        kinds: tuple[ActorKind, ...],
        obeys_lights: bool,
        blind: bool,
        late: bool,
    ) -> None:
        """A source and a sink on a path; `gaps_m` are the distances between one car and the next, drawn beforehand."""
        slots = int((sink_m - source_m) / float(np.min(gaps_m))) + 3
        first = len(self.rows)
        for k in range(slots):
            actor = self.add(
                kinds[k % len(kinds)],
                mode=c.MODE_DRIVE,
                path=path,
                s_m=source_m,
                right_m=right_m,
                speed_mps=speed_mps,
                end_m=sink_m,
                at_end=c.AT_END_LEAVE,
                background=background,
                obeys_lights=obeys_lights,
                blind=blind,
                late=late,
            )
            self.ints[actor][[c.I_ACTIVE, c.I_FLOW]] = 0, len(self.flow_rows)
        self.flow_rows.append([source_m, sink_m, speed_mps, float(gaps_m[0]), right_m])
        self.flow_ints.append([path, first, first + slots, -1, 1])
        self.flow_gaps.append(gaps_m)

    def freeze(
        self,
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
        """(actors, actor ints, flows, flow ints, flow gaps); empty tables keep their columns."""
        return (
            np.array(self.rows).reshape(-1, c.ACTOR_COLUMNS),
            np.array(self.ints, dtype=np.int64).reshape(-1, c.ACTOR_INTS),
            np.array(self.flow_rows, dtype=float).reshape(-1, c.FLOW_COLUMNS),
            np.array(self.flow_ints, dtype=np.int64).reshape(-1, c.FLOW_INTS),
            np.array(self.flow_gaps, dtype=float) if self.flow_gaps else np.zeros((0, 1)),
        )
