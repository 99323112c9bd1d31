"""Agents, perturbations, simulators and metrics by name.

A name gets into the registry in three ways:

* an entry point of an installed distribution, in the group `pytest_drive_robust.agents`, `.perturbations`,
  `.simulators` or `.metrics`; it is listed without an import, and imported when its name is requested;
* the hook `pytest_drive_robust_register` in a plugin or a `conftest.py`, which wins over an entry point of that name;
* for agents and simulators, a reference `module.path:Factory` in place of a name.

Names of agents and simulators may take an argument after a colon: `leaderboard:agent.py+config`, `gymnasium:ID`. Other
agents take options there, the parameters of their factories: `blind:speed=8` (see `agent_factories`).
"""

from __future__ import annotations

import functools
import itertools
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from types import CellType, FunctionType
from typing import cast

from pytest_drive_robust.domain.agent import Agent
from pytest_drive_robust.errors import (
    DriveRobustError,
    PluginError,
    UnknownNameError,
    UsageError,
)
from pytest_drive_robust.metrics.table import METRICS, MetricFunction
from pytest_drive_robust.perturbations.base import Perturbation
from pytest_drive_robust.perturbations.sentence_forms import kebab_name
from pytest_drive_robust.registry.built_in import BUILT_IN, built_in_entries, is_built_in_simulator
from pytest_drive_robust.registry.entries import (
    KINDS,
    Entry,
    definition_of,
    from_entry_points,
    from_reference,
    is_reference,
    unknown_groups,
)
from pytest_drive_robust.registry.making import factory_of, made_by
from pytest_drive_robust.registry.perturbation_classes import check_told_apart, checked_class
from pytest_drive_robust.registry.unknown_names import (
    declared_twice,
    is_misspelt,
    is_module,
    takes_nothing,
    unknown_agent_with_options,
    unknown_name,
)
from pytest_drive_robust.simulators.base import Simulator, SimulatorOptions

AgentFactory = Callable[[], Agent]
"""A class or function that makes a new agent, called without arguments."""
SimulatorFactory = Callable[[SimulatorOptions], Simulator] | Callable[[SimulatorOptions, str], Simulator]
"""A class or function that makes a new world from the options and, with an argument, the text after the colon."""

AgentFactories = Callable[[str], AgentFactory]
"""A function that makes the factory of one agent from the text after the colon of the agent's name."""

_NO_METRIC = re.compile(r"[\s#≤≥]|<=|>=")
"""Characters that no metric's name may have: `verdict.sentences` reads one word before "under" as the metric."""


class Registry:
    """The names that one process knows. Requesting a name loads only that entry."""

    def __init__(self) -> None:
        self._registered: dict[tuple[str, str], Entry] = {}
        self._problems: dict[str, DriveRobustError] = {}  # of perturbations, by name
        self._perturbations: dict[str, type[Perturbation]] = {}  # classes that passed the checks, by name
        self._told_apart: set[tuple[type[Perturbation], type[Perturbation]]] = set()
        self._installed: dict[str, list[Entry]] | None = None  # entry points by kind: finding them reads disk
        self._declared: dict[str, tuple[Entry, ...]] = {}  # built-ins and entry points, by kind

    def register_agent(self, name: str, factory: AgentFactory | AgentFactories, *, argument: str = "") -> None:
        """Make `--drive-agent name` call `factory()`. Raises `UsageError` when the name is taken by another hook.

        `argument` is for a family of agents: with `argument="FILE"` the name is listed as `name:FILE`, and
        `--drive-agent name:text` calls `factory("text")()`; without a colon the text is empty.
        """
        self._register("agents", name, factory, argument=argument)

    def register_perturbation(self, cls: type[Perturbation], name: str | None = None) -> None:
        """Let requirement sentences use the `phrase` of `cls`. The name is the class's in kebab case by default.

        Raises `PluginError` when `cls` is no dataclass derived from `Perturbation`, or when its phrase cannot be parsed
        back or belongs to a built-in perturbation; `UsageError` when the name is taken by another hook, or built in.
        """
        from pytest_drive_robust.perturbations import BUILTIN

        name = name or kebab_name(cls if isinstance(cls, type) else type(cls))
        if name in BUILTIN and cls is not BUILTIN[name]:
            raise UsageError(f"{name!r} is a built-in perturbation and keeps its meaning: give yours another name.")
        checked_class(cls, definition_of(cls), name)
        self._register("perturbations", name, cls)

    def register_simulator(self, name: str, factory: SimulatorFactory, *, argument: str = "") -> None:
        """Make `--drive-sim name` call `factory(options)`.

        `argument` is for a family of worlds: with `argument="ID"` the name is listed as `name:ID`, and
        `--drive-sim name:text` calls `factory(options, "text")`; without a colon the text is empty. Raises `UsageError`
        when the name is taken by another hook, or built in.
        """
        if is_built_in_simulator(name):
            raise UsageError(f"{name!r} is a built-in simulator and keeps its meaning: give yours another name.")
        self._register("simulators", name, factory, argument=argument)

    def register_metric(self, name: str, function: MetricFunction) -> None:
        """Let requirements use your own metric: `function(results of one setting)` returns a number, None for no data.

        Raises `UsageError` for the name of a built-in metric, which must mean the same everywhere, and for a name that
        no sentence can hold.
        """
        problem = _metric_name_problem(name)
        if problem:
            raise UsageError(problem)
        self._register("metrics", name, function)

    def agent(self, name: str) -> Agent:
        """Return a new agent. `name` is a registered name or `module.path:Factory`.

        Raises `UnknownNameError` for an unknown name, and `PluginError` when the object does not load or is no agent.
        """
        return cast("Agent", made_by(self.entry("agents", name), protocol=Agent))

    def simulator(self, name: str, options: SimulatorOptions | None = None) -> Simulator:
        """Return a new world.

        `name` is a registered name, perhaps with an argument (`gymnasium:roundabout-v0`), or `module.path:Factory`.
        Raises as `agent` does, and whatever `DriveRobustError` the factory raises.
        """
        entry = self.entry("simulators", name)
        argument = (name.partition(":")[2],) if entry.argument else ()
        return cast("Simulator", made_by(entry, options or SimulatorOptions(), *argument, protocol=Simulator))

    def perturbation(self, name: str) -> type[Perturbation]:
        """Return the class of that name (`"gps-noise"`). Raises `UnknownNameError` or `PluginError`."""
        entry = self.entry("perturbations", name)
        return checked_class(entry.load(), entry.origin, name)

    def perturbations(self) -> dict[str, type[Perturbation]]:
        """Return every usable perturbation class, by name.

        A class that does not load, and classes that share a sentence, are left out; `problems` lists them.
        """
        classes: dict[str, type[Perturbation]] = {}
        self._problems.clear()
        for name, _ in self.names("perturbations"):
            try:
                classes[name] = self._checked_perturbation(name)
            except DriveRobustError as error:  # noqa: PERF203 - one that is broken stops no other
                self._problems[name] = error
        for name in self._indistinct(classes):
            del classes[name]
        return classes

    def _indistinct(self, classes: Mapping[str, type[Perturbation]]) -> set[str]:
        """Return the names of perturbations that share a sentence. A pair that passed once is not compared again."""
        from pytest_drive_robust.perturbations import BUILTIN

        found: set[str] = set()
        others = [name for name in classes if name not in BUILTIN]
        for names in itertools.combinations(others, 2):
            (one, other), (cls, other_cls) = names, (classes[name] for name in names)
            if (cls, other_cls) in self._told_apart:
                continue
            try:
                check_told_apart(self.entry("perturbations", one), cls, self.entry("perturbations", other), other_cls)
                self._told_apart.add((cls, other_cls))
            except PluginError as error:
                self._problems[one] = error
                found.update(names)
        return found

    def _checked_perturbation(self, name: str) -> type[Perturbation]:
        """Return the class as `perturbation` does; a class that passed the checks once is not checked again."""
        loaded = self.entry("perturbations", name).load()
        if self._perturbations.get(name) is not loaded:
            self._perturbations[name] = self.perturbation(name)
        return self._perturbations[name]

    def metric(self, name: str) -> MetricFunction:
        """Return the function of that name. Raises `UnknownNameError` or `PluginError`."""
        entry = self.entry("metrics", name)
        function = entry.load()
        if not callable(function):
            raise PluginError(f"{entry} is {function!r}, expected a function.")
        return cast("MetricFunction", function)

    def names(self, kind: str) -> list[tuple[str, str]]:
        """Return (name, origin) of every entry of a kind, sorted, nothing loaded.

        The name of an entry with an argument is `gymnasium:ID`.
        """
        return sorted(
            (found[0].syntax, " and ".join(entry.origin for entry in found)) for found in self._all(kind).values()
        )

    def entry(self, kind: str, name: str) -> Entry:
        """Return the entry of a name, not loaded.

        Raises `UnknownNameError` for an unknown name, and `PluginError` for a name that is declared twice.
        """
        known = self._all(kind)
        bare, colon, argument = name.partition(":")
        takes_options = kind == "agents" and colon and name not in known and "=" in argument
        if colon and bare in known and (known[bare][0].argument or takes_options):
            name = bare
        if name not in known:
            if takes_options:
                raise unknown_agent_with_options(name, known)
            if kind in ("agents", "simulators") and is_reference(name):
                if bare in known and not is_module(bare):
                    raise takes_nothing(kind, bare, argument)
                if not is_misspelt(bare, known):
                    return from_reference(kind, name)
            raise unknown_name(kind, name, known)
        if len(known[name]) > 1:
            raise declared_twice(known[name])
        found = known[name][0]
        if kind == "agents" and found.argument:
            return found.bound_to(argument)
        return found.with_options(argument) if takes_options else found

    def require(self, kind: str, name: str) -> None:
        """Load an entry without making an object from it. Raises `UnknownNameError` or `PluginError`."""
        factory_of(self.entry(kind, name))

    def problems(self) -> tuple[DriveRobustError, ...]:
        """Return an error for each unusable entry; perturbations as the last call of `perturbations` found them."""
        found = [self._problems[name] for name in sorted(self._problems)]
        return (*found, *self._misnamed_metrics(), *unknown_groups())

    def _misnamed_metrics(self) -> Iterator[PluginError]:
        for entry in itertools.chain.from_iterable(self._all("metrics").values()):
            problem = "" if entry.origin == BUILT_IN else _metric_name_problem(entry.name)
            if problem:
                yield PluginError(f"{entry} cannot be used: {problem}")

    def _register(self, kind: str, name: str, target: Callable[..., object], *, argument: str = "") -> None:
        if not name or ":" in name or name != name.strip():
            raise UsageError(f"{name!r} cannot be a name of {kind}: expected text without ':' or outer spaces.")
        if not callable(target):
            raise UsageError(f"{name!r} is registered among the {kind} as {target!r}, expected a class or a function.")
        definition = definition_of(target)
        known = self._registered.get((kind, name))
        if known is not None and known.origin != definition:  # equal: a conftest.py was imported once more
            raise UsageError(
                f"{name!r} of {kind} is registered twice: by {known.origin} and by {definition}. Rename one of them."
            )
        if known is not None and (one := _plain_options(known.load())) != (other := _plain_options(target)):
            raise UsageError(
                f"{name!r} of {kind} is registered twice: by {definition} with {one} and with {other}. Rename one of "
                "them."
            )
        entry = Entry(kind, name, definition, lambda: target, argument=argument, registered=True)
        self._registered[kind, name] = entry

    def _all(self, kind: str) -> dict[str, list[Entry]]:
        if kind not in KINDS:
            raise UnknownNameError.of("kind of entry", kind, KINDS)
        if self._installed is None:
            self._installed = from_entry_points()
        if kind not in self._declared:
            self._declared[kind] = (*built_in_entries(kind), *self._installed[kind])
        found: dict[str, list[Entry]] = {}
        for entry in self._declared[kind]:
            found.setdefault(entry.name, []).append(entry)
        for (registered_kind, name), entry in self._registered.items():
            if registered_kind == kind:
                found[name] = [entry]
        return found


_IN_USE: list[Registry] = []
"""The registries of nested pytest sessions in this process, outermost first; the last registry is in use."""


def default_registry() -> Registry:
    """Return the registry of this process: built-ins, entry points, and what hooks registered."""
    if not _IN_USE:
        _IN_USE.append(Registry())
    return _IN_USE[-1]


def hide_names() -> int:
    """Put a registry without hook-registered names in use; return the number that `forget_names` takes to undo this."""
    _IN_USE.append(Registry())
    return len(_IN_USE) - 1


def forget_names(kept: int = 0) -> None:
    """Forget names that hooks registered; with `kept` from `hide_names`, bring the hidden names back."""
    del _IN_USE[kept:]


def _plain_options(target: object) -> dict[str, object]:
    """Return the comparable values that a factory was made with, text, numbers and paths, by name or by position.

    They are the arguments of a `functools.partial`, the variables around an inner function and its defaults, and the
    attributes of a callable object.
    """
    if isinstance(target, functools.partial):
        given = {**_plain_options(target.func), **_by_place(target.args), **target.keywords}
    elif isinstance(target, FunctionType):
        names, cells = target.__code__.co_freevars, target.__closure__ or ()
        around = {name: cell.cell_contents for name, cell in zip(names, cells, strict=True) if cell != CellType()}
        given = {**around, **_by_place(target.__defaults__ or ()), **(target.__kwdefaults__ or {})}
    else:
        given = {} if isinstance(target, type) else dict(getattr(target, "__dict__", {}))
    return {name: value for name, value in given.items() if isinstance(value, (str, int, float, os.PathLike))}


def _by_place(values: Iterable[object]) -> dict[str, object]:
    return {str(place): value for place, value in enumerate(values)}


def _metric_name_problem(name: str) -> str:
    """Return why a metric cannot have this name; `""` when the name is allowed."""
    if name in METRICS:
        return f"{name!r} is a built-in metric and keeps its meaning: give yours another name."
    if not _NO_METRIC.search(name):
        return ""
    plain = re.sub(r"\W+", "_", name).strip("_") or "my_metric"
    return (
        f"{name!r} cannot name a metric: in a requirement a metric is one word without '#', '<=' and '>='. Call it "
        f"{plain!r}, for example."
    )
