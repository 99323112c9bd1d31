"""Calls a function as soon as a module is loaded, before anybody can use it."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any


class AfterImport(MetaPathFinder):
    """Finds the module `name` as usual while it waits for it, and calls `then(module)` once it is loaded."""

    def __init__(self, name: str, then: Callable[[ModuleType], object]) -> None:
        self._name = name
        self._then = then

    def wait(self) -> None:
        """Wait for the module from now on."""
        if self not in sys.meta_path:
            sys.meta_path.insert(0, self)

    def forget(self) -> None:
        """Wait no more."""
        if self in sys.meta_path:
            sys.meta_path.remove(self)

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the spec that the other finders have, its loader made to tell us."""
        if fullname != self._name:
            return None
        self.forget()
        try:
            spec = importlib.util.find_spec(fullname)
        finally:
            self.wait()  # who asks for a spec need not load it
        loader: Any = None if spec is None else spec.loader
        if loader is not None:
            load = loader.exec_module

            def load_and_tell(module: ModuleType) -> None:
                load(module)
                self.forget()
                self._then(module)

            loader.exec_module = load_and_tell
        return spec
