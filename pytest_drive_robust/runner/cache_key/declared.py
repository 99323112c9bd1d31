"""Checks that an agent's factory declares what decides the keys: keys are made before any agent object.

`weights`, `configuration` and `computed_by` that only the agent object has are in no key: they could change, and stored
episodes of the old agent would be taken for those of the new one.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from types import FunctionType

from pytest_drive_robust.domain.agent import computing_modules
from pytest_drive_robust.errors import PluginError
from pytest_drive_robust.registry.agent_factories import ConfiguredFactory, is_there, paths_named
from pytest_drive_robust.runner.cache_key.canonical_text import canonical_text


def require_declared(name: str, agent: object, factory: object) -> None:
    """Raise `PluginError` when the agent `name` declares an attribute of its keys that its factory does not declare."""
    own = list(undeclared(agent, factory))
    if not own:
        return
    made_by, cls = getattr(factory, "func", factory), type(agent)
    place = getattr(made_by, "__name__", type(made_by).__name__)
    given = " and ".join(f"{attribute} = {getattr(agent, attribute)!r}" for attribute in own)
    lines = [f"{place}.{attribute} = {_known_as(cls, attribute)}" for attribute in own]
    where = f"in the body of the class {place}, not in __init__" if made_by is cls else f"with `{'; '.join(lines)}`"
    raise PluginError(
        f"the agent {name!r} has {given}, but {place}, which makes the agent, does not declare that. Stored episodes "
        f"are found by what {place} declares, so a change would go unseen. Declare it {where}."
    )


def _known_as(cls: type, attribute: str) -> str:
    return f"{cls.__name__}.{attribute}" if hasattr(cls, attribute) else "..."


def undeclared(agent: object, factory: object) -> Iterator[str]:
    """Yield the attributes of an agent that decide its keys and that its factory lacks or has with another value.

    A factory may name more files and modules than the agent. Values that cannot be compared are ignored: loaded
    weights, or a configuration without plain values. Options of a configured factory may choose `computed_by`. A
    factory object that names files or a configuration is trusted, because it may give the agent its own values.
    """
    is_object = not isinstance(getattr(factory, "func", factory), (type, FunctionType))
    files = _files(factory)
    if not {*_files(agent)} <= {*files} and not (is_object and files):
        yield "weights"
    configuration, told = _plain(agent), _plain(factory)
    if configuration is not None and configuration != told and not (is_object and told is not None):
        yield "configuration"
    if not isinstance(factory, ConfiguredFactory) and not {*_modules(agent)} <= {*_modules(factory)}:
        yield "computed_by"


def _files(owner: object) -> list[str]:
    """Return the absolute paths of the files in `weights` that exist."""
    return [os.path.abspath(file) for file in paths_named(owner) if is_there(file)]


def _plain(owner: object) -> str | None:
    """Return the text of `configuration`, None when it has no comparable value."""
    given = getattr(owner, "configuration", None)
    try:
        return None if given is None else canonical_text(given)
    except TypeError:
        return None


def _modules(owner: object) -> tuple[str, ...]:
    return computing_modules(owner) or ()
