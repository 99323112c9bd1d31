"""What scripts of `benchmarks/` import is on the path, last: their own names are common ones."""

from __future__ import annotations

import sys
from pathlib import Path

_ROOT = Path(__file__).parents[2]
sys.path += [str(_ROOT / "benchmarks"), str(_ROOT / "tests" / "calibration")]
