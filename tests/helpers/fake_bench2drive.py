"""Folders that behave like a Bench2Drive checkout and a CARLA, as far as a runner can see; a look for leftovers.

The configuration of the agent says what goes wrong: `ok`, `status:Failed - TickRuntime`, `segfault-once`, ...
"""

from __future__ import annotations

import os
import textwrap
from pathlib import Path

from pytest_drive_robust.domain.route import Route, ScenarioSpec, TriggerPoint, Waypoint
from pytest_drive_robust.simulators.embedded.route_xml import save_routes

MARK = "PDR_TEST_MARK"
ROUTES = ("101", "202", "303")

_EVALUATOR = """
import argparse, json, os, signal, subprocess, sys, time
from types import SimpleNamespace
import importlib
from leaderboard.autoagents.agent_wrapper import AgentWrapper
from leaderboard.scenarios.scenario_manager import ScenarioManager
from srunner.scenariomanager.timer import GameTime

parser = argparse.ArgumentParser()
for name in ("routes", "routes-subset", "track", "checkpoint", "debug-checkpoint", "agent", "agent-config", "record"):
    parser.add_argument("--" + name, default="")
for name in ("repetitions", "debug", "port", "traffic-manager-port", "traffic-manager-seed", "gpu-rank"):
    parser.add_argument("--" + name, type=int, default=0)
args = parser.parse_args()
open("leaderboard/data/weather.xml").close()  # by its place in the checkout
with open(os.environ["CARLA_ROOT"] + "/started", "a") as started:  # for tests: the routes that were started
    started.write(args.routes_subset + "\\n")
mode, _, detail = args.agent_config.partition(":")
if mode == "crash-in":
    mode = "crash" if detail == args.routes_subset else "ok"
server = subprocess.Popen(
    "{}/CarlaUE4.sh -RenderOffScreen -carla-rpc-port={}".format(os.environ["CARLA_ROOT"], args.port),
    shell=True, preexec_fn=os.setsid,
)
print("server", server.pid, flush=True)
if mode == "no-module":
    import a_module_that_is_not_there
marker = "_".join(part for part in args.checkpoint.split("/") if part != "work")
first = os.path.join(os.environ["SAVE_PATH"], "tried" + marker)
again = os.path.exists(first)
open(first, "w").close()

if mode == "segfault-once" and not again:
    os.kill(os.getpid(), signal.SIGSEGV)
if mode == "orphans":
    for _ in range(3):
        subprocess.Popen(["setsid", "sh", "-c", "trap '' TERM; (setsid sleep 600 &) ; sleep 600"])
if mode == "hang":
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    time.sleep(600)
if mode == "server-dies":
    time.sleep(4.0)  # until whoever looks twice a second has seen it
    os.killpg(server.pid, signal.SIGKILL)
    server.wait()
    while True:
        print("waiting", flush=True)
        time.sleep(0.2)

sys.path.insert(0, os.path.dirname(args.agent))
module = importlib.import_module(os.path.basename(args.agent)[:-3])
agent = getattr(module, module.get_entry_point())(args.agent_config)
wrapper = AgentWrapper(agent)
scenario = SimpleNamespace(config=SimpleNamespace(name="RouteScenario_" + args.routes_subset))
ScenarioManager().load_scenario(scenario, agent, 0, 0)
applied = []
for frame in range(50, 80):
    GameTime.frame = frame
    control = wrapper()
    applied.append([control.throttle, control.steer])
if mode != "no-cleanup":
    wrapper.cleanup()
with open(os.path.join(os.environ["SAVE_PATH"], "drive-%s.json" % args.routes_subset), "w") as file:
    told = {"applied": applied, "seen": agent.seen, "tm_seed": args.traffic_manager_seed, "env": dict(os.environ)}
    json.dump(told, file)

status = {"ok": "Completed", "status": detail, "crash": "Failed - Simulation crashed", "lost": "Failed - Agent crashed"}
status = status.get(mode, "Completed")
if mode == "full":
    status = "Failed - Agent crashed"
    print("Stopping the route, the agent has crashed:\\nOSError: [Errno 28] No space left on device: 'bev/0007.png'")
if mode == "lost":
    print("RuntimeError: time-out of 300000ms while waiting for the simulator, make sure the simulator is ready")
share = 100 if status in ("Completed", "Perfect") else 40
lists = [
    "collisions_layout", "collisions_pedestrian", "collisions_vehicle", "red_light", "stop_infraction",
    "outside_route_lanes", "min_speed_infractions", "yield_emergency_vehicle_infractions", "scenario_timeouts",
    "route_dev", "vehicle_blocked", "route_timeout",
]
record = {
    "index": 0, "route_id": "RouteScenario_%s_rep0" % args.routes_subset, "scenario_name": "Accident_1",
    "weather_id": "3", "save_name": "s", "town_name": "Town12", "status": status, "num_infractions": 0,
    "infractions": {name: [] for name in lists},
    "scores": {"score_route": share, "score_penalty": 1.0, "score_composed": share},
    "meta": {"route_length": 120.0, "duration_game": 1.5, "duration_system": 2.0},
}
with open(args.checkpoint, "w") as file:
    checkpoint = {"records": [record], "progress": [1, 1], "global_record": {}}
    text = json.dumps({"_checkpoint": checkpoint, "entry_status": "Finished"})
    file.write(text[:80] if mode == "half" else text)
if mode == "no-cleanup":
    os.killpg(server.pid, signal.SIGKILL)
    os._exit(0)
if mode in ("crash", "half"):
    sys.exit(-1)
os.killpg(server.pid, signal.SIGKILL)
"""

_SENSORS = """
import numpy as np

class SensorReceivedNoData(Exception):
    pass

class SensorInterface(object):
    def get_data(self, frame):
        rng = np.random.RandomState(frame)
        data = {
            "GPS": (frame, np.array([0.001 * rng.rand(), 0.002, 3.0])),
            "SPEED": (frame, {"speed": 4.0 + rng.rand()}),
            "CAM_FRONT": (frame, rng.randint(0, 256, (6, 9, 4)).astype(np.uint8)),
        }
        return {tag: item for tag, item in data.items() if tag in self.registered}
"""

_WRAPPER = """
class AgentWrapper(object):
    def __init__(self, agent):
        self._agent = agent

    def __call__(self):
        return self._agent()

    def cleanup(self):
        pass
"""

_MANAGER = """
class ScenarioManager(object):
    def load_scenario(self, scenario, agent, route_index, rep_number):
        tick_cap = 4000
"""

_TIMER = """
class GameTime(object):
    frame = 0

    @staticmethod
    def get_frame():
        return GameTime.frame
"""

_AGENT = """
from leaderboard.envs.sensor_interface import SensorInterface
from srunner.scenariomanager.timer import GameTime

def get_entry_point():
    return "Agent"

class Control(object):
    throttle = steer = brake = 0.0
    hand_brake = reverse = False

class Agent(object):
    def __init__(self, config):
        self.sensor_interface = SensorInterface()
        self.sensor_interface.registered = ["GPS", "SPEED"] if config == "no-camera" else ["GPS", "SPEED", "CAM_FRONT"]
        self.looks_elsewhere = config == "looks-elsewhere"
        self.seen = []

    def sensors(self):
        types = {"GPS": "sensor.other.gnss", "SPEED": "sensor.speedometer", "CAM_FRONT": "sensor.camera.rgb"}
        return [{"type": types[tag], "id": tag} for tag in self.sensor_interface.registered]

    def __call__(self):
        if self.looks_elsewhere:
            return Control()
        data = self.sensor_interface.get_data(GameTime.get_frame())
        pixels = data["CAM_FRONT"][1].tolist() if "CAM_FRONT" in data else []
        self.seen.append([list(data["GPS"][1]), data["SPEED"][1]["speed"], pixels])
        control = Control()
        control.throttle = (GameTime.get_frame() - 49) / 100.0
        return control
"""


def make(folder: Path) -> tuple[Path, Path, Path]:
    """Write (checkout, CARLA, agent file) below `folder`."""
    root, carla, agent = folder / "b2d", folder / "carla", folder / "own_agent.py"
    files = {
        "leaderboard/leaderboard/__init__.py": "",
        "leaderboard/leaderboard/leaderboard_evaluator.py": _EVALUATOR,
        "leaderboard/leaderboard/envs/sensor_interface.py": _SENSORS,
        "leaderboard/leaderboard/autoagents/agent_wrapper.py": _WRAPPER,
        "leaderboard/leaderboard/scenarios/scenario_manager.py": _MANAGER,
        "leaderboard/data/weather.xml": "<weathers/>",
        "scenario_runner/srunner/scenariomanager/timer.py": _TIMER,
    }
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(textwrap.dedent(text))
    agent.write_text(_AGENT)
    carla.mkdir()
    (carla / "VERSION").write_text("0.9.15\n")
    server = carla / "CarlaUE4.sh"
    server.write_text("#!/bin/sh\nsleep 600\n")
    server.chmod(0o755)
    waypoints = tuple(Waypoint(2.0 * number, 0.0) for number in range(20))
    scenario = ScenarioSpec("Accident_1", "Accident", TriggerPoint(8.0, 0.0, 0.0, 0.0))
    save_routes(
        [Route(name, "Town12", waypoints, scenario) for name in ROUTES], root / "leaderboard/data/bench2drive220.xml"
    )
    return root, carla, agent


def left_behind(mark: str) -> list[str]:
    """Return the command lines of living processes that inherited the mark, ourselves excepted."""
    found = []
    for entry in Path("/proc").iterdir():
        if not entry.name.isdecimal() or int(entry.name) == os.getpid():
            continue
        try:
            if f"{MARK}={mark}".encode() in (entry / "environ").read_bytes():
                found.append((entry / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace"))
        except OSError:
            continue
    return found
