"""An agent of the leaderboard behind our `Agent` protocol."""

from __future__ import annotations

import hashlib
import importlib
import itertools
import math
import os
import weakref
from collections.abc import Callable, Sequence
from typing import Any

from pytest_drive_robust.bench2drive.agents.carla_world import HeroWorld, show_world
from pytest_drive_robust.bench2drive.agents.official_rig import OfficialRig, read_rig
from pytest_drive_robust.bench2drive.agents.payloads import Payloads, frame_number, game_time_s
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.route import GlobalPlan, PlanPoint, RoadOption
from pytest_drive_robust.errors import DriveRobustError, UsageError

_HOST, _PORT = "localhost", 2000
"""What the leaderboard's own options are when nobody says otherwise. Nothing listens there."""
_EPISODES = itertools.count()
_FIELDS = (("throttle", 0.0), ("steer", -1.0), ("brake", 0.0))

_STRAIGHT_PLAN = GlobalPlan(
    tuple(PlanPoint(x, 0.0, RoadOption.LANE_FOLLOW) for x in (0.0, 50.0, 100.0)),
    tuple(PlanPoint(float(x), 0.0, RoadOption.LANE_FOLLOW) for x in range(101)),
)
"""Hundred metres straight on: what an agent is set up with before there is a route, to see its sensors."""


class OfficialAgent:
    """Makes an object of the agent's class for every episode, as the official evaluator does for every route.

    The order of calls is that of the evaluator: the class is called with host, port and debug; `set_global_plan`;
    `setup`; then `run_step` in every tick, and `destroy` before the next episode or at the end of the process. One
    more object is made and destroyed at the start, on a straight plan, to know the agent's sensors.

    `privileged` agents are those with a sensor that is computed from the ground truth (lidar, radar).
    """

    def __init__(self, cls: type, config: str, *, name: str) -> None:
        self._class = cls
        self._config = config
        self._name = name
        self._destroy: weakref.finalize[..., Any] | None = None
        self._agent: Any = None
        self._world = HeroWorld()
        try:
            self._rig = self._wake(_STRAIGHT_PLAN, "sensors")
        except DriveRobustError:
            raise
        except (Exception, SystemExit) as error:
            raise UsageError(f"{name} cannot be set up: {type(error).__name__}: {error}") from error
        finally:
            self._end()
        self.privileged = self._rig.needs_truth
        self.consumes = self._rig.consumes
        self._payloads = Payloads(self._rig, seed=0, route="")

    def sensors(self) -> Sequence[CameraSpec]:
        """Return the agent's cameras."""
        return self._rig.cameras

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Destroy the agent of the last episode, and make and set up that of this one."""
        self._end()
        plan = hashlib.blake2b(repr(route.points).encode(), digest_size=6).hexdigest()
        self._world = HeroWorld()
        self._payloads = Payloads(self._rig, seed=seed, route=plan)
        if self._wake(route, plan) != self._rig:
            raise ValueError(f"sensors() of {self._name} gave other sensors than before, expected the same every time")

    def act(self, observation: Observation) -> Control:
        """Run one `run_step`."""
        tick = observation.tick
        time_s = game_time_s(tick)
        self._world.hero.see(observation)
        show_world(self._world, frame=frame_number(tick), time_s=time_s)
        if hasattr(self._agent, "get_hero"):
            self._agent.hero_actor = self._world.hero
        control = control_of(self._agent.run_step(self._payloads.of(observation), time_s))
        self._world.hero.command = control
        return control

    def _wake(self, plan: GlobalPlan, route: str) -> OfficialRig:
        agent = self._class(_HOST, _PORT, False)
        self._agent = agent
        self._destroy = weakref.finalize(self, _quietly, agent.destroy)
        agent.set_global_plan(_gps_plan(plan), _world_plan(plan))
        agent.setup(_config(self._config, route))
        return read_rig(agent.sensors(), agent=self._name)

    def _end(self) -> None:
        finish, self._destroy, self._agent = self._destroy, None, None
        if finish is not None:
            finish()


def _config(given: str, route: str) -> str:
    """Return what `setup` is given; with Bench2Drive's switch on, a name to save under follows, as officially."""
    if not os.environ.get("IS_BENCH2DRIVE"):
        return given
    return f"{given}+drive_robust_{route}_{os.getpid()}_{next(_EPISODES)}"


def _quietly(destroy: Callable[[], object]) -> None:
    """Call `destroy` and print what goes wrong: the episode is over and scored, so it belongs to none."""
    try:
        destroy()
    except (Exception, SystemExit) as error:
        print(f"drive-robust: destroy() of the agent raised {type(error).__name__}: {error}")


def control_of(command: object) -> Control:
    """Return the same command, held within its ranges as CARLA does. Raises `TypeError` and `ValueError`.

    The hand brake brakes with all that there is. Our vehicle has no reverse gear: to ask for it is an error, not a
    drive forward. Numbers that are none (NaN) stay what they are, for the loop to blame.
    """
    values: list[float] = []
    for field, low in _FIELDS:
        given: Any = getattr(command, field, None)
        try:
            number = float(given)
        except (TypeError, ValueError):
            raise TypeError(
                f"run_step returned {command!r} of type {type(command).__name__} whose {field} is {given!r}, expected "
                "a carla.VehicleControl or an object with its fields"
            ) from None
        values.append(number if math.isnan(number) else min(max(number, low), 1.0))
    throttle, steer, brake = values
    if getattr(command, "reverse", False):
        raise ValueError(f"run_step returned {command!r}, which asks for the reverse gear: the vehicle here has none")
    if getattr(command, "hand_brake", False):
        throttle, brake = 0.0, 1.0
    return Control(throttle, steer, brake)


def _gps_plan(plan: GlobalPlan) -> list[tuple[dict[str, float], Any]]:
    """Return `({"lat": ..., "lon": ..., "z": 0.0}, RoadOption)` for every point of the dense plan, degrees."""
    options = _options()
    return [
        ({"lat": point.latitude_deg, "lon": point.longitude_deg, "z": 0.0}, options(int(point.command)))
        for point in _points(plan)
    ]


def _world_plan(plan: GlobalPlan) -> list[tuple[Any, Any]]:
    """Return `(carla.Transform, RoadOption)` for every point of the dense plan, each turned to the next one."""
    carla: Any = importlib.import_module("carla")
    options = _options()
    points = _points(plan)
    found: list[tuple[Any, Any]] = []
    for number, point in enumerate(points):
        here, there = (point, points[number + 1]) if number + 1 < len(points) else (points[max(number - 1, 0)], point)
        yaw_deg = math.degrees(math.atan2(there.y_m - here.y_m, there.x_m - here.x_m))
        place = carla.Location(x=point.x_m, y=point.y_m, z=0.0)
        turned = carla.Rotation(pitch=0.0, yaw=yaw_deg, roll=0.0)
        found.append((carla.Transform(place, turned), options(int(point.command))))
    return found


def _points(plan: GlobalPlan) -> tuple[PlanPoint, ...]:
    return plan.dense or plan.points


def _options() -> Any:
    """Return CARLA's own enumeration where its Python API is there, else ours: agents compare with what they import."""
    return importlib.import_module("agents.navigation.local_planner").RoadOption
