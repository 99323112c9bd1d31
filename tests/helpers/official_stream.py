"""A recorded sensor stream in official payloads, stand-ins for the official classes, and both ways to perturb it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.geodesy import to_geodetic, to_metric
from pytest_drive_robust.domain.observation import CameraSpec, Compass, Gps, Image, Imu, Observation, Speed
from pytest_drive_robust.perturbations import RunningStack, Setting

CAMERAS = ("CAM_BACK", "CAM_FRONT")
SENSORS = (
    {"type": "sensor.other.gnss", "id": "GPS"},
    {"type": "sensor.camera.rgb", "id": "CAM_FRONT"},
    {"type": "sensor.camera.rgb", "id": "CAM_BACK"},
    {"type": "sensor.camera.rgb", "id": "bev"},
)
RIG = tuple(CameraSpec(sensor["id"]) for sensor in SENSORS if sensor["type"] == "sensor.camera.rgb")
"""The cameras in the order of `sensors()`, which is not that of their names."""
FIRST_FRAME = 700


@dataclass
class VehicleControl:
    """The fields of `carla.VehicleControl`."""

    throttle: float = 0.0
    steer: float = 0.0
    brake: float = 0.0
    hand_brake: bool = False
    reverse: bool = False
    manual_gear_shift: bool = False
    gear: int = 0


class SensorInterface:
    """As Bench2Drive's: everything of a frame can be taken once, then it is gone."""

    def __init__(self, stream: list[dict[str, Any]]) -> None:
        self.stream = stream
        self.reads: list[int] = []

    def get_data(self, frame: int) -> dict[str, Any]:
        assert frame not in self.reads, "the official queue would wait 300 s for data that was taken already"
        self.reads.append(frame)
        return {tag: (frame, copy_of(payload)) for tag, payload in self.stream[frame - FIRST_FRAME].items()}


class AgentWrapper:
    def __init__(self, agent: Callable[[], Any]) -> None:
        self._agent = agent

    def __call__(self) -> Any:
        return self._agent()

    def cleanup(self) -> None:
        pass


class ScenarioManager:
    def load_scenario(self, scenario: Any, agent: Any, route_index: int, rep_number: int) -> None:
        pass


def copy_of(payload: Any) -> Any:
    return payload.copy() if isinstance(payload, np.ndarray) else dict(payload)


def recorded(ticks: int, *, seed: int = 0, rows: int = 9, columns: int = 14) -> list[dict[str, Any]]:
    """Return payloads by tag, tick by tick; the debug camera `bev` and a lidar among them."""
    rng = np.random.default_rng(seed)
    stream = []
    for _ in range(ticks):
        payloads: dict[str, Any] = {
            tag: rng.integers(0, 256, (rows, columns, 4), dtype=np.uint8) for tag in ("CAM_FRONT", "bev", "CAM_BACK")
        }
        payloads["LIDAR"] = rng.normal(size=(5, 4)).astype(np.float32)
        payloads["GPS"] = np.array([*to_geodetic(*rng.uniform(-9000, 9000, 2)), rng.uniform(0, 200)])
        payloads["IMU"] = rng.normal(size=7)
        payloads["SPEED"] = {"speed": float(rng.uniform(-1, 20))}
        stream.append(payloads)
    return stream


def command_for(payloads: Mapping[str, Any]) -> tuple[float, float, float]:
    """Return what the agent of these tests does: every bit that it is given matters."""
    total = sum(int(payloads[tag][..., :3].sum(dtype=np.int64)) for tag in CAMERAS)
    total += sum(np.abs(payloads[tag]).tobytes()[0] for tag in ("GPS", "IMU"))
    return (total % 97) / 97.0, (total % 89) / 44.5 - 1.0, (total % 83) / 83.0


@dataclass
class Driven:
    """`given[tick]` are the payloads that the agent got, None where it was not asked."""

    given: list[dict[str, Any] | None] = field(default_factory=list)
    applied: list[tuple[float, float, float]] = field(default_factory=list)
    schedule: list[tuple[str, str, int, int]] = field(default_factory=list)
    inference_s: list[float] = field(default_factory=list)


def through_package(stream: list[dict[str, Any]], setting: Setting, *, route: str, seed: int) -> Driven:
    """Send the stream through the setting as the embedded simulator's loop does."""
    stack = RunningStack.of(setting, route_id=route, seed=seed, dt_s=0.05, cameras=RIG)
    driven = Driven()
    fixes: dict[tuple[float, float], Any] = {}
    for tick, payloads in enumerate(stream):
        x_m, y_m = to_metric(*payloads["GPS"][:2])
        fixes[x_m, y_m] = payloads["GPS"]
        observation = stack.observe(_observation(tick, payloads, x_m, y_m))
        control = None
        given = None
        if stack.wants_inference(tick):
            given = _payloads(observation, stream, fixes)
            control = Control(*command_for(given))
        driven.given.append(given)
        applied = stack.actuate(tick, control, 0.0)
        driven.applied.append((applied.throttle, applied.steer, applied.brake))
    driven.schedule = sorted((i.perturbation, i.signal, i.first_tick, i.last_tick) for i in stack.schedule())
    driven.inference_s = list(stack.inference_s)
    return driven


def _observation(tick: int, payloads: Mapping[str, Any], x_m: float, y_m: float) -> Observation:
    imu = payloads["IMU"]
    return Observation(
        tick=tick,
        gps=Gps(x_m, y_m, tick),
        compass=Compass(float(imu[6]), tick),
        imu=Imu(float(imu[0]), float(imu[1]), float(imu[5]), tick),
        speed=Speed(payloads["SPEED"]["speed"], tick),
        cameras={tag: Image(np.ascontiguousarray(payloads[tag][..., 2::-1]), tick) for tag in CAMERAS},
    )


def _payloads(
    seen: Observation, stream: list[dict[str, Any]], fixes: Mapping[tuple[float, float], Any]
) -> dict[str, Any]:
    """Turn back into official payloads: a position that no perturbation moved is the very fix that came."""
    where = seen.gps.x_m, seen.gps.y_m
    fix = fixes.get(where)
    if fix is None:
        fix = np.array([*to_geodetic(*where), stream[seen.gps.tick]["GPS"][2]])
    given: dict[str, Any] = {tag: image.pixels[..., ::-1] for tag, image in seen.cameras.items()}
    now = stream[seen.tick]
    return {
        **given, "GPS": fix, "IMU": stream[seen.imu.tick]["IMU"], "SPEED": {"speed": seen.speed.mps},
        "bev": now["bev"], "LIDAR": now["LIDAR"],
    }  # fmt: skip


def fresh_classes() -> SimpleNamespace:
    """Return the stand-ins, not wrapped yet."""
    return SimpleNamespace(
        interface=type("SensorInterface", (SensorInterface,), {"get_data": SensorInterface.get_data}),
        wrapper=type("AgentWrapper", (AgentWrapper,), {"__call__": AgentWrapper.__call__}),
        manager=type("ScenarioManager", (ScenarioManager,), {"load_scenario": ScenarioManager.load_scenario}),
    )


class OfficialDrive:
    """The official loop around wrapped classes, as far as the injection can see it."""

    def __init__(
        self, classes: SimpleNamespace, stream: list[dict[str, Any]], *, make_control: Any = VehicleControl
    ) -> None:
        self.classes = classes
        self.frame = FIRST_FRAME
        self.sensor_interface = classes.interface(stream)
        self.make_control = make_control
        self.given: dict[str, Any] | None = None
        self.command = make_control()  # agents return the same object again and again

    def sensors(self) -> Any:
        return SENSORS

    def __call__(self) -> Any:
        data = self.sensor_interface.get_data(self.frame)
        self.sensor_interface.get_data(self.frame)  # agents that look twice see the same
        assert all(frame == self.frame for frame, _ in data.values())
        self.given = {tag: payload for tag, (_, payload) in data.items()}
        self.command.throttle, self.command.steer, self.command.brake = command_for(self.given)
        return self.command

    def drive(self, route: str, *, rep: int = 0) -> Driven:
        wrapper = self.classes.wrapper(self)
        scenario = SimpleNamespace(config=SimpleNamespace(name=f"RouteScenario_{route}"))
        self.classes.manager().load_scenario(scenario, self, 0, rep)
        driven = Driven()
        for tick in range(len(self.sensor_interface.stream)):
            self.frame = FIRST_FRAME + tick
            self.given = None
            control = wrapper()
            driven.given.append(None if self.given is None else {t: copy_of(p) for t, p in self.given.items()})
            driven.applied.append((control.throttle, control.steer, control.brake))
            control.throttle = 0.123  # scenarios change the command that they get
            for payload in (self.given or {}).values():
                if isinstance(payload, np.ndarray):
                    payload[...] = 7  # and agents write into their images
        assert self.sensor_interface.reads == [FIRST_FRAME + t for t in range(len(self.sensor_interface.stream))]
        wrapper.cleanup()
        return driven


def same_bits(left: Driven, right: Driven) -> None:
    """Raise where two drives differ."""
    assert left.applied == right.applied
    for tick, (a, b) in enumerate(zip(left.given, right.given, strict=True)):
        assert (a is None) == (b is None), f"tick {tick}: asked in one, not in the other"
        if a is None or b is None:
            continue
        assert set(a) == set(b)
        for tag in a:
            if tag == "SPEED":
                assert a[tag] == b[tag], f"tick {tick}, {tag}"
            else:
                channels = slice(0, 3) if tag in CAMERAS else slice(None)
                assert np.array_equal(a[tag][..., channels], b[tag][..., channels]), f"tick {tick}, {tag}"


__all__ = [
    "CAMERAS", "FIRST_FRAME", "Driven", "OfficialDrive", "VehicleControl", "fresh_classes", "recorded", "replace",
    "same_bits", "through_package",
]  # fmt: skip
