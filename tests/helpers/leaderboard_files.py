"""Agent files as people write them for the leaderboard, and moments to show them."""

from __future__ import annotations

import numpy as np

from pytest_drive_robust.domain.observation import Compass, Gps, Image, Imu, Observation, Speed
from pytest_drive_robust.domain.truth import ActorKind, EgoState, GroundTruth, Lane, LaneKind, LaneMap, WorldState

AGENT = """
import carla
from leaderboard.autoagents import autonomous_agent
from leaderboard.autoagents.autonomous_agent import Track


def get_entry_point():
    return "NoisyAgent"


class NoisyAgent(autonomous_agent.AutonomousAgent):
    calls = []

    def setup(self, path_to_conf_file):
        self.track = Track.SENSORS
        self.config = path_to_conf_file
        self.seen = []
        self.calls.append(("setup", path_to_conf_file, len(self._global_plan)))

    def sensors(self):
        return [
            {"type": "sensor.camera.rgb", "x": 0.8, "y": 0.0, "z": 1.6, "roll": 0.0, "pitch": 0.0, "yaw": 0.0,
             "width": 64, "height": 32, "fov": 70, "id": "CAM_FRONT"},
            {"type": "sensor.other.gnss", "x": -1.4, "y": 0.0, "z": 0.0, "sensor_tick": 0.01, "id": "GPS"},
            {"type": "sensor.other.imu", "x": -1.4, "y": 0.0, "z": 0.0, "roll": 0.0, "pitch": 0.0, "yaw": 0.0,
             "id": "IMU"},
            {"type": "sensor.speedometer", "reading_frequency": 20, "id": "SPEED"},
        ]

    def run_step(self, input_data, timestamp):
        self.seen.append((input_data, timestamp))
        control = carla.VehicleControl()
        control.throttle = 0.5
        control.steer = -0.25
        return control

    def destroy(self):
        self.calls.append(("destroy", self.config))
"""


def observation(tick=0, *, x_m=0.0, y_m=0.0, yaw_rad=0.0, truth=None, cameras=("CAM_FRONT",)):
    """Return an observation at 6 m/s; its pictures are red at the left and blue at the right."""
    pixels = np.zeros((32, 64, 3), dtype=np.uint8)
    pixels[:, :32, 0], pixels[:, 32:, 2] = 200, 100
    return Observation(
        tick=tick,
        gps=Gps(x_m, y_m, tick),
        compass=Compass(yaw_rad + np.pi / 2.0, tick),
        imu=Imu(1.5, -0.5, 0.2, tick),
        speed=Speed(6.0, tick),
        cameras={name: Image(pixels.copy(), 0) for name in cameras},
        truth=truth,
    )


def straight_lane(index=0, *, y_m=0.0, length_m=100.0, successors=(), start_m=0.0):
    x = np.arange(start_m, start_m + length_m + 0.5)
    centre = np.stack([x, np.full_like(x, y_m), np.zeros_like(x)], axis=1)
    return Lane(index, LaneKind.DRIVING, centre, 3.5, 13.9, False, -1, -1, False, False, "solid", "striped", successors)


def truth_with(*actors, lanes=(), tick=0, speed_mps=6.0):
    """Return the ego at the origin, heading east, and boxes: (kind, x, y, yaw, speed, length, width, height) each."""
    rows = [(k, kind, x, y, yaw, speed, *size, 0) for k, (kind, x, y, yaw, speed, *size) in enumerate(actors)]
    state = WorldState(
        tick,
        EgoState(0.0, 0.0, 0.0, speed_mps, 0.0, 0.0, 0.0, 4.9, 1.84),
        np.array(rows, dtype=float).reshape(-1, 10),
        np.zeros(0, dtype=np.int64),
    )
    lane_map = LaneMap("Strip", lanes or (straight_lane(),), (), np.zeros((0, 4, 2)), np.zeros((0, 6)))
    return GroundTruth(state, lane_map, np.array([[0.0, 0.0, 0.0, 13.9]]), 0)


CAR_AHEAD = (ActorKind.CAR, 22.0, 0.0, 0.0, 2.0, 4.0, 2.0, 1.5)
