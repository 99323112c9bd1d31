"""Factories of agents with some of their parameters given: by `functools.partial`, or by options after the name."""

from __future__ import annotations

import functools
import inspect
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pytest_drive_robust.errors import PluginError, UnknownNameError, UsageError

_BETWEEN = "+"
"""Stands between two options: `mode=ctrl+engine=onnx`."""
_FLAGS = {"true": True, "false": False}


class PartialFactory(functools.partial[Any]):
    """A factory with some of its parameters given. Attributes that this object lacks are read from the factory."""

    @classmethod
    def of(cls, factory: Any) -> Any:
        """Return a `functools.partial` as an object of this class; return any other factory unchanged."""
        if type(factory) is not functools.partial:
            return factory
        made = cls(factory.func, *factory.args, **factory.keywords)
        vars(made).update(vars(factory))
        return made

    def __getattr__(self, name: str) -> Any:
        return getattr(self.func, name)

    @property
    def weights(self) -> Any:
        """The files and folders that the factory names in `weights`, and the existing paths among its parameters."""
        said = vars(self)
        named: Any = said["weights"] if "weights" in said else getattr(self.func, "weights", None)
        chosen = [value for value in self._given().values() if is_there(value)]
        return [*listed(named), *chosen] if chosen else named

    def check(self) -> None:
        """Call the factory's own `check`, if any, with the given parameters that `check` takes."""
        check, given = check_of(self.func), self._given()
        if check is not None:
            known = inspect.signature(check).parameters.values()
            takes_all = any(parameter.kind is parameter.VAR_KEYWORD for parameter in known)
            names = given if takes_all else {parameter.name for parameter in known}
            check(**{name: value for name, value in given.items() if name in names})

    def _given(self) -> Mapping[str, Any]:
        names = inspect.signature(self.func).parameters if self.args else ()
        return {**dict(zip(names, self.args, strict=False)), **self.keywords}


class ConfiguredFactory(PartialFactory):
    """A factory with the options that followed the agent's name."""


def paths_named(owner: object) -> list[Any]:
    """Return what a factory or an agent names in `weights`, item by item; items that are no paths as they are."""
    return listed(getattr(owner, "weights", None))


def listed(weights: Any) -> list[Any]:
    """Return a value of `weights`, which is a path, a list of paths or None, as a list."""
    return list(weights) if isinstance(weights, (list, tuple)) else [] if weights is None else [weights]


def is_there(value: object) -> bool:
    """Return whether a value is the path of a file or folder that exists."""
    return isinstance(value, (str, os.PathLike)) and os.path.exists(value)


def check_of(factory: object) -> Callable[..., object] | None:
    """Return the factory's `check`, which finds problems before an agent is made; None if only its objects have one."""
    check = getattr(factory, "check", None)
    is_for_objects = isinstance(factory, type) and inspect.isfunction(inspect.getattr_static(factory, "check", None))
    return check if callable(check) and not is_for_objects else None


def configured(agent: str, factory: object, text: str) -> ConfiguredFactory:
    """Return the factory with the options of a text such as `"mode=ctrl+engine=onnx"`.

    An option is a parameter of the factory with a default. The option's value has the default's type: a number, a word,
    a path, `true` or `false`; a word when the default is None. Raises `UsageError` for an option that does not parse,
    `UnknownNameError` for an option that the agent does not have; both name `agent`. Raises `PluginError` when the
    factory cannot be called.
    """
    if not callable(factory):
        raise PluginError(f"the agent {agent!r} is {factory!r}, expected a class or a function that makes one.")
    known = {
        name: parameter.default
        for name, parameter in inspect.signature(factory).parameters.items()
        if parameter.default is None or isinstance(parameter.default, (bool, int, float, str, os.PathLike))
    }
    options: dict[str, object] = {}
    for option in text.split(_BETWEEN):
        name, equals, value = option.partition("=")
        if not equals or not value or name in options:
            raise UsageError(
                f"{option!r} in {agent + ':' + text!r} is not an option of an agent: expected NAME=VALUE, each NAME "
                f"once, with {_BETWEEN!r} between two options."
            )
        if name not in known:
            raise UnknownNameError.of(f"option of the agent {agent!r}", name, known)
        options[name] = _value(agent, name, value, known[name])
    return ConfiguredFactory(PartialFactory.of(factory), **options)


def _value(agent: str, name: str, text: str, default: object) -> object:
    """Return `text` as a value of the default's type. Raises `UsageError` when that is not possible."""
    if default is None or isinstance(default, str):
        return text
    if isinstance(default, os.PathLike):
        return Path(text)
    kind: Callable[[str], object] = _FLAGS.__getitem__ if isinstance(default, bool) else type(default)
    try:
        return kind(text)
    except (KeyError, ValueError):
        number = "a whole number" if isinstance(default, int) else "a number"
        expected = "true or false" if isinstance(default, bool) else f"{number}, as in {name}={default}"
        raise UsageError(f"the option {name!r} of the agent {agent!r} is {text!r}, expected {expected}.") from None
