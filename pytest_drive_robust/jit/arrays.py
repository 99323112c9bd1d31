"""Annotations of the arrays of kernels: element type and number of dimensions. All are writable and contiguous."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Pixels = NDArray[np.uint8]
Packed = NDArray[np.uint32]
"""Arrays whose number of dimensions is not part of the type: for inner functions and for Python."""

Floats1 = Annotated[NDArray[np.float64], 1]
Floats2 = Annotated[NDArray[np.float64], 2]
Floats3 = Annotated[NDArray[np.float64], 3]
Ints1 = Annotated[NDArray[np.int64], 1]
Ints2 = Annotated[NDArray[np.int64], 2]
Bytes2 = Annotated[NDArray[np.uint8], 2]
Bytes3 = Annotated[NDArray[np.uint8], 3]
Mask2 = Annotated[NDArray[np.bool_], 2]
Packed1 = Annotated[NDArray[np.uint32], 1]
Packed2 = Annotated[NDArray[np.uint32], 2]
