"""Colours packed into one number, 0x00BBGGRR: how kernels hold the pixels of a picture and the texels of the ground."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.jit.arrays import Packed
from pytest_drive_robust.jit.kernels import inner

_255 = np.float32(255.0)


@inner
def pack(red: float, green: float, blue: float) -> int:
    """Return a colour of float32 channels, 0 or more, packed; a channel above 255 counts as 255."""
    red, green, blue = red if red < _255 else _255, green if green < _255 else _255, blue if blue < _255 else _255
    packed: int = np.int32(red) | (np.int32(green) << 8) | (np.int32(blue) << 16)
    return packed


@inner
def pack_pixels(words: Packed, colours: Packed) -> None:
    """Pack colours 0x00BBGGRR (height, width) as bytes red, green, blue, without gaps, in `words` (little-endian)."""
    flat = colours.reshape(-1)
    whole = len(flat) // 4
    for block in range(whole):
        a, b, c, d = flat[4 * block], flat[4 * block + 1], flat[4 * block + 2], flat[4 * block + 3]
        words[3 * block] = a | (b << np.uint32(24))
        words[3 * block + 1] = (b >> np.uint32(8)) | (c << np.uint32(16))
        words[3 * block + 2] = (c >> np.uint32(16)) | (d << np.uint32(8))
    for at in range(4 * whole, len(flat)):
        # the remaining pixels do not fill whole words: write byte by byte
        for channel in range(3):
            byte = 3 * at + channel
            shift = np.uint32(8 * (byte % 4))
            value = (flat[at] >> np.uint32(8 * channel)) & np.uint32(255)
            words[byte // 4] = (words[byte // 4] & ~(np.uint32(255) << shift)) | (value << shift)


def unpack(packed: Packed) -> NDArray[np.uint8]:
    """Return packed colours (rows, columns) as RGB (rows, columns, 3)."""
    return np.ascontiguousarray(packed.astype("<u4")).view(np.uint8).reshape(*packed.shape, 4)[:, :, :3]
