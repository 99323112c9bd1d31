"""An agent of the leaderboard behind our `Agent` protocol."""

from __future__ import annotations

import hashlib
import itertools
import os
import weakref
from collections.abc import Callable, Sequence
from typing import Any

from pytest_drive_robust.bench2drive.agents.carla_world import SeenWorld, show_world
from pytest_drive_robust.bench2drive.agents.commands import control_of
from pytest_drive_robust.bench2drive.agents.official_rig import OfficialRig, read_rig
from pytest_drive_robust.bench2drive.agents.payloads import Payloads, frame_number, game_time_s
from pytest_drive_robust.bench2drive.agents.plans import STRAIGHT_PLAN, gps_plan, world_plan
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.route import GlobalPlan
from pytest_drive_robust.errors import DriveRobustError, UsageError

__all__ = ["OfficialAgent"]

_HOST, _PORT = "localhost", 2000
"""What the leaderboard's own options are when nobody says otherwise. Nothing listens there."""
_EPISODES = itertools.count()


class OfficialAgent:
    """Makes an object of the agent's class for every episode, as the official evaluator does for every route.

    The order of calls is that of the evaluator: the class is called with host, port and debug; `set_global_plan`;
    `setup`; then `run_step` in every tick, and `destroy` before the next episode or at the end of the process. One
    more object is made and destroyed at the start, on a straight plan, to know the agent's sensors.

    `privileged` agents are those with a sensor that is computed from the ground truth (lidar, radar, map), and those
    whose file imports `CarlaDataProvider`, through which everything can be read.
    """

    def __init__(self, cls: type, config: str, *, name: str, sees_world: bool = False) -> None:
        self._class = cls
        self._config = config
        self._name = name
        self._destroy: weakref.finalize[..., Any] | None = None
        self._agent: Any = None
        self._world = SeenWorld()
        try:
            self._rig = self._wake(STRAIGHT_PLAN, "sensors")
        except DriveRobustError:
            raise
        except (Exception, SystemExit) as error:
            raise UsageError(f"{name} cannot be set up: {type(error).__name__}: {error}") from error
        finally:
            self._end()
        self.privileged = sees_world or self._rig.needs_truth
        self.consumes = self._rig.consumes
        self._payloads = Payloads(self._rig, seed=0, route="")

    def sensors(self) -> Sequence[CameraSpec]:
        """Return the agent's cameras."""
        return self._rig.cameras

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Destroy the agent of the last episode, and make and set up that of this one."""
        self._end()
        plan = hashlib.blake2b(repr(route.points).encode(), digest_size=6).hexdigest()
        self._world = SeenWorld()
        self._payloads = Payloads(self._rig, seed=seed, route=plan)
        if self._wake(route, plan) != self._rig:
            raise ValueError(f"sensors() of {self._name} gave other sensors than before, expected the same every time")

    def act(self, observation: Observation) -> Control:
        """Run one `run_step`."""
        tick = observation.tick
        time_s = game_time_s(tick)
        self._world.update(observation)
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
        agent.set_global_plan(gps_plan(plan), world_plan(plan))
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
