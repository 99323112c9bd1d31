"""The ground as a texture: packed colours in levels of falling resolution, cached per map and region."""

from __future__ import annotations

import hashlib
import threading
from collections import OrderedDict
from dataclasses import dataclass

import numpy as np

from pytest_drive_robust.domain.truth import LaneMap
from pytest_drive_robust.jit.arrays import Bytes2, Floats, Floats1, Floats2, Packed, Packed2
from pytest_drive_robust.jit.kernels import entry
from pytest_drive_robust.simulators.embedded.drawing.paint import GroundSheet, Region, paint_ground

_NEAR_MARGIN_M = 30.0
_WIDE_MARGIN_M = 110.0
_NEAR_TEXEL_M = 0.1
_MOST_TEXELS = 100_000_000
"""Most texels of the near region; finer texels around a very long route would need more than a gigabyte."""
NEAR_LEVELS = 2
"""Number of levels that cover only the route's surroundings; the other levels cover a wide region."""
_LEVELS = 7
_CACHED_TEXTURES, _CACHED_BYTES = 12, 256 * 2**20

_MATERIALS = np.array(
    ((104, 124, 72), (150, 148, 144), (176, 174, 168), (84, 86, 92), (98, 98, 100), (118, 82, 74)), np.float64
)  # by paint.GRASS, SIDEWALK, KERB, PARKING, ASPHALT, BIKING
_GRAIN = np.array((9.0, 5.0, 4.0, 4.0, 4.0, 4.0))
_WHITE = np.array((232.0, 232.0, 228.0))
_YELLOW = np.array((222.0, 178.0, 48.0))
FAR_TEXEL = 104 | (124 << 8) | (72 << 16)
"""The ground outside of every texture: grass."""

FIRST, COLUMNS, ROWS, CORNER_X, CORNER_Y, TEXEL_M = range(6)
"""The columns of `GroundTexture.levels`."""


@dataclass(frozen=True, slots=True)
class GroundTexture:
    """Ground colours, ready for the kernels.

    `texels` is flat uint32, 0x00BBGGRR, all levels one after the other. `levels` is (n, 6) float64: first texel,
    columns, rows, x and y of the corner in metres, texel size in metres; each level's texels are twice as large as
    those of the one before.
    """

    texels: Packed
    levels: Floats


_kept: OrderedDict[bytes, GroundTexture] = OrderedDict()
_lock = threading.Lock()


def ground_texture(lane_map: LaneMap, around: Floats) -> GroundTexture:
    """Return the ground of `lane_map` around the points `around` (n, 2 or more).

    The textures used last stay cached by content, up to 256 MiB, because a process drives few maps many times.
    """
    near, wide = texture_regions(around)
    key = _digest(lane_map, near, wide)
    with _lock:
        _kept[key] = _kept.pop(key) if key in _kept else _build(lane_map, near, wide)
        while len(_kept) > 1 and (len(_kept) > _CACHED_TEXTURES or _kept_bytes() > _CACHED_BYTES):
            _kept.popitem(last=False)
        return _kept[key]


def texture_regions(around: Floats) -> tuple[Region, Region]:
    """Return the regions of the near and of the wide levels; texels of 0.1 m, doubled until the region fits."""
    texel_m = _NEAR_TEXEL_M
    near = Region.around(around, _NEAR_MARGIN_M, texel_m=texel_m)
    while near.columns * near.rows > _MOST_TEXELS:
        texel_m *= 2.0
        near = Region.around(around, _NEAR_MARGIN_M, texel_m=texel_m)
    return near, Region.around(around, _WIDE_MARGIN_M, texel_m=texel_m * 2 ** (NEAR_LEVELS - 1))


def _kept_bytes() -> int:
    return sum(texture.texels.nbytes for texture in _kept.values())


def _build(lane_map: LaneMap, near: Region, wide: Region) -> GroundTexture:
    pictures: list[tuple[Packed, Region]] = []
    picture, region = pack_sheet(paint_ground(lane_map, near)), near
    for _ in range(NEAR_LEVELS):
        pictures.append((picture, region))
        picture, region = _halved(picture), _halved_region(region)
    # The wide sheet is drawn one level finer than its first kept level, because thin paint needs the averaging.
    picture, region = pack_sheet(paint_ground(lane_map, wide)), wide
    for _ in range(NEAR_LEVELS, _LEVELS):
        picture, region = _halved(picture), _halved_region(region)
        pictures.append((picture, region))
    first = np.cumsum([0] + [picture.size for picture, _ in pictures[:-1]])
    levels = np.array(
        [
            (offset, region.columns, region.rows, region.x_m, region.y_m, region.texel_m)
            for offset, (_, region) in zip(first, pictures, strict=True)
        ],
        np.float64,
    )
    return GroundTexture(np.concatenate([picture.ravel() for picture, _ in pictures]), levels)


def _halved_region(region: Region) -> Region:
    return Region(region.x_m, region.y_m, region.columns // 2, region.rows // 2, region.texel_m * 2.0)


def pack_sheet(sheet: GroundSheet) -> Packed:
    """Return the colours of a sheet, (rows, columns) uint32, 0x00BBGGRR."""
    column = round(sheet.region.x_m / sheet.region.texel_m)
    row = round(sheet.region.y_m / sheet.region.texel_m)
    packed: Packed = _pack(sheet.material, sheet.white, sheet.yellow, column, row, _MATERIALS, _GRAIN, _WHITE, _YELLOW)
    return packed


@entry
def _pack(
    material: Bytes2,
    white: Bytes2,
    yellow: Bytes2,
    column: int,
    row: int,
    colours: Floats2,
    grain: Floats1,
    white_colour: Floats1,
    yellow_colour: Floats1,
) -> Packed2:
    """Return the colours of a sheet, (rows, columns) uint32, 0x00BBGGRR."""
    rows, columns = material.shape
    packed = np.empty((rows, columns), np.uint32)
    for i in range(rows):
        for j in range(columns):
            kind = material[i, j]
            # the grain is a hash of the texel's place in the world, so it never depends on the region
            word = ((row + i) * 73856093) ^ ((column + j) * 19349663)
            word = (word ^ (word >> 13)) * 1274126177
            noise = (((word ^ (word >> 16)) & 1023) / 511.5 - 1.0) * grain[kind]
            a, b = white[i, j] / 255.0, yellow[i, j] / 255.0
            value = 0
            for channel in range(3):
                colour = colours[kind, channel] + noise
                colour += (yellow_colour[channel] - colour) * b
                colour += (white_colour[channel] - colour) * a
                value |= int(min(max(colour, 0.0), 255.0)) << (8 * channel)
            packed[i, j] = value
    return packed


@entry
def _halved(picture: Packed2) -> Packed2:
    """Average each 2 x 2 block of texels, channels rounded to nearest."""
    rows, columns = picture.shape[0] // 2, picture.shape[1] // 2
    small = np.empty((rows, columns), np.uint32)
    for i in range(rows):
        for j in range(columns):
            low, high = np.uint32(0x00020002), np.uint32(0x00000002)
            for k in range(4):
                texel = picture[2 * i + k // 2, 2 * j + k % 2]
                low += texel & np.uint32(0x00FF00FF)
                high += (texel >> np.uint32(8)) & np.uint32(0x000000FF)
            small[i, j] = ((low >> np.uint32(2)) & np.uint32(0x00FF00FF)) | (
                ((high >> np.uint32(2)) & np.uint32(0x000000FF)) << np.uint32(8)
            )
    return small


def _digest(lane_map: LaneMap, *regions: Region) -> bytes:
    """Return a digest of everything that `paint_ground` reads: equal digests mean equal ground."""
    content = hashlib.blake2b(repr(regions).encode(), digest_size=16)
    for lane in lane_map.lanes:
        words = (lane.index, int(lane.kind), lane.width_m, lane.left, lane.right, lane.left_same_way)
        content.update(repr((*words, lane.right_same_way, lane.left_line, lane.right_line)).encode())
        content.update(np.ascontiguousarray(lane.centre, np.float64).tobytes())
    content.update(repr([(s.x_m, s.y_m, s.heading_rad, s.width_m) for s in lane_map.stop_lines]).encode())
    content.update(np.ascontiguousarray(lane_map.crosswalks, np.float64).tobytes())
    return content.digest()
