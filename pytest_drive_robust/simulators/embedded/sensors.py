"""GPS, compass, IMU, speed and cameras of the embedded world, each stamped with the tick of its capture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pytest_drive_robust.domain.observation import CameraSpec, Compass, Gps, Image, Imu, Observation, Speed
from pytest_drive_robust.domain.route import Weather
from pytest_drive_robust.domain.truth import GroundTruth, LaneMap, WorldState
from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.jit.arrays import Floats


def sensed(state: WorldState, *, cameras: Mapping[str, Image], truth: GroundTruth | None = None) -> Observation:
    """Return the observation of a state: its GPS, compass, IMU and speed, with the given images."""
    tick, ego = state.tick, state.ego
    return Observation(
        tick=tick,
        gps=Gps(ego.x_m, ego.y_m, tick),
        compass=Compass(float(np.remainder(ego.yaw_rad + np.pi / 2.0, 2.0 * np.pi)), tick),
        imu=Imu(ego.forward_mps2, ego.right_mps2, ego.yaw_rate_radps, tick),
        speed=Speed(ego.speed_mps, tick),
        cameras=cameras,
        truth=truth,
    )


class Sensors:
    """The sensors of one episode; without cameras nothing is drawn. Raises `SimulationError` for an invalid camera."""

    def __init__(
        self,
        cameras: Sequence[CameraSpec],
        *,
        lane_map: LaneMap,
        weather: Weather,
        route: Floats,
        dt_s: float,
    ) -> None:
        for camera in cameras:
            problem = camera.problem(dt_s)
            if problem is not None or [other.name for other in cameras].count(camera.name) > 1:
                raise SimulationError(f"camera {camera.name!r}: {problem or 'two have this name, expected one each'}")
        self._every = {camera.name: round(1.0 / (camera.rate_hz * dt_s)) for camera in cameras}
        self._images: dict[str, Image] = {}
        self._rig = None
        if cameras:
            from pytest_drive_robust.simulators.embedded.camera import CameraRig  # loads the kernels that draw

            self._rig = CameraRig(lane_map, weather, cameras, around=route[:, :2])

    def observe(self, state: WorldState) -> Observation:
        """Return the observation of this tick; a camera slower than the tick repeats its last image."""
        tick = state.tick
        due = [name for name, every in self._every.items() if tick % every == 0 or name not in self._images]
        if self._rig is not None and due:
            for name, pixels in self._rig.render(state, due).items():
                self._images[name] = Image(pixels, tick)
        return sensed(state, cameras=dict(self._images))

    def snapshot(self) -> dict[str, Image]:
        """Return copies of the slow cameras' last images, for `restore`; the next `observe` may repeat the images."""
        return {
            name: Image(image.pixels.copy(), image.tick)
            for name, image in self._images.items()
            if self._every[name] > 1
        }

    def restore(self, images: Mapping[str, Image]) -> None:
        """Restore a `snapshot` of these sensors."""
        self._images = dict(images)
