"""What the pages look like, compared loosely: a view that is empty, torn or in the wrong colours is noticed.

`DRIVE_ROBUST_NEW_SCREENSHOTS=1 pytest tests/browser/test_screenshots.py` writes the sheet of small pictures again.
"""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from report_pages import VIEWS

pytestmark = pytest.mark.slow

SHEET = Path(__file__).with_name("screenshots.png")
SCHEMES = ("light", "dark")
WIDTH = 1280  # on a narrow screen every font breaks lines elsewhere
TILE = (96, 72)
MOST = 0.6
"""How much of what stands out from the background may be elsewhere. A serif font moves 0.42, another view 0.71."""


def tile_of(page) -> np.ndarray:
    """Return the window as a small picture, whatever the fonts: (72, 96, 3)."""
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))")
    picture = cv2.imdecode(np.frombuffer(page.screenshot(animations="disabled"), np.uint8), cv2.IMREAD_COLOR)
    return cv2.GaussianBlur(cv2.resize(picture, TILE, interpolation=cv2.INTER_AREA), (0, 0), 2.0)


def unlike(tile: np.ndarray, wanted: np.ndarray) -> float:
    """Return the share of what stands out in `wanted` that `tile` has not; 0 for the same."""
    tile, wanted = tile.astype(float), wanted.astype(float)
    return np.abs(tile - wanted).sum() / np.abs(wanted - np.median(wanted, axis=(0, 1))).sum()


def place(view: int, row: int) -> tuple[slice, slice]:
    width, height = TILE
    return slice(row * height, (row + 1) * height), slice(view * width, (view + 1) * width)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_every_view_looks_as_it_did(opened, scheme):
    row = SCHEMES.index(scheme)
    report = opened(width=WIDTH, height=WIDTH * 3 // 4, scheme=scheme)
    tiles = [tile_of(report.go(view)) for view in VIEWS]
    if os.environ.get("DRIVE_ROBUST_NEW_SCREENSHOTS"):
        size = (TILE[1] * len(SCHEMES), TILE[0] * len(VIEWS), 3)
        sheet = cv2.imread(str(SHEET)) if SHEET.exists() else np.zeros(size, np.uint8)
        for number, tile in enumerate(tiles):
            sheet[place(number, row)] = tile
        cv2.imwrite(str(SHEET), sheet)
    sheet = cv2.imread(str(SHEET))
    shares = {
        view: unlike(tile, sheet[place(number, row)])
        for number, (view, tile) in enumerate(zip(VIEWS, tiles, strict=True))
    }
    assert {view: share for view, share in shares.items() if share > MOST} == {}


def test_other_views_other_colours_and_an_empty_page_are_noticed():
    sheet = cv2.imread(str(SHEET))
    light, dark = ([sheet[place(view, row)] for view in range(len(VIEWS))] for row in range(len(SCHEMES)))
    assert min(unlike(tile, other) for tile, other in zip(light, dark, strict=True)) > MOST
    for tiles in (light, dark):
        assert min(unlike(np.full_like(tile, np.median(tile)), tile) for tile in tiles) > MOST
        assert min(unlike(one, other) for one in tiles for other in tiles if one is not other) > MOST
