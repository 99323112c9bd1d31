"""How well the controllers of the learned agents drive when the network is perfect: what their numbers are tuned with.

The perfect network is the privileged expert. At a tick the world is snapshot, a fork of the expert drives on for up to
3 s, and the world is put back: what the fork did are the waypoints, the line that it followed is the path. So whatever
is lost against the expert's own driving is lost by the controller, and not by eyes that see badly.

`--tuning` says whose numbers the controllers have: ours, found for a plain car and converted for the one that is
driven, or the published ones, made for CARLA's car, as they are. `--settings` drives under perturbations: latency shows
how stiff a controller is, GPS noise what its target point does to it.
"""

from __future__ import annotations

import argparse
import math
import statistics
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from typing import cast

from rich.progress import track

from drive_robust_agents._vehicle.mkz import Pedals
from drive_robust_agents._vehicle.plain_car import pedals_from_plain, steer_from_plain
from drive_robust_agents._wrappers import tuning
from drive_robust_agents._wrappers.path_controller import PathController, PathTuning
from drive_robust_agents._wrappers.pid import Point, WaypointController, WaypointTuning
from drive_robust_agents._wrappers.route_planner import RoutePlanner, to_ego
from drive_robust_agents._wrappers.sensed_pose import SensedPose
from drive_robust_agents.expert import Expert
from drive_robust_agents.training.data.labels import path_ahead
from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.domain.truth import EgoState
from pytest_drive_robust.errors import DriveRobustError, UnknownNameError
from pytest_drive_robust.metrics.score import driving_score, is_success
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.routes import resolve_routes

TUNINGS: dict[str, dict[tuning.Tuning, tuple[WaypointTuning, int]]] = {
    "tcp": {"ours": (tuning.TCP, 4), "published": (tuning.TCP_PUBLISHED, 4)},
    "uniad": {"ours": (tuning.UNIAD, 6), "published": (tuning.UNIAD_PUBLISHED, 6)},
    "vad": {"ours": (tuning.VAD, 6), "published": (tuning.VAD_PUBLISHED, 6)},
}
PATHS = {"ours": tuning.SIMLINGO, "published": tuning.SIMLINGO_PUBLISHED}
AGENTS = ("expert", *TUNINGS, "simlingo")
SPEED_POINTS = 10

Steer = Callable[["Perfect", EgoState, float, Point], Control]


class Perfect:
    """An agent whose waypoints are the expert's own future; `make` makes an episode's controller.

    The controller's controls are applied unchanged, or converted if the controller is `for_plain_car`.

    The expert's future is computed anew when it is `every` ticks old. Ticks are those of the observations: under a
    setting that holds controls, `act` is not called in every tick.
    """

    privileged = True
    consumes = frozenset({"gps", "compass", "speed"})

    def __init__(
        self,
        simulator: EmbeddedSimulator,
        make: Callable[[], Steer],
        *,
        horizon_s: float,
        every: int,
        for_plain_car: bool = False,
    ):
        self._for_plain_car = for_plain_car
        self._simulator, self._make, self._every = simulator, make, every
        self._ticks = round(20.0 * horizon_s) + every

    def sensors(self) -> Sequence[CameraSpec]:
        return ()

    def reset(self, route: GlobalPlan, seed: int) -> None:
        self.expert, self._planner, self._steer = Expert(), RoutePlanner(route), self._make()
        self.expert.reset(route, seed)
        self._future: list[EgoState] = []
        self._tick = self._branched = 0

    def act(self, observation: Observation) -> Control:
        assert observation.truth is not None
        ego, pose = observation.truth.state.ego, SensedPose.of(observation)
        self.expert.act(observation)
        self._tick = observation.tick
        if not self._future or self.age_ticks >= self._every:
            self._future, self._branched = self._drive_on(observation), observation.tick
        local, _ = self._planner.step(pose.x_m, pose.y_m).seen_from(*pose)
        control = self._steer(self, ego, observation.speed.mps, local)
        if not self._for_plain_car:
            return control
        throttle, brake = pedals_from_plain(observation.speed.mps, Pedals(control.throttle, control.brake))
        return Control(throttle, steer_from_plain(control.steer), brake)

    @property
    def age_ticks(self) -> int:
        """Age of the expert's known future in ticks."""
        return self._tick - self._branched

    def waypoints(self, ego: EgoState, step_s: float, count: int) -> list[Point]:
        """Return the expert's places after 1 to `count` steps, in the ego frame; straight on after the known future."""
        points, last = list[Point](), len(self._future) - 1
        for row in (self.age_ticks + round(20.0 * step_s * k) for k in range(1, count + 1)):
            pose = self._future[min(row, last)]
            beyond_m = pose.speed_mps * max(row - last, 0) / 20.0
            x_m, y_m = pose.x_m + beyond_m * math.cos(pose.yaw_rad), pose.y_m + beyond_m * math.sin(pose.yaw_rad)
            points.append(to_ego(x_m - ego.x_m, y_m - ego.y_m, ego.yaw_rad))
        return points

    def path(self, ego: EgoState) -> list[Point]:
        """Return the line that the expert follows, a point a metre."""
        intent = self.expert.intent()
        return [(x, y) for x, y in path_ahead(ego, intent.line, intent.row).tolist()]

    def _drive_on(self, observation: Observation) -> list[EgoState]:
        simulator, fork, kept = self._simulator, self.expert.fork(), self._simulator.snapshot()
        found = [simulator.state.ego]
        while len(found) <= self._ticks and simulator.done is None:
            control = fork.act(replace(observation, truth=simulator.truth()))
            found.append(simulator.step(control).ego)
        simulator.restore(kept)
        return found


def by_waypoints(numbers: WaypointTuning, count: int) -> Callable[[], Steer]:
    def make() -> Steer:
        controller = WaypointController(numbers)
        return lambda net, ego, mps, target: controller.step(net.waypoints(ego, 0.5, count), mps, target)

    return make


def by_path(numbers: PathTuning) -> Callable[[], Steer]:
    def make() -> Steer:
        controller = PathController(numbers)
        return lambda net, ego, mps, _: controller.step(net.path(ego), net.waypoints(ego, 0.25, SPEED_POINTS), mps)

    return make


def agent_of(name: str, simulator: EmbeddedSimulator, *, tuned: tuning.Tuning, every: int) -> Perfect | Expert:
    if name not in AGENTS:
        raise UnknownNameError.of("agent with a controller", name, AGENTS)
    if name == "expert":
        return Expert()
    if name == "simlingo":
        make, horizon_s = by_path(PATHS[tuned]), 0.25 * SPEED_POINTS
    else:
        numbers, count = TUNINGS[name][tuned]
        make, horizon_s = by_waypoints(numbers, count), 0.5 * count
    return Perfect(simulator, make, horizon_s=horizon_s, every=every, for_plain_car=tuned == "ours")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--agents", default=",".join(AGENTS), help="names, separated by commas")
    parser.add_argument("--routes", default="one-per-scenario", help="a named set, a route file, or route ids")
    parser.add_argument("--settings", default="clean", help="sentences, separated by commas")
    parser.add_argument("--every", type=int, default=8, help="a new branch every so many ticks (default: 8)")
    parser.add_argument("--tuning", default="ours", help="ours, published, or both, separated by commas")
    given = parser.parse_args()
    settings = [Setting.parse(one) for one in given.settings.split(",")]
    tunings = cast("list[tuning.Tuning]", given.tuning.split(","))
    for tuned in tunings:
        tuning.require_tuning(tuned, agent="tcp")
    for name, tuned, setting in product(given.agents.split(","), tunings, settings):
        if name != "expert" or tuned == tunings[0]:
            drive(name, setting, tuned=tuned, routes=resolve_routes(given.routes), every=given.every)


def drive(name: str, setting: Setting, *, tuned: tuning.Tuning, routes: Sequence[Route], every: int) -> None:
    scores, failed = [], []
    for route in track(routes, f"{name}, {setting}", transient=True):
        simulator = EmbeddedSimulator(SimulatorOptions(stuck_stop_s=30.0))
        agent = agent_of(name, simulator, tuned=tuned, every=every)
        result = drive_episode(simulator, agent, route=route, setting=setting, seed=0, agent_name=name)
        if result.outcome in (Outcome.AGENT_ERROR, Outcome.INFRA_ERROR):
            raise SystemExit(f"{name} on {route.label}: {result.end_detail}")
        scores.append(driving_score(result))
        failed += [] if is_success(result) else [route.label]
    who = f"{name:9s} {'' if name == 'expert' else tuned:10s} {setting!s:20s}"
    success = f"{len(scores) - len(failed)}/{len(scores)}"
    print(f"{who} SR {success}  DS {statistics.mean(scores):.1f}  {', '.join(failed)}", flush=True)


if __name__ == "__main__":
    try:
        main()
    except DriveRobustError as error:
        sys.exit(f"error: {error}")
