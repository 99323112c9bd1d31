"""GPS, compass, IMU, speed and cameras of the embedded world, each stamped with the tick of its capture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pytest_drive_robust.domain.observation import CameraSpec, Compass, Gps, Image, Imu, Observation, Speed
from pytest_drive_robust.domain.route import Weather
from pytest_drive_robust.domain.truth import LaneMap, WorldState
from pytest_drive_robust.errors import SimulationError

__all__ = ["Sensors"]


class Sensors:
    """The rig of one episode. Without cameras nothing is ever drawn."""

    def __init__(
        self,
        cameras: Sequence[CameraSpec],
        *,
        lane_map: LaneMap,
        weather: Weather,
        route: np.typing.NDArray[np.float64],
        dt_s: float,
    ) -> None:
        self._every = {camera.name: _ticks_per_frame(camera, dt_s) for camera in cameras}
        self._images: dict[str, Image] = {}
        self._rig = None
        if cameras:
            from pytest_drive_robust.simulators.embedded.camera import CameraRig  # loads the kernels that draw

            self._rig = CameraRig(lane_map, weather, cameras, around=route[:, :2])

    def observe(self, state: WorldState) -> Observation:
        """Return what the sensors deliver at this moment.

        Cameras slower than the tick deliver their last image again.
        """
        tick, ego = state.tick, state.ego
        due = [name for name, every in self._every.items() if tick % every == 0 or name not in self._images]
        if self._rig is not None and due:
            for name, pixels in self._rig.render(state, due).items():
                self._images[name] = Image(pixels, tick)
        return Observation(
            tick=tick,
            gps=Gps(ego.x_m, ego.y_m, tick),
            compass=Compass(float(np.remainder(ego.yaw_rad + np.pi / 2.0, 2.0 * np.pi)), tick),
            imu=Imu(ego.forward_mps2, ego.right_mps2, ego.yaw_rate_radps, tick),
            speed=Speed(ego.speed_mps, tick),
            cameras=dict(self._images),
        )

    def snapshot(self) -> dict[str, Image]:
        """Copy of the images of slow cameras, which the next `observe` may deliver again; give them to `restore`."""
        return {
            name: Image(image.pixels.copy(), image.tick)
            for name, image in self._images.items()
            if self._every[name] > 1
        }

    def restore(self, images: Mapping[str, Image]) -> None:
        """Go back to a `snapshot` of this rig."""
        self._images = dict(images)


def _ticks_per_frame(camera: CameraSpec, dt_s: float) -> int:
    ticks = 1.0 / (camera.rate_hz * dt_s)
    if ticks < 1.0 - 1e-9 or abs(ticks - round(ticks)) > 1e-6:
        raise SimulationError(
            f"camera {camera.name!r} wants {camera.rate_hz:g} Hz; the world runs at {1.0 / dt_s:g} Hz, "
            f"so a camera can have {1.0 / dt_s:g} Hz divided by a whole number"
        )
    return round(ticks)
