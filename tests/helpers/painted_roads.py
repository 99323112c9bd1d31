"""Pictures of a road, painted by hand, and plans along it: for tests of the agent `classical`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._classical.daylight import lamp_light
from drive_robust_agents._classical.vision import CAMERA, ground_pixels
from pytest_drive_robust import GlobalPlan, PlanPoint, RoadOption

ASPHALT, WHITE, TYRE, SKY = (98, 98, 100), (232, 232, 228), (22, 22, 24), (140, 180, 220)
STRAIGHT = GlobalPlan(tuple(PlanPoint(x, 0.0, RoadOption.LANE_FOLLOW) for x in (0.0, 50.0, 100.0)))
LEFT_TURN = GlobalPlan(
    (
        PlanPoint(0.0, 0.0, RoadOption.LANE_FOLLOW),
        PlanPoint(30.0, 0.0, RoadOption.LEFT),
        PlanPoint(42.0, -12.0, RoadOption.LANE_FOLLOW),
        PlanPoint(42.0, -40.0, RoadOption.LANE_FOLLOW),
    )
)


def road(lane_right_m: float = 0.0) -> NDArray[np.uint8]:
    """Paint a straight grey road with solid white lines 1.75 m beside the middle of a lane."""
    image = np.empty((CAMERA.height_px, CAMERA.width_px, 3), dtype=np.uint8)
    image[: CAMERA.height_px // 2] = SKY
    image[CAMERA.height_px // 2 :] = ASPHALT
    for side in (-1.75, 1.75):
        paint(image, (4.0, 40.0), (lane_right_m + side - 0.1, lane_right_m + side + 0.1), WHITE)
    return image


def by_night(image: NDArray[np.uint8], brighter: float = 1.0) -> NDArray[np.uint8]:
    """Return the same picture in the vehicle's headlamps, below a dark sky."""
    half = CAMERA.height_px // 2
    depth = CAMERA.z_m * CAMERA.width_px / 2.0 / (np.arange(half) + 0.5)
    right = depth[:, None] * (np.arange(CAMERA.width_px) + 0.5 - CAMERA.width_px / 2.0) / (CAMERA.width_px / 2.0)
    light = 0.12 + lamp_light(depth[:, None] + CAMERA.x_m, right)
    dark = image.copy()
    dark[:half] = (9, 12, 34)
    dark[half:] = np.minimum(image[half:] * (brighter * light)[:, :, None], 255.0)
    return dark


def paint(
    image: NDArray[np.uint8], forward_m: tuple[float, float], right_m: tuple[float, float], colour: tuple[int, int, int]
) -> None:
    """Paint a rectangle of the ground."""
    grid = np.meshgrid(np.arange(*forward_m, 0.02), np.linspace(*right_m, 100), indexing="ij")
    rows, columns = ground_pixels(*grid)
    image[rows, columns] = colour
