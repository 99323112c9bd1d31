"""The failures of the route that is being driven, tick by tick."""

from __future__ import annotations

import dataclasses
import json
import os
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from pytest_drive_robust.bench2drive.evaluator.injection.commands import copied, neutral_like
from pytest_drive_robust.bench2drive.evaluator.injection.payloads import SensedTick, cameras_of
from pytest_drive_robust.bench2drive.evaluator.injection.plan import InjectionPlan
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.perturbations import RunningStack
from pytest_drive_robust.runner.episode.witness import Witness

__all__ = ["Injector"]


class Injector:
    """The failures of the route that is being driven. `trouble` is the exception to raise for our own errors.

    `sensors` is the agent's method that lists its sensors, called once for each route.
    """

    def __init__(self, plan: InjectionPlan, trouble: type[Exception] = RuntimeError) -> None:
        self.plan = plan
        self.sensors: Callable[[], Iterable[Mapping[str, Any]]] = tuple
        self.trouble = trouble
        self._frame: Any = None
        self._given: dict[str, Any] | None = None
        self._reading_s = 0.0
        self._begin_fresh("", 0)
        self._begun = False

    def begin(self, route: str, repetition: int) -> None:
        """Begin a route: end the last one and forget its state."""
        self.end()
        self._begin_fresh(route, repetition)

    def end(self) -> None:
        """End a route: write its line of the log. A second call does nothing."""
        if not self._begun:
            return
        self._begun = False
        if self.plan.log:
            with open(self.plan.log, "a") as file:
                file.write(json.dumps(self._line()) + "\n")

    def data(self, read: Callable[[], dict[str, Any]], frame: Any) -> dict[str, Any]:
        """Return the perturbed result of `get_data`; call `read`, the original method, once per tick."""
        if self._in_call:
            known = self._given is not None
        else:
            known = self._given is not None and frame is not None and frame == self._frame
            if not known:
                self._next_tick()
        if not known:
            asked_s = time.perf_counter()
            raw = read()
            self._frame = frame
            try:
                self._given = self._perturbed(raw)
            except Exception as error:
                raise self.trouble(f"the injection failed: {error!r}") from error
            self._injected_ticks += self.plan.observes and not self._only_looks
            self._reading_s += time.perf_counter() - asked_s
        assert self._given is not None
        return dict(self._given)

    def step(self, call: Callable[[], Any], look: Callable[[], Any]) -> Any:
        """Return the command of one tick. `call` runs the agent; `look` reads the sensors while the agent is busy."""
        self._next_tick()
        self._in_call = True
        control, inference_s = None, 0.0
        try:
            if not self.plan.is_late or self._stack().wants_inference(self._tick):
                asked_s = time.perf_counter()
                control = call()
                inference_s = max(0.0, time.perf_counter() - asked_s - self._reading_s)
            else:
                self._only_looks = True
                look()
        finally:
            self._in_call = self._only_looks = False
        return self._due(control, inference_s) if self.plan.is_late else control

    def _begin_fresh(self, route: str, repetition: int) -> None:
        self._route, self._repetition = route, repetition
        self._running: RunningStack | None = None
        self._past: dict[int, SensedTick] = {}
        self._witness: Witness | None = None
        self._tick = -1
        self._injected_ticks = 0
        self._frame = None
        self._given = None
        self._reading_s = 0.0
        self._in_call = self._only_looks = False
        self._seen: Any = None
        self._begun = True

    def _next_tick(self) -> None:
        if not self._begun:
            self._begin_fresh(os.environ.get("PDR_ROUTE", ""), 0)
        self._tick += 1
        self._given = None
        self._reading_s = 0.0

    def _perturbed(self, raw: Mapping[str, Any]) -> dict[str, Any]:
        if not self.plan.observes:
            return dict(raw)
        sensed = SensedTick.read(self._tick, {tag: payload for tag, (_, payload) in raw.items()})
        # without images: a perturbation that delays images keeps its own
        self._past[self._tick] = SensedTick({}, sensed.ego, dataclasses.replace(sensed.observation, cameras={}))
        given = self._stack().observe(sensed.observation)
        if self._witness is None:
            self._witness = Witness(tuple(sensed.cameras), sensed.consumes)
        self._witness.seen(sensed.observation, given)
        found = sensed.written(given, self._past)
        return {tag: (item[0], found.get(tag, item[1])) for tag, item in raw.items()}

    def _due(self, control: Any, inference_s: float) -> Any:
        try:
            if control is not None:
                self._seen = control = copied(control)
            due = self._stack().actuate(self._tick, control, inference_s)
            self._injected_ticks += not self.plan.observes
            return neutral_like(self._seen) if due is Control.NEUTRAL else copied(due)
        except Exception as error:
            raise self.trouble(f"the injection failed: {error!r}") from error

    def _stack(self) -> RunningStack:
        """Return the running setting. It starts with the first tick, when the agent can list its cameras."""
        if self._running is None:
            rig = cameras_of(self.sensors()) if self.plan.observes else ()
            self._running = self.plan.started(self._route, self._repetition, rig)
        return self._running

    def _line(self) -> dict[str, Any]:
        """Return the route's log entry. `injected_ticks` counts ticks with perturbed signals or a delayed command."""
        stack = self._stack()
        return {
            "route": self._route,
            "repetition": self._repetition,
            "seed": self.plan.seed + self._repetition,
            "setting": self.plan.told,
            "dt_s": self.plan.dt_s,
            "ticks": self._tick + 1,
            "injected_ticks": self._injected_ticks,
            "schedule": [list(dataclasses.astuple(stretch)) for stretch in stack.schedule()],
            "inference_s": list(stack.inference_s),
            "reception": self._reception(),
        }

    def _reception(self) -> dict[str, Any] | None:
        """Return which signals reached the agent changed; None without such failures, or with a latency as well."""
        if self._witness is None or self.plan.is_late:
            return None
        told = dataclasses.asdict(self._witness.reception())
        there = {*told["cameras"], *told["consumes"]}
        return {**told, "touched": [touch for touch in told["touched"] if touch["signal"] in there]}
