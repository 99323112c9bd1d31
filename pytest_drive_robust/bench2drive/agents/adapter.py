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
"""The defaults of the leaderboard's own options. Nothing listens there."""
_EPISODES = itertools.count()
_FIELDS = (("throttle", 0.0), ("steer", -1.0), ("brake", 0.0))

_STRAIGHT_PLAN = GlobalPlan(
    tuple(PlanPoint(x, 0.0, RoadOption.LANE_FOLLOW) for x in (0.0, 50.0, 100.0)),
    tuple(PlanPoint(float(x), 0.0, RoadOption.LANE_FOLLOW) for x in range(101)),
)
"""A plan of 100 m straight ahead, to set up an agent and read its sensors before there is a route."""


class OfficialAgent:
    """Makes an object of the agent's class for every episode, as the official evaluator does for every route.

    The order of calls is that of the evaluator: the class is called with host, port and debug; `set_global_plan`;
    `setup`; then `run_step` in every tick, and `destroy` before the next episode or at the end of the process. The
    constructor makes and destroys one more object, on a straight plan, to read the agent's sensors. Raises `UsageError`
    when that fails.

    `privileged` is True for an agent with a sensor that is computed from the ground truth (lidar, radar, map).
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
        """Destroy the agent object of the last episode; make and set up a new one for this episode.

        Raises `ValueError` when the new object has other sensors than before.
        """
        self._end()
        plan = hashlib.blake2b(repr(route.points).encode(), digest_size=6).hexdigest()
        self._world = HeroWorld()
        self._payloads = Payloads(self._rig, seed=seed, route=plan)
        if self._wake(route, plan) != self._rig:
            raise ValueError(f"sensors() of {self._name} gave other sensors than before, expected the same every time")

    def act(self, observation: Observation) -> Control:
        """Return the control of one `run_step`. Raises as `control_of` does."""
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
    """Return the argument of `setup`. With `IS_BENCH2DRIVE` set, a name to save under follows, as officially."""
    if not os.environ.get("IS_BENCH2DRIVE"):
        return given
    return f"{given}+drive_robust_{route}_{os.getpid()}_{next(_EPISODES)}"


def _quietly(destroy: Callable[[], object]) -> None:
    """Call `destroy` and print its error: the last episode is over and scored, so the error counts in no episode."""
    try:
        destroy()
    except (Exception, SystemExit) as error:
        print(f"drive-robust: destroy() of the agent raised {type(error).__name__}: {error}")


def control_of(command: object) -> Control:
    """Return a CARLA command as a `Control`, clipped to its ranges as in CARLA.

    The hand brake becomes a full brake without throttle. NaN stays NaN, so that the episode loop reports the error.
    Raises `TypeError` for a command without numbers, and `ValueError` for the reverse gear, which our vehicle lacks.
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
    """Return `({"lat": ..., "lon": ..., "z": 0.0}, RoadOption)` for every point of the dense plan, in degrees."""
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
    """Return CARLA's own enumeration where CARLA is installed, else ours: agents compare with the one they import."""
    return importlib.import_module("agents.navigation.local_planner").RoadOption
