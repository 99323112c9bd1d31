"""Agents for tests: `ScriptedAgent` drives by a script, `RecordingAgent` records another agent."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence

from pytest_drive_robust.domain.agent import SIGNALS, Agent, consumed_signals, is_privileged
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.route import GlobalPlan


class ScriptedAgent:
    """Drives by a script: a function of the observation, or a list of controls whose last one holds to the end.

    >>> ScriptedAgent([Control(throttle=1.0)]).sensors()
    ()
    """

    def __init__(
        self,
        script: Callable[[Observation], Control] | Sequence[Control],
        *,
        cameras: Iterable[CameraSpec] = (),
        consumes: Iterable[str] = SIGNALS,
        privileged: bool = False,
    ) -> None:
        if not callable(script) and not script:
            raise ValueError("an empty script cannot drive: give at least one Control")
        self._script = script
        self._cameras = tuple(cameras)
        self._calls = 0
        self.consumes = frozenset(consumes)
        self.privileged = privileged

    def sensors(self) -> tuple[CameraSpec, ...]:
        """Return the cameras given at construction."""
        return self._cameras

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Go back to the first line of the script."""
        self._calls = 0

    def act(self, observation: Observation) -> Control:
        """Return the next line of the script."""
        if callable(self._script):
            return self._script(observation)
        control = self._script[min(self._calls, len(self._script) - 1)]
        self._calls += 1
        return control


class RecordingAgent:
    """Passes every call on to `agent` and keeps what went in and out since the last `reset`.

    `observations` are private copies, made before the agent can write to the originals. `controls` are the results of
    `act`, `acts_s` the wall seconds of each call.
    """

    def __init__(self, agent: Agent) -> None:
        self.agent = agent
        self.consumes = consumed_signals(agent)
        self.privileged = is_privileged(agent)
        self.plan: GlobalPlan | None = None
        self.seed: int | None = None
        self.resets = 0
        self.observations: list[Observation] = []
        self.controls: list[Control] = []
        self.acts_s: list[float] = []

    def sensors(self) -> Sequence[CameraSpec]:
        """Return the cameras of the recorded agent."""
        return self.agent.sensors()

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Begin a new recording."""
        self.plan, self.seed = route, seed
        self.resets += 1
        self.observations, self.controls, self.acts_s = [], [], []
        self.agent.reset(route, seed)

    def act(self, observation: Observation) -> Control:
        """Return the recorded agent's control; record the observation, the control and the wall time."""
        self.observations.append(observation.private())
        started_s = time.perf_counter()
        control = self.agent.act(observation)
        self.acts_s.append(time.perf_counter() - started_s)
        self.controls.append(control)
        return control
