"""Entries of the registry: where a name comes from, and how its object is loaded on request."""

from __future__ import annotations

import functools
import importlib
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path

from pytest_drive_robust.errors import (
    DriveRobustError,
    PluginError,
    UnknownNameError,
    did_you_mean,
    from_here,
)
from pytest_drive_robust.registry.agent_factories import PartialFactory, configured
from pytest_drive_robust.registry.exits import exits_raised
from pytest_drive_robust.registry.raised_at import raised_at

KINDS = ("agents", "perturbations", "simulators", "metrics")
"""The kinds of entries; those of a distribution stand in the entry point group `pytest_drive_robust.<kind>`."""

_GROUP = "pytest_drive_robust"


@dataclass(frozen=True, slots=True)
class Entry:
    """A name of one kind (`"agents"`, ...), not loaded yet. `origin` is for messages: `"some-agents 1.2"`.

    `argument` says what may follow the name after a colon (`"ID"`), `""` for nothing. `registered` says that a hook
    registered the name, so that `origin` is a place in a user's file and no distribution.
    """

    kind: str
    name: str
    origin: str
    loader: Callable[[], object]
    advice: str = "Repair or uninstall it; all other entries still work."
    argument: str = ""
    registered: bool = False

    @property
    def syntax(self) -> str:
        """The name as a user writes it: `"embedded"`, `"gymnasium:ID"`."""
        return f"{self.name}:{self.argument}" if self.argument else self.name

    def __str__(self) -> str:
        return f"the {self.kind.removesuffix('s')} {self.name!r} from {self.origin}"

    def bound_to(self, argument: str) -> Entry:
        """Return the entry `name:argument`, which loads this entry and calls the loaded object with `argument`."""

        def load() -> object:
            target = self.loader()
            if not callable(target):
                raise TypeError(f"{target!r} takes no argument, expected a function of the text after the colon")
            made: object = target(argument)
            return made

        return replace(self, name=f"{self.name}:{argument}", loader=load, argument="")

    def with_options(self, text: str) -> Entry:
        """Return the entry `name:text`, whose factory makes agents with these options (see `configured`)."""
        return replace(self, name=f"{self.name}:{text}", loader=lambda: configured(self.name, self.loader(), text))

    def load(self) -> object:
        """Return the object behind the name. Raises `PluginError`, which names the origin, when its import fails."""
        try:
            with exits_raised():
                loaded = self.loader()
        except (DriveRobustError, KeyboardInterrupt):
            raise
        except BaseException as error:  # an import may also call sys.exit() or pytest.skip()
            raise PluginError(
                f"{self} does not load: {type(error).__name__}: {error}{raised_at(error)}. {self.advice}".rstrip()
            ) from error
        return PartialFactory.of(loaded) if self.kind == "agents" else loaded


def from_entry_points() -> dict[str, list[Entry]]:
    """Return the entries that installed distributions declare, by kind, without loading them."""
    installed = metadata.entry_points()  # slow: reads a file of each distribution, for any number of groups
    return {kind: list(_declared(kind, installed.select(group=f"{_GROUP}.{kind}"))) for kind in KINDS}


def unknown_groups() -> list[PluginError]:
    """Return an error for each entry point in a misspelt group, which nobody reads: `pytest_drive_robust.agent`."""
    known = [f"{_GROUP}.{kind}" for kind in KINDS]
    installed = metadata.entry_points()
    told = []
    for group in sorted(installed.groups):
        if group.replace("-", "_").startswith(_GROUP) and group not in known:
            for entry in _declared(group, installed.select(group=group)):
                what = f"{entry.name!r} from {entry.origin} is in an unknown entry point group, {group!r}"
                told.append(PluginError(f"{what}.{did_you_mean(group, known)} Expected one of {', '.join(known)}."))
    return told


def _declared(kind: str, points: Iterable[metadata.EntryPoint]) -> Iterator[Entry]:
    for point in sorted(points, key=lambda point: (point.name, point.value)):
        distribution = point.dist
        origin = "an unknown distribution" if distribution is None else f"{distribution.name} {distribution.version}"
        yield Entry(kind, point.name, origin, point.load)


def is_reference(name: str) -> bool:
    """Return True for `"module.path:Factory"`."""
    module, colon, attribute = name.partition(":")
    return bool(module and colon and attribute)


def from_reference(kind: str, reference: str) -> Entry:
    """Return the entry for `"module.path:Factory"`; the module may lie in the current folder.

    Raises `UnknownNameError` when the module is given as a file.
    """
    module, _, attribute = reference.partition(":")
    if module.endswith(".py") or "/" in module or os.sep in module:
        proper = module.removesuffix(".py").replace(os.sep, ".").replace("/", ".").strip(".")
        raise UnknownNameError(
            f"{reference!r} names a file, expected a module as in an import, seen from the current folder. Give "
            f"'{proper}:{attribute}'."
        )

    def load() -> object:
        folder = os.getcwd()
        if folder not in sys.path and "" not in sys.path:
            # As `python -m` does. The folder stays on the path: the agent may import modules beside it later.
            sys.path.insert(0, folder)
        try:
            target: object = importlib.import_module(module)
        except ModuleNotFoundError as error:
            if not f"{module}.".startswith(f"{error.name}."):  # a module that `module` imports
                raise
            raise PluginError(
                f"the {kind.removesuffix('s')} {reference!r} needs the module {error.name!r}, which is neither "
                f"installed nor in the current folder, {folder}. Put its folder on PYTHONPATH, as in PYTHONPATH=src; "
                "`pythonpath` of the ini file is read by pytest, but not by drive-robust."
            ) from error
        for part in attribute.split("."):
            if not hasattr(target, part):
                offered = [name for name, value in vars(target).items() if name.isidentifier() and callable(value)]
                public = [name for name in offered if not name.startswith("_")]
                raise UnknownNameError.of(f"object in {module}", part, public)
            target = getattr(target, part)
        return target

    return Entry(kind, reference, f"module {module}", load, advice="")


def definition_of(target: object) -> str:
    """Return where a registered class or function is defined, as `"conftest.py:MyAgent"`: equal for one definition."""
    if isinstance(target, functools.partial):
        return definition_of(target.func)
    name = getattr(target, "__qualname__", type(target).__qualname__)
    code = getattr(target, "__code__", None)
    if code is None and isinstance(target, type):
        # The module may be gone from sys.modules (two conftest.py share a name), so the methods are asked first.
        code = next((member.__code__ for member in vars(target).values() if hasattr(member, "__code__")), None)
    filename = code.co_filename if code is not None else None
    if filename is None or filename.startswith("<"):
        return f"{getattr(target, '__module__', 'unknown module')}:{name}"
    line = f":{code.co_firstlineno}" if "<" in name and code is not None else ""
    return f"{from_here(Path(filename))}:{name}{line}"
