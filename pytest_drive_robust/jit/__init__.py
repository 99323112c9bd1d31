"""How kernels are compiled: which functions, for which types, and where the machine code is kept.

- `kernels`: the decorators, `entry` (or `uncached_entry`) for what Python calls and `inner` for what only kernels call
- `dispatchers`: numba's dispatchers of the kernels, made at the first call
- `libraries`: inner functions become machine code only as parts of an entry point
- `resolutions`: numba's choices of implementations for types, remembered
- `signatures`: the types of an entry point from its annotations
- `content`: a digest of all sources that decide the machine code; `cache`: where the code is kept, by this digest
- `entry_groups`: which entry points are not in the cache, and which functions are compiled with them
- `compiled_functions`: counts functions as they are compiled
- `compile_all`: compiles every entry point that is not in the cache, in parallel processes
"""

from __future__ import annotations
