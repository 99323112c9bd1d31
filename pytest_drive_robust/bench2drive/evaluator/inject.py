"""Our perturbations inside an official Bench2Drive evaluation, without a change to any of its files.

Started by its path, with the Python of the evaluator (3.7 or later, numpy 1.17 or later)::

    PDR_SETTING='{"seed": 0, "stack": [...]}' python inject.py .../leaderboard_evaluator.py --routes=... --agent=...

it wraps two methods of the checkout that is on the path, then runs the evaluator as if it had been started directly:

* `SensorInterface.get_data`: what it returns is perturbed, once per tick, however often it is called;
* `AgentWrapper.__call__`: while a latency keeps the agent's computer busy the agent is not called, and the command that
  is due reaches the vehicle.

`ScenarioManager.load_scenario` tells which route begins: everything is seeded and cleared there. What perturbs is the
package itself, found beside this file: its room `perturbations` needs nothing but the standard library and numpy. So
the same images and measurements come out the same to the last bit as in the embedded simulator.

=================== ==================================================================================================
variable            meaning
=================== ==================================================================================================
`PDR_SETTING`       JSON: `seed`, `stack` (a list of `name` and `parameters`), and if wanted `dt_s` (0.05), `setting`
                    (the sentence, for the log) and `log`. `setting_as_json` of the package writes it.
`PDR_LOG`           a file that gets one line of JSON for each route: what was injected, and in which ticks
`PDR_ROUTE`         the name of the route where no `ScenarioManager` tells it
=================== ==================================================================================================

Without `PDR_SETTING` the variables of the paper's released code decide (`ROBUSTNESS_ENABLE`, `GPS_NOISE_STD`, ...), and
`ROBUSTNESS_SEED` is the seed. A repetition of a route adds its number to the seed.

Payloads are known by their form: uint8 (height, width, 4) is a camera, three numbers are a GNSS fix, seven an IMU, a
mapping with `speed` the speedometer, of which the leaderboard allows one each; lidar, radar and maps stay as they are.
So does the debug camera `bev`, which agents save and do not look at. Frame numbers stay those of the tick, also on a
stale image. What goes wrong here ends a route as "Simulation crashed": it is never counted against the agent.
"""

from __future__ import annotations

import atexit
import copy
import dataclasses
import importlib
import importlib.util
import inspect
import json
import math
import os
import runpy
import sys
import time
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

DEBUG_CAMERAS = ("bev",)
DT_S = 0.05
REFUSED = 78
"""Exit code when the setting cannot be used: the configuration error of sysexits.h."""
_MARK = "_pdr_original"


class SettingRefusedError(Exception):
    """The environment asks for something that cannot be injected."""


# --- the package, in a Python that is older than the one that it is written for ---


@contextmanager
def _like_later_pythons() -> Iterator[None]:
    """Let our modules be imported: what older versions lack is memory of dataclasses and names for type checkers."""
    own = vars(typing).copy(), dataclasses.dataclass

    def dataclass(cls: Any = None, *, slots: bool = False, **options: Any) -> Any:
        return own[1](cls, **options) if cls is not None else own[1](**options)

    class Annotation:
        def __class_getitem__(cls, item: Any) -> Any:
            return cls

    if sys.version_info < (3, 10):  # noqa: UP036 - this file runs in older ones
        dataclasses.dataclass = dataclass
        for name in {"Literal", "Protocol"} - set(own[0]):
            setattr(typing, name, Annotation)
    try:
        yield
    finally:
        dataclasses.dataclass = own[1]
        for name in set(vars(typing)) - set(own[0]):
            delattr(typing, name)


def _import_ours(*names: str) -> Any:
    """Return modules of the package that this file belongs to, wherever it lies and whatever else is installed."""
    folder = Path(__file__).resolve().parents[2]
    package = folder.name
    if package not in sys.modules:
        found: Any = importlib.util.spec_from_file_location(
            package, str(folder / "__init__.py"), submodule_search_locations=[str(folder)]
        )
        sys.modules[package] = importlib.util.module_from_spec(found)
        found.loader.exec_module(sys.modules[package])
    with _like_later_pythons():
        return [importlib.import_module(package + "." + name) for name in names]


domain, geodesy, scalars, errors, perturbations = _import_ours(
    "domain.observation", "domain.geodesy", "arithmetic.scalars", "errors", "perturbations"
)
_NEUTRAL = _import_ours("domain.control")[0].Control.NEUTRAL


# --- what the sensors say ---


def cameras_of(sensors: Iterable[Mapping[str, Any]]) -> list[Any]:
    """Return the rig: the draws for a camera are asked by its place among the cameras of the agent, not by its id."""
    found = [str(sensor["id"]) for sensor in sensors if str(sensor["type"]).startswith("sensor.camera.")]
    return [domain.CameraSpec(tag) for tag in found]


def kind_of(payload: Any) -> str:
    """Return `camera`, `gps`, `imu`, `speed`, or nothing for what is never perturbed."""
    if isinstance(payload, np.ndarray):
        if payload.ndim == 3 and payload.dtype == np.uint8:
            return "camera"
        if payload.ndim == 1:
            return {3: "gps", 7: "imu"}.get(len(payload), "")
    elif isinstance(payload, Mapping) and "speed" in payload:
        return "speed"
    return ""


def _own(payload: Any) -> Any:
    return payload.copy() if isinstance(payload, np.ndarray) else copy.deepcopy(payload)


class SensedTick(NamedTuple):
    """The perturbed part of one tick: payloads by tag, a copy of what is no image, and what of it is perturbed."""

    cameras: Mapping[str, Any]
    ego: Mapping[str, Any]
    observation: Any

    @classmethod
    def read(cls, tick: int, payloads: Mapping[str, Any]) -> SensedTick:
        """Read the payloads of a tick. Positions are in metres on the ground, which Mercator stretches."""
        kinds = {tag: "" if tag in DEBUG_CAMERAS else kind_of(item) for tag, item in sorted(payloads.items())}
        cameras = {tag: payloads[tag] for tag, kind in kinds.items() if kind == "camera"}
        ego = {tag: _own(payloads[tag]) for tag, kind in kinds.items() if kind in ("gps", "imu", "speed")}
        x_m = y_m = speed_mps = 0.0
        for payload in ego.values():
            if kind_of(payload) == "gps":
                x_m, y_m = (metres / _stretch(payload) for metres in geodesy.to_metric(*map(float, payload[:2])))
            elif kind_of(payload) == "speed":
                speed_mps = payload["speed"]
        observation = domain.Observation(
            tick=tick,
            gps=domain.Gps(x_m, y_m, tick),
            compass=domain.Compass(0.0, tick),
            imu=domain.Imu(0.0, 0.0, 0.0, tick),
            speed=domain.Speed(speed_mps, tick),
            cameras={tag: domain.Image(pixels[:, :, :3], tick) for tag, pixels in cameras.items()},
        )
        return cls(cameras, ego, observation)

    def written(self, given: Any, past: Mapping[int, SensedTick]) -> dict[str, Any]:
        """Return the payloads that are not those of this tick; `past` are earlier ticks, and this one."""
        found = {}
        for tag, image in given.cameras.items():
            if tag in self.cameras and image is not self.observation.cameras[tag]:
                found[tag] = self.cameras[tag].copy()
                found[tag][:, :, :3] = image.pixels  # the fourth channel stays
        for tag, payload in self.ego.items():
            kind = kind_of(payload)
            signal = getattr(given, kind)
            if signal is getattr(self.observation, kind):
                continue
            captured = past[signal.tick]
            stale = _own(captured.ego.get(tag, payload))
            if kind == "gps" and signal != captured.observation.gps:
                stretch = _stretch(stale)
                stale[0], stale[1] = geodesy.to_geodetic(signal.x_m * stretch, signal.y_m * stretch)
            found[tag] = dict(stale, speed=signal.mps) if kind == "speed" else stale
        return found


def _stretch(fix: Any) -> float:
    """Mercator metres of a metre on the ground: 1 at the equator, where nearly all towns are."""
    latitude = float(fix[0])
    return 1.0 if abs(latitude) < 1.0 else 1.0 / scalars.cos(math.radians(latitude))


# --- commands ---

_FIELDS = ("throttle", "steer", "brake", "hand_brake", "reverse", "manual_gear_shift", "gear")


def copied(control: Any) -> Any:
    """Return a command of its own: agents and scenarios change theirs in place."""
    try:
        made = type(control)()
    except TypeError:
        return copy.copy(control)
    for name in _FIELDS:
        if hasattr(control, name):
            setattr(made, name, getattr(control, name))
    return made


def neutral_like(control: Any) -> Any:
    """Return no throttle, no steering, no brake; of the class of `control`, or CARLA's when there was none yet."""
    made = importlib.import_module("carla").VehicleControl() if control is None else copied(control)
    made.throttle = made.steer = made.brake = 0.0
    made.hand_brake = made.reverse = False
    return made


# --- what to inject ---


class InjectionPlan(NamedTuple):
    """What the environment asks for: a `Setting` of the package, its sentence `told`, the base seed."""

    setting: Any
    seed: int
    dt_s: float
    told: str
    log: str

    def started(self, route: str, repetition: int, rig: Iterable[Any]) -> Any:
        """Return the setting at work on one route."""
        return self.setting.start(route_id=route, seed=self.seed + repetition, dt_s=self.dt_s, cameras=tuple(rig))

    @property
    def is_late(self) -> bool:
        """True when commands come late."""
        latency = perturbations.InferenceLatency
        return any(isinstance(item, latency) for item in self.setting.perturbations)

    @property
    def observes(self) -> bool:
        """True when anything that the agent is given changes."""
        latency = perturbations.InferenceLatency
        return not all(isinstance(item, latency) for item in self.setting.perturbations)


def plan_from(environ: Mapping[str, str]) -> InjectionPlan:
    """Return the plan of an environment. Raises `SettingRefusedError`, also for a severity that cannot be."""
    text = environ.get("PDR_SETTING", "").strip()
    try:
        plan = _plan_of_document(text, environ) if text else _plan_of_variables(environ)
        plan.started("", 0, ())
    except errors.UsageError as error:
        raise SettingRefusedError(str(error)) from None
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise SettingRefusedError(f"PDR_SETTING is no setting ({error!r}): {text:.200}") from None
    return plan


def _plan_of_document(text: str, environ: Mapping[str, str]) -> InjectionPlan:
    document = json.loads(text)
    stack = []
    for item in document["stack"]:
        if item["name"] not in perturbations.BUILTIN:
            known = ", ".join(sorted(perturbations.BUILTIN))
            raise SettingRefusedError("no perturbation {!r}; known: {}".format(item["name"], known))
        stack.append(perturbations.BUILTIN[item["name"]](**item.get("parameters", {})))
    log = environ.get("PDR_LOG", "") or str(document.get("log", ""))
    seed, dt_s = int(document.get("seed", 0)), float(document.get("dt_s", DT_S))
    return InjectionPlan(perturbations.Setting.of(*stack), seed, dt_s, str(document.get("setting", "")), log)


def _plan_of_variables(environ: Mapping[str, str]) -> InjectionPlan:
    """Return the plan of the released code's variables. One of them is the seed here: no option says another."""
    text = environ.get("ROBUSTNESS_SEED", "").strip()
    if text and not text.lstrip("+-").isdecimal():
        raise SettingRefusedError(f"ROBUSTNESS_SEED is {text!r}, expected a whole number")
    setting = perturbations.Setting.from_env({**environ, "ROBUSTNESS_SEED": ""})
    told = "clean" if setting.is_clean else "variables of the released code"
    return InjectionPlan(setting, int(text or 0), DT_S, told, environ.get("PDR_LOG", ""))


# --- at the seams of the evaluator ---


class Injector:
    """The failures of the route that is being driven. `trouble` is the exception that stands for our own mistakes.

    `sensors` is the method of the agent that lists its sensors; it is asked once for each route.
    """

    def __init__(self, plan: InjectionPlan, trouble: type[Exception] = RuntimeError) -> None:
        self.plan = plan
        self.sensors: Callable[[], Iterable[Mapping[str, Any]]] = tuple
        self._trouble = trouble
        self._frame: Any = None
        self._given: dict[str, Any] | None = None
        self._reading_s = 0.0
        self._begin_fresh("", 0)
        self._begun = False

    def begin(self, route: str, repetition: int) -> None:
        """Begin a route: everything about the last one is forgotten."""
        self.end()
        self._begin_fresh(route, repetition)

    def end(self) -> None:
        """End a route: its line of the log is written. Calling it twice does no harm."""
        if not self._begun:
            return
        self._begun = False
        if self.plan.log:
            with open(self.plan.log, "a") as file:
                file.write(json.dumps(self._line()) + "\n")

    def data(self, read: Callable[[], dict[str, Any]], frame: Any) -> dict[str, Any]:
        """Return what `get_data` returns: `read` is asked once per tick."""
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
                raise self._trouble(f"the injection failed: {error!r}") from error
            self._reading_s += time.perf_counter() - asked_s
        assert self._given is not None
        return dict(self._given)

    def step(self, call: Callable[[], Any], look: Callable[[], Any]) -> Any:
        """Drive one tick: `call` asks the agent, `look` only reads the sensors, for a tick in which it is not asked."""
        self._next_tick()
        self._in_call = True
        control, inference_s = None, 0.0
        try:
            if not self.plan.is_late or self._stack().wants_inference(self._tick):
                asked_s = time.perf_counter()
                control = call()
                inference_s = max(0.0, time.perf_counter() - asked_s - self._reading_s)
            else:
                look()
        finally:
            self._in_call = False
        return self._due(control, inference_s) if self.plan.is_late else control

    def _begin_fresh(self, route: str, repetition: int) -> None:
        self._route, self._repetition = route, repetition
        self._running: Any = None
        self._past: dict[int, SensedTick] = {}
        self._tick = -1
        self._frame = None
        self._given = None
        self._reading_s = 0.0
        self._in_call = False
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
        # images are kept by who delays them
        self._past[self._tick] = SensedTick({}, sensed.ego, dataclasses.replace(sensed.observation, cameras={}))
        found = sensed.written(self._stack().observe(sensed.observation), self._past)
        return {tag: (item[0], found.get(tag, item[1])) for tag, item in raw.items()}

    def _due(self, control: Any, inference_s: float) -> Any:
        try:
            if control is not None:
                self._seen = control = copied(control)
            due = self._stack().actuate(self._tick, control, inference_s)
            return neutral_like(self._seen) if due is _NEUTRAL else copied(due)
        except Exception as error:
            raise self._trouble(f"the injection failed: {error!r}") from error

    def _stack(self) -> Any:
        """Return the setting at work. It begins with the first tick, when the agent can be asked for its cameras."""
        if self._running is None:
            rig = cameras_of(self.sensors()) if self.plan.observes else ()
            self._running = self.plan.started(self._route, self._repetition, rig)
        return self._running

    def _line(self) -> dict[str, Any]:
        stack = self._stack()
        return {
            "route": self._route,
            "repetition": self._repetition,
            "seed": self.plan.seed + self._repetition,
            "setting": self.plan.told,
            "dt_s": self.plan.dt_s,
            "ticks": self._tick + 1,
            "schedule": [list(dataclasses.astuple(stretch)) for stretch in stack.schedule()],
            "inference_s": list(stack.inference_s),
        }


def wrap(
    injector: Injector, interface: type[Any], wrapper: type[Any], manager: Any, frame_now: Callable[[], int]
) -> None:
    """Put the injector between the classes of a checkout. `frame_now` gives the number of the current frame.

    Raises `SettingRefusedError` when they are wrapped already.
    """
    if hasattr(interface, _MARK):
        raise SettingRefusedError("this evaluator is already wrapped")
    get_data, call, cleanup = interface.get_data, wrapper.__call__, wrapper.cleanup
    takes_frame = len(inspect.signature(get_data).parameters) > 1

    def given_data(self: Any, *frame: Any) -> dict[str, Any]:
        return injector.data(lambda: get_data(self, *frame), frame[0] if frame else None)

    def given_control(self: Any) -> Any:
        agent = self._agent
        if "ROS" in type(self).__name__ and not injector.plan.setting.is_clean:
            raise injector._trouble("a ROS agent reads its sensors elsewhere: nothing can be injected")
        injector.sensors = getattr(agent, "sensors", tuple)
        frame = (frame_now(),) if takes_frame else ()
        return injector.step(lambda: call(self), lambda: agent.sensor_interface.get_data(*frame))

    def cleaned_up(self: Any) -> Any:
        injector.end()
        return cleanup(self)

    setattr(interface, _MARK, get_data)
    interface.get_data, wrapper.__call__, wrapper.cleanup = given_data, given_control, cleaned_up
    if manager is not None:
        load_scenario = manager.load_scenario

        def begun(self: Any, scenario: Any, agent: Any, route_index: Any, rep_number: int = 0) -> Any:
            injector.begin(route_of(scenario, route_index), rep_number)
            return load_scenario(self, scenario, agent, route_index, rep_number)

        manager.load_scenario = begun


def route_of(scenario: Any, route_index: Any) -> str:
    """Return the id of a route scenario: `2091` of `RouteScenario_2091`."""
    name = str(getattr(getattr(scenario, "config", None), "name", route_index))
    prefix = "RouteScenario_"
    return name[len(prefix) :] if name.startswith(prefix) else name


def install(environ: Mapping[str, str] = os.environ) -> Injector:
    """Wrap the leaderboard that is on the path. Raises `SettingRefusedError`."""
    plan = plan_from(environ)
    sensors = importlib.import_module("leaderboard.envs.sensor_interface")
    agents = importlib.import_module("leaderboard.autoagents.agent_wrapper")
    managers = importlib.import_module("leaderboard.scenarios.scenario_manager")
    timer = importlib.import_module("srunner.scenariomanager.timer")
    # The evaluator takes this exception, alone of all, for a fault that is not the agent's.
    trouble = type("InjectionError", (sensors.SensorReceivedNoData,), {})
    injector = Injector(plan, trouble)
    wrap(injector, sensors.SensorInterface, agents.AgentWrapper, managers.ScenarioManager, timer.GameTime.get_frame)
    atexit.register(injector.end)
    print(f"drive-robust: injecting {plan.told} with seed {plan.seed}", flush=True)
    return injector


def main(arguments: list[str]) -> None:
    """Run an evaluator with the injection: `inject.py EVALUATOR.py [its arguments]`."""
    if not arguments:
        print("usage: inject.py LEADERBOARD_EVALUATOR.py [its arguments]", file=sys.stderr)
        sys.exit(REFUSED)
    evaluator = os.path.abspath(arguments[0])
    sys.argv = [evaluator, *list(arguments[1:])]
    sys.path[0] = os.path.dirname(evaluator)  # as if it had been started itself; our own folder has nothing for it
    try:
        install()
    except SettingRefusedError as error:
        print(f"drive-robust: {error}", file=sys.stderr, flush=True)
        sys.exit(REFUSED)
    runpy.run_path(evaluator, run_name="__main__")


if __name__ == "__main__":
    main(sys.argv[1:])
