"""Calls a function as soon as a module is loaded, before other code can use the module."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any


class AfterImport(MetaPathFinder):
    """Waits for the import of the module `name`, and calls `then(module)` once the module is loaded."""

    def __init__(self, name: str, then: Callable[[ModuleType], object]) -> None:
        self._name = name
        self._then = then

    def wait(self) -> None:
        """Begin to wait for the module."""
        if self not in sys.meta_path:
            sys.meta_path.insert(0, self)

    def forget(self) -> None:
        """Stop waiting for the module."""
        if self in sys.meta_path:
            sys.meta_path.remove(self)

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the spec of the other finders, with a loader that calls `then`."""
        if fullname != self._name:
            return None
        self.forget()
        try:
            spec = importlib.util.find_spec(fullname)
        finally:
            self.wait()  # a search for the spec may not load the module
        loader: Any = None if spec is None else spec.loader
        if loader is not None:
            load = loader.exec_module

            def load_and_tell(module: ModuleType) -> None:
                load(module)
                self.forget()
                self._then(module)

            loader.exec_module = load_and_tell
        return spec
