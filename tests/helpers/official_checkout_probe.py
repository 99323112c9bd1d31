"""Run by the Python of a CARLA client: the injection around the real classes of a checkout, on a recorded stream.

    python official_checkout_probe.py INJECT.py OUT.pickle < JOB.pickle

The job holds the stream, the route and what the environment asks for; out comes what agent and car got.
"""

from __future__ import annotations

import importlib.util
import pickle
import sys
from types import ModuleType, SimpleNamespace

FIRST_FRAME = 700


def load(path: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location("inject", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def main(inject_path: str, out: str) -> None:
    job = pickle.load(sys.stdin.buffer)
    import carla
    from leaderboard.autoagents.agent_wrapper import AgentWrapper
    from leaderboard.autoagents.autonomous_agent import AutonomousAgent
    from leaderboard.envs.sensor_interface import CallBack, GenericMeasurement
    from leaderboard.scenarios.scenario_manager import ScenarioManager
    from srunner.scenariomanager.carla_data_provider import CarlaDataProvider
    from srunner.scenariomanager.timer import GameTime

    load(inject_path).seams.install(job["environ"])
    world = SimpleNamespace(get_spectator=lambda: None, get_actors=list, tick=lambda: None)
    CarlaDataProvider.get_world = staticmethod(lambda: world)
    given = []

    class Recording(AutonomousAgent):
        def run_step(self, input_data, timestamp):  # type: ignore[no-untyped-def]
            assert {frame for frame, _ in input_data.values()} == {GameTime.get_frame()}
            given.append({tag: payload for tag, (_, payload) in input_data.items()})
            control = carla.VehicleControl()
            control.throttle, control.steer, control.brake = job["commands"][len(given) - 1]
            return control

    agent = Recording("localhost", 2000)
    types = {"GPS": "sensor.other.gnss", "IMU": "sensor.other.imu", "SPEED": "sensor.speedometer"}
    callbacks = {
        tag: CallBack(tag, types.get(tag, "sensor.camera.rgb"), None, agent.sensor_interface)
        for tag in job["stream"][0]
    }
    AgentWrapper.setup_sensors = lambda self, vehicle: None
    manager = ScenarioManager.__new__(ScenarioManager)
    config = SimpleNamespace(name="RouteScenario_" + job["route"])
    scenario = SimpleNamespace(config=config, scenario_tree=None, ego_vehicles=[None], other_actors=[])
    manager.load_scenario(scenario, agent, 0, 0)
    applied, asked = [], []
    for tick, payloads in enumerate(job["stream"]):
        now = SimpleNamespace(frame=FIRST_FRAME + tick, delta_seconds=0.05, elapsed_seconds=0.05 * (tick + 1))
        GameTime.on_carla_tick(now)
        for tag, payload in payloads.items():
            callbacks[tag]._parse_pseudosensor(GenericMeasurement(payload, FIRST_FRAME + tick), tag)
        before = len(given)
        control = manager._agent_wrapper()
        asked.append(len(given) > before)
        assert type(control) is carla.VehicleControl
        applied.append((control.throttle, control.steer, control.brake))
        control.throttle = 0.1
    with open(out, "wb") as file:
        pickle.dump({"given": given, "asked": asked, "applied": applied}, file)


if __name__ == "__main__":
    main(*sys.argv[1:])
