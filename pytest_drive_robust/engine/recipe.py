"""How a fresh process comes to the registry of this run."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import os
import sys
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.simulators.base import SimulatorOptions

if TYPE_CHECKING:
    from pytest_drive_robust.registry import Registry

__all__ = ["Recipe", "plugin_source"]

_HOOK = "pytest_drive_robust_register"
_THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMBA_NUM_THREADS",
)


@dataclass(frozen=True, slots=True)
class Recipe:
    """Everything that a process needs to drive the episodes of a run; plain data that pickles.

    `python_path` becomes `sys.path` and `folder` the current folder. `plugins` are the modules whose hook
    `pytest_drive_robust_register` is called, each with its file, in the order of their registration. `simulator` is a
    name or a reference of the registry. `threads` is what torch, OpenMP, OpenCV and numba may use; `preload_agents`
    are names whose modules are imported once for all processes. `cradle` is where a process of this run listens that
    has loaded the simulator already (see `engine.cradle`), empty where there is none.
    """

    python_path: tuple[str, ...]
    folder: str
    plugins: tuple[tuple[str, str], ...]
    simulator: str
    options: SimulatorOptions = field(default_factory=SimulatorOptions)
    threads: int = 1
    preload_agents: tuple[str, ...] = ()
    cradle: str = ""

    def environment(self) -> dict[str, str]:
        """The environment of the process: ours, with the number of threads for libraries that read it at import."""
        return {**os.environ, **dict.fromkeys(_THREAD_VARIABLES, str(self.threads))}

    def registry(self) -> Registry:
        """In the new process: every name that the run knows. Raises `UsageError` for a plugin that does not load."""
        from pytest_drive_robust.registry import default_registry

        sys.path[:] = self.python_path
        os.chdir(self.folder)
        registry = default_registry()
        for module, file in self.plugins:
            _call_hook(_imported(module, file), registry)
        return registry

    def limit_threads(self) -> None:
        """Tell the libraries that are loaded by now how many threads they may use."""
        cv2: Any = sys.modules.get("cv2")
        if cv2 is not None:
            cv2.setNumThreads(self.threads)
        torch: Any = sys.modules.get("torch")
        if torch is not None:
            torch.set_num_threads(self.threads)


def plugin_source(plugin: object) -> tuple[str, str]:
    """The module and the file of a plugin that registers names, as `Recipe.plugins` holds them.

    Raises `UsageError` for a plugin that no other process could import.
    """
    file = getattr(plugin, "__file__", None) if isinstance(plugin, ModuleType) else None
    if file is None:
        raise UsageError(
            f"the plugin {plugin!r} implements {_HOOK} but is no module in a file, so that the processes that drive "
            "episodes cannot import it. Register the names in a module or a conftest.py, or give "
            "--drive-executor inline."
        )
    return plugin.__name__, str(Path(file).absolute())  # type: ignore[attr-defined]


def _imported(module: str, file: str) -> ModuleType:
    """The module of that name from exactly that file. Two conftest.py files may share a name: the later one gets it."""
    known = sys.modules.get(module)
    if known is not None and _is_file(known.__file__, file):
        return known
    try:
        if "." in module and _is_file(getattr(_spec(module), "origin", None), file):
            return importlib.import_module(module)
        spec = importlib.util.spec_from_file_location(module, file)
        if spec is None or spec.loader is None:
            raise ImportError(f"{file} is no Python module")
        made = importlib.util.module_from_spec(spec)
        sys.modules[module] = made
        spec.loader.exec_module(made)
    except BaseException as error:  # an import may also call sys.exit() or pytest.skip()
        raise UsageError(
            f"the plugin {module} ({file}) does not load in the processes that drive episodes: "
            f"{type(error).__name__}: {error}. What it needs must not depend on pytest having started; or give "
            "--drive-executor inline."
        ) from error
    return made


def _call_hook(module: ModuleType, registry: Registry) -> None:
    hook = getattr(module, _HOOK, None)
    if hook is None:
        return
    wanted = inspect.signature(hook).parameters
    hook(**({"registry": registry} if "registry" in wanted else {}))


def _spec(module: str) -> object:
    try:
        return importlib.util.find_spec(module)
    except (ImportError, ValueError):
        return None


def _is_file(found: str | None, file: str) -> bool:
    return found is not None and os.path.realpath(found) == os.path.realpath(file)
