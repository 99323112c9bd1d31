"""How kernels are compiled: which functions, for which types, and where the machine code is kept.

- `kernels`: the two decorators, `entry` for what Python calls and `inner` for what only kernels call
- `dispatchers`: what numba makes of them when they are first called
- `libraries`: inner functions become machine code only as parts of an entry point
- `resolutions`: what numba finds out about types is remembered
- `signatures`: the types of an entry point from its annotations
- `cache`: where machine code is kept, by the content of all sources
- `compile_all`: everything that is not in the cache, side by side in processes
"""

from __future__ import annotations
