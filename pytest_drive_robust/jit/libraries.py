"""Two pipelines for numba: inner functions are only parts, an entry point is compiled as a whole.

By default numba optimises every function together with all functions that it calls, and makes machine code of it. Then
numba does the same for the caller, into which that code is copied again. Here an inner function is only translated and
simplified, once; the entry point links, optimises and compiles all its inner functions together. That takes half the
time.

The pipelines depend on numba's internals: `TESTED` has the releases with which the tests were run. Any other release
compiles in numba's own way: slower, with the same results.
"""

from __future__ import annotations

import ctypes
import gc
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numba
from llvmlite import binding
from numba import _dynfunc
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import NativeLowering

from pytest_drive_robust.jit.resolutions import remembered_resolutions

TESTED = ((0, 60), (0, 68))
"""The oldest and the newest release of numba for which the pipelines are known to work."""


def is_tested(version: str = numba.__version__) -> bool:
    """Return whether the pipelines are known to work with this release of numba."""
    release = tuple(int(number) for number in version.split(".")[:2])
    return TESTED[0] <= release <= TESTED[1]


class PartLibrary(JITCodeLibrary):  # type: ignore[misc]
    """The code of one inner function: simplified, not linked with the functions that it calls, no machine code."""

    def finalize(self) -> None:
        """Prepare the code for being copied into entry points."""
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == binding.Linkage.external:
                function.linkage = "linkonce_odr"  # an entry point may get the function from several callers
        self._shared_module = self._final_module
        self._finalized = True


class WholeLibrary(JITCodeLibrary):  # type: ignore[misc]
    """The code of an entry point and of everything that it calls."""

    def finalize(self) -> None:
        """Link all parts, optimise, make machine code."""
        found: dict[Any, None] = {}
        for library in vars(self)["_linking_libraries"]:
            _add_parts(library, found)
        # callers first: the linker drops a function that no earlier library calls
        self._linking_libraries = list(reversed(found))
        super().finalize()


def _add_parts(library: Any, found: dict[Any, None]) -> None:
    """Add a library to `found`; an inner function's library comes after those of all functions that it calls."""
    if library in found:
        return
    for called in vars(library)["_linking_libraries"] if isinstance(library, PartLibrary) else ():
        _add_parts(called, found)
    found[library] = None


@register_pass(mutates_CFG=True, analysis_only=False)
class PartLowering(NativeLowering):  # type: ignore[misc]
    """Translates an inner function into a `PartLibrary`."""

    _name = "part_lowering"

    def run_pass(self, state: Any) -> bool:
        """Translate the function; Python gets a stand-in that raises `TypeError`."""
        state.library = PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        lowered = state["cr"]
        stand_in = _dynfunc.make_function(
            lowered.fndesc.lookup_module(), state.func_id.func_name, _NOT_FOR_PYTHON, _RAISES, lowered.env, ()
        )
        state.targetctx.insert_user_function(stand_in, lowered.fndesc, [state.library])
        state["cr"] = lowered._replace(cfunc=stand_in)
        return True


_NOT_FOR_PYTHON = "only compiled code can call this function"
_RAISES: Any = ctypes.cast(ctypes.pythonapi.PyErr_BadArgument, ctypes.c_void_p).value
"""A function of Python's own that raises TypeError and returns 0, which stands for an exception."""


@register_pass(mutates_CFG=True, analysis_only=False)
class WholeLowering(NativeLowering):  # type: ignore[misc]
    """Translates an entry point into a `WholeLibrary`."""

    _name = "whole_lowering"

    def run_pass(self, state: Any) -> bool:
        """Translate, link and compile."""
        state.library = WholeLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return bool(super().run_pass(state))


def _pipelines(state: Any, lowering: type[Any]) -> list[Any]:
    """Return numba's own pipeline with `lowering` in place of `NativeLowering`."""
    manager = DefaultPassBuilder.define_nopython_pipeline(state)
    manager.passes = [(lowering if one is NativeLowering else one, about) for one, about in manager.passes]
    manager._finalized = False
    manager.finalize()
    return [manager]


class _PartCompiler(CompilerBase):  # type: ignore[misc]
    def define_pipelines(self) -> list[Any]:
        """Return the pipeline of an inner function."""
        return _pipelines(self.state, PartLowering)


class _WholeCompiler(CompilerBase):  # type: ignore[misc]
    def define_pipelines(self) -> list[Any]:
        """Return the pipeline of an entry point."""
        return _pipelines(self.state, WholeLowering)

    def compile_extra(self, function: Any) -> Any:
        """Compile without the garbage collector: a compiler keeps nearly all that it allocates."""
        with _no_garbage_collection(), remembered_resolutions():
            return super().compile_extra(function)


@contextmanager
def _no_garbage_collection() -> Iterator[None]:
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


PartCompiler: type[Any] = _PartCompiler if is_tested() else Compiler
WholeCompiler: type[Any] = _WholeCompiler if is_tested() else Compiler
