"""The machine code of elementary functions is kept as that of kernels is: by content, found from any checkout."""

from __future__ import annotations

import math
from typing import Any

import pytest

from pytest_drive_robust.arithmetic import compiled, symbols
from pytest_drive_robust.jit.cache import KernelCache, cache_folder


def made() -> list[Any]:
    """The machine code of every function, made or loaded now."""
    for name in compiled.__all__:
        assert getattr(compiled, name)._numba_type_ is not None
    return symbols._COMPILED


def test_every_elementary_function_keeps_its_code_in_our_cache() -> None:
    assert len(made()) == len(compiled.__all__) - 2, "hypot and wrap_angle become part of the kernel"
    for one in made():
        assert isinstance(one._cache, KernelCache)
        assert one._cache.cache_path == str(cache_folder())
        assert one._cache.holds(one._sig, one._targetdescr.target_context)


def test_functions_of_the_same_shape_have_keys_of_their_own() -> None:
    assert len({one._cache._cache_file._index_path for one in made()}) == len(made())


def test_python_calls_the_short_ones_and_no_others() -> None:
    assert compiled.hypot(3.0, 4.0) == 5.0
    assert compiled.wrap_angle(7.0) == pytest.approx(7.0 - math.tau)
    with pytest.raises(TypeError, match=r"arithmetic\.scalars\.sin is for Python"):
        compiled.sin(1.0)
