"""The blur in whole numbers against OpenCV's."""

from __future__ import annotations

import cv2
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pytest_drive_robust.perturbations.gaussian_blur import blurred


@given(rows=st.integers(1, 70), columns=st.integers(1, 70), seed=st.integers(0, 999), extreme=st.booleans())
def test_the_blur_is_opencvs_to_the_bit(rows: int, columns: int, seed: int, extreme: bool) -> None:
    image = np.random.default_rng(seed).integers(0, 256, (rows, columns, 3)).astype(np.uint8)
    if extreme:
        image = np.where(image > 127, 255, 0).astype(np.uint8)
    assert np.array_equal(blurred(image), cv2.GaussianBlur(image, (31, 31), 0))
