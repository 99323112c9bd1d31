"""The machine code of elementary functions is kept as that of kernels is: by content, found from any checkout."""

from __future__ import annotations

from pytest_drive_robust.arithmetic import compiled
from pytest_drive_robust.jit.cache import KernelCache, cache_folder


def test_every_elementary_function_keeps_its_code_in_our_cache() -> None:
    made = [getattr(compiled, name) for name in compiled.__all__]
    assert len(compiled._COMPILED) == len(made) - 2, "hypot and wrap_angle become part of the kernel"
    for one in compiled._COMPILED:
        assert isinstance(one._cache, KernelCache)
        assert one._cache.cache_path == str(cache_folder())
        assert one._cache.holds(one._sig, one._targetdescr.target_context)


def test_functions_of_the_same_shape_have_keys_of_their_own() -> None:
    paths = {one._cache._cache_file._index_path for one in compiled._COMPILED}
    assert len(paths) == len(compiled._COMPILED)
