"""Versions of Python and of installed distributions, which stand for the content of their files."""

from __future__ import annotations

import functools
import importlib.util
import os
import sys
from collections.abc import Iterable
from importlib import metadata
from importlib.machinery import ModuleSpec
from pathlib import Path

from pytest_drive_robust.runner.cache_key.digests import hex_of

_STANDARD = Path(os.__file__).parent
_VERSION_FILES = ("__init__.py", "version.py", "_version.py")


def versions_of(modules: Iterable[str]) -> dict[str, str]:
    """Return the versions of Python and of these modules, by name; `"absent"` for a module that is not installed."""
    found = {name: find_module(name) for name in modules}
    versions = {
        name: "absent" if spec is None or spec.origin is None else version_of(name, Path(spec.origin).resolve())
        for name, spec in sorted(found.items())
    }
    return {**python_version(), **versions}


def python_version() -> dict[str, str]:
    """Return the major and minor version of Python: a patch version changes no result."""
    return {"python": f"{sys.version_info[0]}.{sys.version_info[1]}"}


@functools.cache
def version_of(module: str, origin: Path) -> str:
    """Return the version of the distribution named as the module, or else a digest of the files that hold versions."""
    try:
        return metadata.version(module.partition(".")[0])
    except (metadata.PackageNotFoundError, ValueError):
        files = [origin.with_name(name) for name in _VERSION_FILES] if origin.name == "__init__.py" else [origin]
        return hex_of(b"".join(path.read_bytes() for path in files if path.is_file()))


def is_installed(file: Path) -> bool:
    """Return whether a file belongs to an installed distribution, whose version identifies its content."""
    return not {"site-packages", "dist-packages"}.isdisjoint(file.parts)


def is_standard(top: str, spec: ModuleSpec) -> bool:
    """Return whether `spec` is a module of the standard library, not another module with its name."""
    if top not in sys.stdlib_module_names:
        return False
    return not (spec.origin or "").endswith(".py") or Path(str(spec.origin)).is_relative_to(_STANDARD)


def find_module(name: str) -> ModuleSpec | None:
    """Return where a module of this name lies, without importing it; None when it is not found."""
    try:
        return importlib.util.find_spec(name)
    except (ImportError, ValueError, AttributeError):
        return None
