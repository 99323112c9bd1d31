"""Arithmetic that rounds the same on every IEEE machine: elementary functions, sums, lines and random numbers.

The C library, BLAS and numpy's vector code choose among code paths by processor. These paths differ in the last bit,
and a closed loop turns this difference into another episode. Everything here uses only operations that IEEE 754 defines
to the last bit (`+ - * /`, square root, comparison, sign, powers of two), in the order of the source. No compiler may
fuse two of these operations, because numba, numpy and Python translate each by itself.

- `scalars`: elementary functions of floats, plain Python
- `arrays`: the same functions of arrays, bit for bit
- `compiled`: the same functions for compiled code; `symbols`: their machine code
- `series`: the polynomials, one text for all three
- `signals`: means, interpolation and moving sums
- `random_numbers`: numbers made of the words of a Philox generator

`math.sqrt`, `floor`, `ceil`, `fabs`, `fmod`, `remainder`, `copysign`, `frexp`, `ldexp` and `fsum` are exact everywhere
and need no other version; the same holds for their counterparts in numpy.
"""

from __future__ import annotations
