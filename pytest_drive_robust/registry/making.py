"""Makes the agent or simulator of an entry, and checks what its factory returns."""

from __future__ import annotations

from collections.abc import Callable

from pytest_drive_robust.errors import DriveRobustError, PluginError
from pytest_drive_robust.registry.entries import Entry
from pytest_drive_robust.registry.raised_at import raised_at


def factory_of(entry: Entry) -> Callable[..., object]:
    """Load the factory of an entry. Raises `PluginError` when the factory cannot be called."""
    factory = entry.load()
    if not callable(factory):
        raise PluginError(f"{entry} is {factory!r}, expected a class or a function that makes one.")
    return factory


def made_by(entry: Entry, *arguments: object, protocol: type) -> object:
    """Return a new object from the entry's factory.

    Raises `PluginError` when the factory fails, or when the object lacks a member of `protocol`.
    """
    factory = factory_of(entry)
    try:
        made: object = factory(*arguments)
    except DriveRobustError:
        raise
    except (Exception, SystemExit) as error:  # sys.exit() would end a command, with its own exit code
        raise PluginError(f"{entry} could not be made: {type(error).__name__}: {error}{raised_at(error)}") from error
    if isinstance(made, type):
        raise PluginError(f"{entry} gave the class {made.__name__}, expected an object of it: add the brackets.")
    missing = missing_members(made, protocol)
    if missing:
        raise PluginError(
            f"{entry} lacks {', '.join(missing)}: a {type(made).__name__} does not keep the protocol "
            f"{protocol.__module__}.{protocol.__name__}."
        )
    return made


def missing_members(made: object, protocol: type) -> list[str]:
    """Return the protocol's public members that an object lacks, sorted; a property that raises counts as present."""
    names = {*vars(protocol), *vars(protocol).get("__annotations__", {})}
    public = sorted(name for name in names if not name.startswith("_"))
    return [name for name in public if not (hasattr(type(made), name) or hasattr(made, name))]
