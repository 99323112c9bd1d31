"""An episode under way with an expert that drives or watches; samples are taken from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from drive_robust_agents._wrappers.route_planner import MIN_M, MIN_SIMLINGO_M, RoutePlanner, Target
from drive_robust_agents.expert import Expert
from drive_robust_agents.training.data.labels import ExpertMoment
from drive_robust_agents.training.data.poses import FreeSpace
from pytest_drive_robust import CameraSpec, Control, Gps, Observation
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.domain.truth import WorldState
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.sensors import sensed

__all__ = ["SHIPPED", "STUCK_S", "TICK_CAP", "ExpertEpisode", "Teacher", "faults", "seen_by_expert"]

TICK_CAP, STUCK_S = 4000, 40.0


@dataclass(frozen=True, slots=True)
class Teacher:
    """The options of the expert as a teacher: its room for others, its time at stop signs (`Expert`).

    By default the expert uses gaps and stops at signs without any margin, because it knows the places of all actors. An
    agent with a camera and without memory cannot tell such a short stop from driving on.
    """

    room_s: float = 0.0
    halt_s: float = 0.0

    def expert(self) -> Expert:
        """Return a new expert that drives so."""
        return Expert(room_s=self.room_s, halt_s=self.halt_s)


SHIPPED = Teacher()
"""The default expert, the one in every table."""


@dataclass(slots=True)
class ExpertEpisode:
    """An episode under way: the world, the expert that watches or drives it, and the two route planners.

    `told` is the ego's position as given to the planners; None gives the true position.
    """

    simulator: EmbeddedSimulator
    expert: Expert
    planners: tuple[RoutePlanner, RoutePlanner]
    room: FreeSpace
    night: bool
    told: Gps | None = None
    states: list[WorldState] = field(default_factory=list)
    controls: list[Control] = field(default_factory=list)

    @classmethod
    def begin(
        cls,
        route: Route,
        *,
        seed: int,
        cameras: Sequence[CameraSpec] = (),
        stuck_s: float = STUCK_S,
        teacher: Teacher = SHIPPED,
    ) -> ExpertEpisode:
        """Start an episode and return its first moment."""
        simulator = EmbeddedSimulator(SimulatorOptions(tick_cap=TICK_CAP, stuck_stop_s=stuck_s))
        simulator.reset(route, seed=seed, cameras=cameras)
        expert, plan = teacher.expert(), simulator.plan()
        expert.reset(plan, seed)
        planners = RoutePlanner(plan, min_m=MIN_M), RoutePlanner(plan, min_m=MIN_SIMLINGO_M)
        night = route.weather.sun_altitude_angle < 0.0
        return cls(simulator, expert, planners, FreeSpace(simulator.world.lane_map), night)

    @property
    def over(self) -> bool:
        """Whether the episode has ended or a rule was broken."""
        return self.simulator.done is not None or faults(self.simulator) > 0

    def targets(self) -> tuple[Target, Target]:
        """Return the planners' targets here; the planners drop reached points, as in every tick."""
        at = self.told or self.simulator.state.ego
        return self.planners[0].step(at.x_m, at.y_m), self.planners[1].step(at.x_m, at.y_m)

    def act(self) -> Control:
        """Return the expert's control for this moment."""
        return self.expert.act(seen_by_expert(self.simulator))

    def here(self, targets: tuple[Target, Target]) -> ExpertMoment:
        """Return this moment, in which the expert has acted."""
        return ExpertMoment(self.simulator.truth(), self.expert.intent(), targets, self.night)

    def step(self, recorded: Control, applied: Control) -> None:
        """Advance by one tick with the control `applied`, and record the past moment with `recorded`."""
        self.states.append(self.simulator.state)
        self.controls.append(recorded)
        self.simulator.step(applied)


def seen_by_expert(simulator: EmbeddedSimulator) -> Observation:
    """Return the observation for the expert, without drawing pictures."""
    return sensed(simulator.state, cameras={}, truth=simulator.truth())


def faults(simulator: EmbeddedSimulator, *, lanes: bool = True) -> int:
    """Return the number of broken rules so far; with `lanes`, leaving the lanes of the route counts as one."""
    state = simulator.world.state
    outside = lanes and state.criteria[c.C_OUTSIDE_M] > 0.0
    return state.infractions() + int(outside)
