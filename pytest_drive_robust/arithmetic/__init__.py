"""Arithmetic that rounds the same on every IEEE machine: elementary functions, sums, lines and random numbers.

The C library, BLAS and numpy's vector code choose among code paths by processor, and these differ in the last bit; a
closed loop makes another episode of it. Everything here takes only what IEEE 754 defines to the last bit (`+ - * /`,
square root, comparison, sign, powers of two) in an order that the text states. No compiler may fuse two of these
operations, because numba, numpy and Python translate each by itself.

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
