"""Measure the CPU time of a rendered frame, by rig and weather, at a junction with lights and 20 actors around the ego.

Rigs and weathers alternate within every round, so that a machine that slows down slows all cases alike.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Sequence

import numpy as np
from rich.console import Console
from rich.table import Table

from pytest_drive_robust import CameraSpec
from pytest_drive_robust.domain.route import Weather
from pytest_drive_robust.domain.truth import ActorKind, ActorState, EgoState, LaneKind, LaneMap, WorldState
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.actors import SIZES
from pytest_drive_robust.simulators.embedded.camera import CameraRig
from pytest_drive_robust.simulators.embedded.route_sets import ALL_ROUTES, named_routes

ACTORS = 20
FRAMES = 40
CROWD = (ActorKind.CAR, ActorKind.CAR, ActorKind.VAN, ActorKind.PEDESTRIAN, ActorKind.CAR, ActorKind.TRUCK)
SIX = (("front", 0.0), ("left", -55.0), ("right", 55.0), ("back", 180.0), ("back left", -110.0), ("back right", 110.0))


def six(width_px: int, height_px: int) -> tuple[CameraSpec, ...]:
    return tuple(
        CameraSpec(name, yaw_deg=yaw, fov_deg=110.0 if name == "back" else 70.0, width_px=width_px, height_px=height_px)
        for name, yaw in SIX
    )


RIGS: dict[str, tuple[CameraSpec, ...]] = {
    "1 of 256x128": (CameraSpec("front", height_px=128),),
    "1 of 256x144": (CameraSpec("front"),),
    "6 of 160x96": six(160, 96),
    "1 of 512x256": (CameraSpec("front", width_px=512, height_px=256),),
    "1 of 1024x512, fov 110": (CameraSpec("front", fov_deg=110.0, width_px=1024, height_px=512),),
}
WEATHERS: dict[str, Weather] = {
    "fair": Weather(sun_altitude_angle=60.0),
    "fog": Weather(fog_density=60.0, cloudiness=60.0),
    "rain": Weather(precipitation=80.0, cloudiness=90.0, wetness=90.0),
    "night": Weather(sun_altitude_angle=-30.0),
}


def scene() -> tuple[LaneMap, np.ndarray, list[WorldState]]:
    """Return a map, the route's points, and frames on the way to its junction with `ACTORS` actors within 70 m."""
    route = next(route for route in named_routes(ALL_ROUTES) if route.scenario.type == "SignalizedJunctionLeftTurn")
    simulator = EmbeddedSimulator()
    first = simulator.reset(route, seed=0, cameras=())
    truth = simulator.truth()
    centres = np.concatenate([lane.centre for lane in truth.lane_map.lanes if lane.kind == LaneKind.DRIVING])
    frames = []
    for tick in range(FRAMES):
        x, y, yaw, _ = truth.route[tick]
        ego = EgoState(float(x), float(y), float(yaw), 8.0, 0.0, 0.0, 0.0, first.ego.length_m, first.ego.width_m)
        frames.append(WorldState(tick, ego, _crowd(centres, truth.route), first.lights))
    return truth.lane_map, truth.route[:, :2], frames


def _crowd(centres: np.ndarray, route: np.ndarray) -> np.ndarray:
    """Return actors on the lanes around the middle of the way, at places drawn once."""
    middle = route[FRAMES]
    near = centres[np.hypot(centres[:, 0] - middle[0], centres[:, 1] - middle[1]) < 60.0]
    draw = np.random.Generator(np.random.Philox(7))
    rows = []
    for number, place in enumerate(draw.choice(len(near), ACTORS, replace=False)):
        kind = CROWD[number % len(CROWD)]
        state = (ActorState.BRAKING, ActorState.INDICATOR_LEFT, ActorState.NONE)[number % 3]
        rows.append((number, kind, *near[place], 6.0, *SIZES[kind], state))
    return np.array(rows, np.float64)


def frame_ms(rig: CameraRig, frames: Sequence[WorldState]) -> float:
    """Return milliseconds of process time per frame of the whole rig."""
    start = time.process_time()
    for frame in frames:
        rig.render(frame)
    return (time.process_time() - start) / len(frames) * 1e3


def subjects() -> dict[tuple[str, str], Callable[[], float]]:
    lane_map, around, frames = scene()
    found: dict[tuple[str, str], Callable[[], float]] = {}
    for rig_name, cameras in RIGS.items():
        for weather_name, weather in WEATHERS.items():
            rig = CameraRig(lane_map, weather, cameras, around=around)
            found[rig_name, weather_name] = lambda rig=rig: frame_ms(rig, frames)  # type: ignore[misc]
    return found


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--rounds", type=int, default=9)
    given = parser.parse_args()
    work = subjects()
    for measure in work.values():
        measure()  # compile, fill caches
    measured: dict[tuple[str, str], list[float]] = {name: [] for name in work}
    for _ in range(given.rounds):
        for name, measure in work.items():
            measured[name].append(measure())
    table = Table(
        "ms of CPU per frame (median, lowest)", *WEATHERS, title=f"{ACTORS} actors within 60 m of the junction"
    )
    for rig in RIGS:
        cells = [measured[rig, weather] for weather in WEATHERS]
        table.add_row(rig, *(f"{statistics.median(cell):.2f} ({min(cell):.2f})" for cell in cells))
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
