"""Camera rigs of well-known agents by name, in any resolution.

==================== ======= ====================================================================================
name                 cameras whose
==================== ======= ====================================================================================
`nuscenes`           6       Bench2Drive's UniAD and VAD, after nuScenes: all around
`tcp`                3       Bench2Drive's TCP: the three front cameras of the six
`simlingo`           1       SimLingo: one wide camera above and behind the driver, 1024 x 512
==================== ======= ====================================================================================

Places and angles are those of the published agents: Bench2DriveZoo `team_code/uniad_b2d_agent.py`,
`team_code/vad_b2d_agent.py` and `team_code/tcp_b2d_agent.py`, SimLingo `team_code/config_simlingo.py`. The published
pictures are large (1600 x 900 each for the first two); compact agents use small pictures.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.errors import UnknownNameError, UsageError

_FRONT = CameraSpec("front", 0.80, 0.0, 1.60, 0.0, fov_deg=70.0, width_px=1600, height_px=900)
_FRONT_LEFT = replace(_FRONT, name="front_left", x_m=0.27, y_m=-0.55, yaw_deg=-55.0)
_FRONT_RIGHT = replace(_FRONT, name="front_right", x_m=0.27, y_m=0.55, yaw_deg=55.0)
_BACK = replace(_FRONT, name="back", x_m=-2.0, yaw_deg=180.0, fov_deg=110.0)
_BACK_LEFT = replace(_FRONT, name="back_left", x_m=-0.32, y_m=-0.55, yaw_deg=-110.0)
_BACK_RIGHT = replace(_FRONT, name="back_right", x_m=-0.32, y_m=0.55, yaw_deg=110.0)

RIGS: Mapping[str, tuple[CameraSpec, ...]] = MappingProxyType(
    {
        "nuscenes": (_FRONT, _FRONT_LEFT, _FRONT_RIGHT, _BACK, _BACK_LEFT, _BACK_RIGHT),
        "simlingo": (CameraSpec("front", -1.5, 0.0, 2.0, 0.0, fov_deg=110.0, width_px=1024, height_px=512),),
        "tcp": (_FRONT_LEFT, _FRONT, _FRONT_RIGHT),
    }
)
"""Every rig with its published resolution; the first camera or the middle one is called `front` in each."""


def rig_names() -> tuple[str, ...]:
    """Return the names that `rig` knows."""
    return tuple(sorted(RIGS))


def rig(
    name: str, *, width_px: int | None = None, height_px: int | None = None, rate_hz: float = 20.0
) -> tuple[CameraSpec, ...]:
    """Return the cameras of a rig, each `width_px` x `height_px` pixels (the published size where not said).

    Every size keeps the horizontal field of view, so another ratio of width to height shows more or less sky and road.
    Raises `UnknownNameError` for an unknown name and `UsageError` for an impossible size or rate.

    >>> [camera.name for camera in rig("tcp", width_px=256, height_px=144)]
    ['front_left', 'front', 'front_right']
    >>> front, *_ = rig("nuscenes")
    >>> front.width_px, front.height_px, front.fov_deg
    (1600, 900, 70.0)
    """
    if name not in RIGS:
        raise UnknownNameError.of("camera rig", name, RIGS, hint="Or build it from CameraSpec.")
    for what, given in (("width_px", width_px), ("height_px", height_px)):
        if given is not None and given < 1:
            raise UsageError(f"{what} of camera rig {name!r} is {given}, expected at least 1.")
    if not 0.0 < rate_hz < float("inf"):
        raise UsageError(f"rate_hz of camera rig {name!r} is {rate_hz!r}, expected a number above 0.")
    return tuple(
        replace(
            camera,
            width_px=camera.width_px if width_px is None else width_px,
            height_px=camera.height_px if height_px is None else height_px,
            rate_hz=rate_hz,
        )
        for camera in RIGS[name]
    )
