"""Plugins with the hook `pytest_drive_robust_register`: found in pytest, and called without pytest."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import os
import sys
import traceback
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from pytest_drive_robust.errors import DriveRobustError, UsageError, from_here
from pytest_drive_robust.registry.raised_at import raised_at

if TYPE_CHECKING:
    from pluggy import PluginManager

    from pytest_drive_robust.registry.registry import Registry

HOOK = "pytest_drive_robust_register"
"""The hook that `hookspecs` specifies."""
_CONFTEST = "conftest.py"


def naming_plugins(manager: PluginManager) -> list[object]:
    """Return the pytest plugins that register names, in the order of their registration."""
    return [plugin for _, plugin in manager.list_name_plugin() if plugin is not None and hasattr(plugin, HOOK)]


def plugin_source(plugin: object) -> tuple[str, str]:
    """Return the module and the file of a plugin that registers names.

    Raises `UsageError` for a plugin that is no module in a file, because no other process could import that plugin.
    """
    if not isinstance(plugin, ModuleType) or plugin.__file__ is None:
        raise UsageError(
            f"the plugin {plugin!r} has {HOOK}, but the worker processes cannot import it, because it is not a module "
            "in a file. Register the names in a module or a conftest.py, or give --drive-executor inline."
        )
    return plugin.__name__, str(Path(plugin.__file__).absolute())


def plugin_words(manager: PluginManager) -> tuple[str, ...]:
    """Return the arguments of `drive-robust -p` for plugins that register names: modules, or paths of `conftest.py`.

    A path is relative for a file below the current folder. A plugin that is no module in a file is left out.
    """
    modules = [plugin for plugin in naming_plugins(manager) if isinstance(plugin, ModuleType) and plugin.__file__]
    return tuple(_word(module.__name__, Path(str(module.__file__)).absolute()) for module in modules)


def register_names_of(word: str, registry: Registry) -> None:
    """Let the plugin `word`, a module or a file, register its names.

    A file is imported as pytest imports it: its folder, or the folder that holds its package, comes first on
    `sys.path`. Raises `UsageError` when the import or the hook fails.
    """
    try:
        if word.endswith(".py"):
            file = Path(word).absolute()
            if not file.is_file():
                raise UsageError(f"-p is {word!r}, but there is no such file. Looked from the folder {Path.cwd()}.")
            folder, name = _folder_and_name(file)
            _prepend(folder)
            module = imported_from(name, str(file))
        else:
            _prepend(Path.cwd())
            module = importlib.import_module(word)
    except (UsageError, KeyboardInterrupt):
        raise
    except BaseException as error:  # an import may also call sys.exit() or pytest.skip()
        raise UsageError(
            f"-p is {word!r}, expected a module that can be imported or the path of a conftest.py: "
            f"{type(error).__name__}: {error}{raised_at(error)}."
        ) from error
    if not hasattr(module, HOOK):
        raise UsageError(f"-p is {word!r}, which registers no names: it has no function {HOOK}(registry).")
    try:
        call_hook(module, registry)
    except (DriveRobustError, KeyboardInterrupt):
        raise
    except BaseException as error:  # it may also call sys.exit()
        raise UsageError(
            f"-p is {word!r}, but its {HOOK}{_signature(module)} raised {type(error).__name__}: {error}"
            f"{_place_in(module, error)}. Expected {HOOK}(registry), which registers names."
        ) from error


def imported_from(module: str, file: str) -> ModuleType:
    """Return the module `module`, loaded from exactly `file`. A module that raises is removed from `sys.modules`.

    Two conftest.py files may share a name; the later file takes the name in `sys.modules`.
    """
    known = sys.modules.get(module)
    if known is not None and _is_file(known.__file__, file):
        return known
    if "." in module and _is_file(getattr(_spec(module), "origin", None), file):
        return importlib.import_module(module)
    spec = importlib.util.spec_from_file_location(module, file)
    if spec is None or spec.loader is None:
        raise ImportError(f"{file} is not a Python module")
    made = importlib.util.module_from_spec(spec)
    sys.modules[module] = made
    try:
        spec.loader.exec_module(made)
    except BaseException:
        sys.modules.pop(module, None)
        raise
    return made


def call_hook(module: ModuleType, registry: Registry) -> None:
    """Call the hook of a module, if the module has the hook. As in pluggy, a hook may leave out `registry`."""
    hook = getattr(module, HOOK, None)
    if hook is None:
        return
    wanted = inspect.signature(hook).parameters
    hook(**({"registry": registry} if "registry" in wanted else {}))


def _signature(module: ModuleType) -> str:
    try:
        return str(inspect.signature(getattr(module, HOOK)))
    except (TypeError, ValueError):  # no function
        return ""


def _place_in(module: ModuleType, error: BaseException) -> str:
    """Return `" (file:line)"`, the module's file and its last line in the error's traceback; else `" (file)"`."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if _is_file(module.__file__, frame.filename)]
    return f" ({module.__file__}:{frames[-1].lineno})" if frames else f" ({module.__file__})"


def _word(module: str, file: Path) -> str:
    return from_here(file).as_posix() if file.name == _CONFTEST else module


def _folder_and_name(file: Path) -> tuple[Path, str]:
    """Return the folder and the module name of a file: `a`, `b.conftest` for `a/b/conftest.py` with `b/__init__.py`."""
    folder, parts = file.parent, [file.stem]
    while (folder / "__init__.py").is_file():
        parts.insert(0, folder.name)
        folder = folder.parent
    return folder, ".".join(parts)


def _prepend(folder: Path) -> None:
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))  # stays: a plugin may import modules beside it later


def _spec(module: str) -> object:
    try:
        return importlib.util.find_spec(module)
    except (ImportError, ValueError):
        return None


def _is_file(found: str | None, file: str) -> bool:
    return found is not None and os.path.realpath(found) == os.path.realpath(file)
