"""From an agent file to the class that its `get_entry_point` names, as the leaderboard's evaluator finds it."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
import sys
from pathlib import Path
from types import ModuleType

from pytest_drive_robust.bench2drive.agents.stand_ins.finder import install_stand_ins
from pytest_drive_robust.errors import UnknownNameError, UsageError

__all__ = ["load_agent_class"]

_METHODS = ("setup", "sensors", "run_step", "set_global_plan", "destroy")


def load_agent_class(file: Path) -> type:
    """Import the file and give its agent class. Raises `UsageError` when it has none.

    The folder of the file and the current one are put on `sys.path`, and stay: agents import their neighbours, some of
    them while they drive. Where no `carla`, `leaderboard`, `srunner` or `agents` is installed ours take their place.
    """
    module = _imported(file)
    entry_point = getattr(module, "get_entry_point", None)
    if not callable(entry_point):
        raise UsageError(
            f"{_shown(file)} has no get_entry_point: expected a function of that name that returns the name of the "
            "agent's class, as the leaderboard asks for."
        )
    name: object = entry_point()
    if not isinstance(name, str):
        raise UsageError(f"get_entry_point of {_shown(file)} returned {name!r}, expected the name of a class.")
    found = getattr(module, name, None)
    if not isinstance(found, type):
        classes = [known for known, value in vars(module).items() if isinstance(value, type)]
        raise UnknownNameError.of(f"class in {_shown(file)}", name, classes, hint="get_entry_point names it.")
    missing = [method for method in _METHODS if not callable(getattr(found, method, None))]
    if missing:
        raise UsageError(
            f"{name} of {_shown(file)} lacks {', '.join(missing)}: expected a subclass of "
            "leaderboard.autoagents.autonomous_agent.AutonomousAgent."
        )
    return found


def _imported(file: Path) -> ModuleType:
    name = _module_name(file)
    if name in sys.modules:
        return sys.modules[name]
    install_stand_ins()
    for folder in (os.getcwd(), str(file.parent)):
        if folder not in sys.path:
            sys.path.insert(0, folder)
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None  # a file that ends in .py has a loader
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException as error:
        del sys.modules[name]
        if isinstance(error, (Exception, SystemExit)):
            raise UsageError(
                f"the agent file {_shown(file)} cannot be imported: {type(error).__name__}: {error}. Its folder and "
                f"the current one, {os.getcwd()}, were on sys.path."
            ) from error
        raise
    return module


def _module_name(file: Path) -> str:
    """Return the stem, as in the leaderboard; made unique where something else has that name already."""
    name = re.sub(r"\W", "_", file.stem)
    known = sys.modules.get(name)
    if known is not None:
        origin = getattr(known, "__file__", None)
    else:
        spec = importlib.util.find_spec(name)
        origin = None if spec is None else spec.origin or "a package"
        if spec is None:
            return name
    if origin is not None and Path(origin).resolve() == file:
        return name
    return f"{name}_{hashlib.blake2b(str(file).encode(), digest_size=4).hexdigest()}"


def _shown(file: Path) -> str:
    here = Path.cwd()
    return str(file.relative_to(here)) if file.is_relative_to(here) else str(file)
