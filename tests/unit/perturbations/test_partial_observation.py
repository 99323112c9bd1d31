"""The blur in whole numbers against OpenCV's."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from stream_factory import flat_pixels, observation_at, observed, started

from pytest_drive_robust.errors import PerturbationError
from pytest_drive_robust.perturbations import PartialObservation, Perturbation
from pytest_drive_robust.perturbations.partial_observation import blurred

WHITE = flat_pixels(255, rows=40, columns=60)


def masks(perturbation: Perturbation, ticks: range, *, camera: str = "front", seed: int = 0) -> list[np.ndarray]:
    """(rows, columns) bool for each tick: what the rectangle covers of a white image."""
    stack = started(perturbation, seed=seed, cameras=(camera,))
    seen = [stack.observe(observation_at(tick, cameras=(camera,), pixels=WHITE)) for tick in ticks]
    return [observation.cameras[camera].pixels[:, :, 0] != 255 for observation in seen]


def box(mask: np.ndarray) -> tuple[int, int, int, int]:
    """(top, left, height, width) of what is covered, which must be a full rectangle."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    height, width = rows[-1] - rows[0] + 1, columns[-1] - columns[0] + 1
    assert mask.sum() == height * width
    return int(rows[0]), int(columns[0]), int(height), int(width)


@given(st.floats(0.05, 1.0), st.integers(0, 2000))
def test_the_rectangle_covers_the_ratio_of_each_side(ratio: float, tick: int) -> None:
    _, _, height, width = box(masks(PartialObservation(ratio), range(tick, tick + 1))[0])
    assert (height, width) == (int(40 * ratio), int(60 * ratio))


@given(st.floats(0.02, 1.0), st.integers(0, 2000))
def test_area_makes_the_ratio_the_covered_share_of_the_image(ratio: float, tick: int) -> None:
    mask = masks(PartialObservation(ratio, area=True), range(tick, tick + 1))[0]
    _, _, height, _ = box(mask)
    assert height == round(40 * math.sqrt(ratio))
    assert abs(int(mask.sum()) - 40 * 60 * ratio) <= height / 2 + 1


def test_the_side_reading_of_the_paper_covers_a_quarter_and_two_thirds() -> None:
    assert masks(PartialObservation(0.5), range(1))[0].mean() == pytest.approx(0.25)
    assert masks(PartialObservation(0.8), range(1))[0].mean() == pytest.approx(0.64)


def test_the_place_is_uniform_over_all_places_where_the_rectangle_fits() -> None:
    boxes = [box(mask) for mask in masks(PartialObservation(0.5), range(4000))]
    tops, lefts = np.bincount([top for top, *_ in boxes]), np.bincount([left for _, left, *_ in boxes])
    assert (len(tops), len(lefts)) == (21, 31)
    assert stats.chisquare(tops).pvalue > 1e-3
    assert stats.chisquare(lefts).pvalue > 1e-3
    assert abs(np.corrcoef([(top, left) for top, left, *_ in boxes], rowvar=False)[0, 1]) < 0.06


def test_every_camera_has_its_own_place() -> None:
    stack = started(PartialObservation(0.5))
    seen = stack.observe(observation_at(0, cameras=("front", "rear"), pixels=WHITE))
    assert not np.array_equal(seen.cameras["front"].pixels, seen.cameras["rear"].pixels)


@pytest.mark.parametrize(("fill", "value"), [("black", 0), ("gray", 128)])
def test_plain_fills_have_their_colour_and_the_rest_stays(fill: str, value: int) -> None:
    stack = started(PartialObservation(0.5, fill=fill))  # type: ignore[arg-type]
    image = np.random.default_rng(0).integers(1, 100, (40, 60, 3), dtype=np.uint8)
    shown = stack.observe(observation_at(3, pixels=image)).cameras["front"].pixels
    changed = (shown != image).any(axis=2)
    assert np.all(shown[changed] == value)
    assert changed.sum() == 20 * 30


def test_blur_smooths_the_rectangle_and_keeps_its_mean() -> None:
    image = np.random.default_rng(0).integers(0, 256, (144, 256, 3), dtype=np.uint8)
    image.setflags(write=False)
    shown = started(PartialObservation(0.8, fill="blur")).observe(observation_at(3, pixels=image))
    pixels = shown.cameras["front"].pixels
    top, left, height, width = box((pixels != image).any(axis=2) | _filled((pixels != image).any(axis=2)))
    inside = pixels[top : top + height, left : left + width].astype(float)
    before = image[top : top + height, left : left + width].astype(float)
    assert inside.std() < before.std() / 5
    assert inside.mean() == pytest.approx(before.mean(), abs=2.0)


def _filled(mask: np.ndarray) -> np.ndarray:
    """The bounding box of a mask: a blurred pixel may by chance be what it was."""
    filled = np.zeros_like(mask)
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    filled[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] = True
    return filled


@pytest.mark.parametrize("fill", ["black", "blur"])
def test_a_ratio_of_zero_changes_nothing(fill: str) -> None:
    perturbation = PartialObservation(0.0, fill=fill)  # type: ignore[arg-type]
    seen = started(perturbation).observe(observation_at(0))
    assert np.array_equal(seen.cameras["front"].pixels, flat_pixels(0))


@pytest.mark.parametrize("fill", ["black", "gray", "blur"])
def test_a_ratio_of_one_covers_everything_of_images_of_any_size(fill: str) -> None:
    for rows, columns in ((1, 1), (3, 50), (40, 60)):
        image = flat_pixels(7, rows=rows, columns=columns)
        perturbation = PartialObservation(1.0, fill=fill)  # type: ignore[arg-type]
        shown = started(perturbation).observe(observation_at(0, pixels=image)).cameras["front"].pixels
        assert np.unique(shown).tolist() == [{"black": 0, "gray": 128, "blur": 7}[fill]]


def test_an_area_is_never_wider_than_the_image() -> None:
    image = flat_pixels(7, rows=2, columns=30)  # 1.48 rows are one, which is less than 0.55 of the area
    for tick in range(5):
        shown = started(PartialObservation(0.55, area=True)).observe(observation_at(tick, pixels=image))
        black = shown.cameras["front"].pixels[:, :, 0] == 0
        assert sorted(black.sum(axis=1).tolist()) == [0, 30]


@pytest.mark.parametrize("fill", ["black", "gray", "blur"])
def test_a_rectangle_without_height_hides_nothing(fill: str) -> None:
    perturbation = PartialObservation(0.02, fill=fill)  # type: ignore[arg-type]
    image = np.random.default_rng(0).integers(0, 256, (40, 60, 3), dtype=np.uint8)
    shown = started(perturbation).observe(observation_at(0, pixels=image)).cameras["front"]
    assert np.array_equal(shown.pixels, image)


@settings(max_examples=10)
@given(st.integers(0, 1000))
def test_the_mask_is_the_same_for_every_agent(tick: int) -> None:
    here, again = (masks(PartialObservation(0.5), range(tick, tick + 1), seed=5)[0] for _ in range(2))
    assert np.array_equal(here, again)


def test_the_mask_is_that_of_the_cameras_place_in_the_rig_whatever_the_agent_calls_it() -> None:
    perturbation = PartialObservation(0.5)
    ours, theirs = (masks(perturbation, range(20), camera=camera) for camera in ("front", "CAM_FRONT"))
    assert np.array_equal(ours, theirs)
    two = started(perturbation, cameras=("CAM_FRONT", "CAM_BACK"))
    seen = two.observe(observation_at(0, cameras=("CAM_BACK", "CAM_FRONT"), pixels=WHITE)).cameras
    assert np.array_equal(seen["CAM_FRONT"].pixels[:, :, 0] != 255, ours[0])


def test_a_camera_that_the_rig_does_not_have_is_refused() -> None:
    with pytest.raises(PerturbationError, match="the camera 'rear', expected one of the agent's rig: front"):
        started(PartialObservation(), cameras=("front",)).observe(observation_at(0, cameras=("rear",)))


def test_the_tick_of_capture_stays() -> None:
    assert [seen.cameras["front"].tick for seen in observed(PartialObservation(), range(3))] == [0, 1, 2]


def test_the_record_holds_one_stretch_for_each_camera() -> None:
    stack = started(PartialObservation())
    for tick in range(7):
        stack.observe(observation_at(tick, cameras=("front", "rear")))
    spans = [(item.perturbation, item.signal, item.first_tick, item.last_tick) for item in stack.schedule()]
    assert spans == [("partial-observation", "front", 0, 6), ("partial-observation", "rear", 0, 6)]


@given(rows=st.integers(1, 70), columns=st.integers(1, 70), seed=st.integers(0, 999), extreme=st.booleans())
def test_the_blur_is_opencvs_to_the_bit(rows: int, columns: int, seed: int, extreme: bool) -> None:
    image = np.random.default_rng(seed).integers(0, 256, (rows, columns, 3)).astype(np.uint8)
    if extreme:
        image = np.where(image > 127, 255, 0).astype(np.uint8)
    assert np.array_equal(blurred(image), cv2.GaussianBlur(image, (31, 31), 0))
