"""The factory behind `leaderboard:FILE+CONFIG`, and the facts that identify an official agent in the store."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from pytest_drive_robust.bench2drive import agents as official_agents
from pytest_drive_robust.bench2drive.agent_argument import require_configuration, split_argument
from pytest_drive_robust.bench2drive.agents.adapter import OfficialAgent
from pytest_drive_robust.bench2drive.agents.stand_ins.finder import install_stand_ins
from pytest_drive_robust.bench2drive.asked_variables import asked_variables
from pytest_drive_robust.errors import UnknownNameError, UsageError, from_here
from pytest_drive_robust.runner.cache_key.source_files import code_digest

_METHODS = ("setup", "sensors", "run_step", "set_global_plan", "destroy")


class OfficialAgentFactory:
    """Makes agents of one file with one configuration.

    The identity of the agent has four parts: its code with all that it imports, because the factory wraps the agent's
    class; the content of its configuration files; our code of the bridge; and the environment variables that the agent
    file reads by name.
    """

    def __init__(self, file: Path, config: str) -> None:
        self._file, self._config = file, config
        cls = _agent_class(file)
        self._class = cls
        self.__wrapped__ = cls
        self.__module__ = cls.__module__
        self.__qualname__ = cls.__qualname__
        self.num_cpus = getattr(cls, "num_cpus", 1)
        self.num_gpus = getattr(cls, "num_gpus", 0)

    def __call__(self) -> OfficialAgent:
        """Return a new agent. Raises `UsageError` if the agent cannot be set up or has an unknown sensor."""
        name = f"{self._class.__name__} of {self._file.name}"
        return OfficialAgent(self._class, self._config, name=name)

    def check(self) -> None:
        """Set up an agent and drop it, so that a broken agent raises its `UsageError` at collection already."""
        self()

    @property
    def weights(self) -> tuple[Path, ...]:
        """Every file that the configuration names, including all files in the folders that it names."""
        found: list[Path] = []
        for part in filter(None, self._config.split("+")):
            path = Path(part).expanduser()
            if path.is_file():
                found.append(path)
            elif path.is_dir():
                found += sorted(file for file in path.rglob("*") if file.is_file() and "__pycache__" not in file.parts)
        return tuple(found)

    @property
    def configuration(self) -> Mapping[str, Any]:
        """Everything outside of source and configuration files that decides how the agent drives, by name."""
        asked = sorted({*asked_variables(self._file), "IS_BENCH2DRIVE"})
        return {
            "config": self._config,
            "environment": {name: os.environ.get(name, "") for name in asked},
            "bridge": code_digest([official_agents]),
        }


def leaderboard_agent(argument: str) -> OfficialAgentFactory:
    """Return the factory for `FILE+CONFIG`: a file, and the text for `setup`, which may name files joined by `+`.

    Relative paths start at the current folder. Raises `UsageError` for files that are not there.

    >>> leaderboard_agent("")
    Traceback (most recent call last):
    pytest_drive_robust.errors.UsageError: leaderboard names no agent file: expected \
leaderboard:path/to/agent_file.py, or leaderboard:path/to/agent_file.py+path/to/config.
    """
    file, config = split_argument(argument)
    require_configuration(argument, config)
    return OfficialAgentFactory(file, config)


def _agent_class(file: Path) -> type:
    """Import the file and return the class that its `get_entry_point` names. Raises `UsageError` if there is no class.

    The folder of the file and the current folder are put on `sys.path` and stay there: agents import modules beside
    their file, some while they drive. Our stand-ins take the place of `carla`, `leaderboard`, `srunner` and `agents`
    where these are not installed.
    """
    module = _imported(file)
    entry_point = getattr(module, "get_entry_point", None)
    if not callable(entry_point):
        raise UsageError(
            f"{from_here(file)} has no get_entry_point: expected a function of that name that returns the name of the "
            "agent's class, as the leaderboard asks for."
        )
    name: object = entry_point()
    if not isinstance(name, str):
        raise UsageError(f"get_entry_point of {from_here(file)} returned {name!r}, expected the name of a class.")
    found = getattr(module, name, None)
    if not isinstance(found, type):
        classes = [known for known, value in vars(module).items() if isinstance(value, type)]
        raise UnknownNameError.of(f"class in {from_here(file)}", name, classes, hint="get_entry_point names it.")
    missing = [method for method in _METHODS if not callable(getattr(found, method, None))]
    if missing:
        raise UsageError(
            f"{name} of {from_here(file)} lacks {', '.join(missing)}: expected a subclass of "
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
                f"the agent file {from_here(file)} cannot be imported: {type(error).__name__}: {error}. Its folder and "
                f"the current one, {os.getcwd()}, were on sys.path."
            ) from error
        raise
    return module


def _module_name(file: Path) -> str:
    """Return the stem of the file, as in the leaderboard; made unique where another module has that name."""
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
