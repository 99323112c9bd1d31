"""Wrap the two methods of a checkout that read the sensors and run the agent, and two that begin and end a route."""

from __future__ import annotations

import atexit
import importlib
import inspect
import os
from collections.abc import Callable, Mapping
from typing import Any

from pytest_drive_robust.bench2drive.evaluator.injection.injector import Injector
from pytest_drive_robust.bench2drive.evaluator.injection.plan import SettingRefusedError, plan_from

__all__ = ["install", "wrap"]

_MARK = "_pdr_original"


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
            raise injector.trouble("a ROS agent reads its sensors elsewhere: nothing can be injected")
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
