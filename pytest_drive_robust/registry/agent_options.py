"""Options in the name of an agent: `blind:speed=8`, `tcp:mode=ctrl+engine=onnx`."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any

from pytest_drive_robust.errors import PluginError, UnknownNameError, UsageError

_BETWEEN = "+"
_FLAGS = {"true": True, "false": False}


class ConfiguredFactory(functools.partial[Any]):
    """A factory with some of its options chosen; what it tells about its agents is what the factory tells."""

    def __getattr__(self, name: str) -> Any:
        return getattr(self.func, name)


def are_options(text: str) -> bool:
    """Return whether the text after an agent's colon is options.

    >>> are_options("speed=8"), are_options("MyAgent")
    (True, False)
    """
    return "=" in text


def configured(agent: str, factory: object, text: str) -> ConfiguredFactory:
    """Return the factory with the options of a text such as `"mode=ctrl+engine=onnx"`.

    An option is a parameter of the factory that has a default: its values are of the default's type (a number, a word,
    `true` or `false`), words where the default is None. Raises `UsageError` for an option that is not understood and
    `UnknownNameError` for one that the agent does not have; both name `agent`.
    """
    if not callable(factory):
        raise PluginError(f"the agent {agent!r} is {factory!r}, expected a class or a function that makes one.")
    known = {
        name: parameter.default
        for name, parameter in inspect.signature(factory).parameters.items()
        if parameter.default is None or isinstance(parameter.default, (bool, int, float, str))
    }
    options: dict[str, object] = {}
    for option in text.split(_BETWEEN):
        name, equals, value = option.partition("=")
        if not equals or not value or name in options:
            raise UsageError(
                f"{option!r} in {agent + ':' + text!r} is no option of an agent: expected NAME=VALUE, each name once, "
                f"several with {_BETWEEN!r} between them."
            )
        if name not in known:
            raise UnknownNameError.of(f"option of the agent {agent!r}", name, known)
        options[name] = _value(agent, name, value, known[name])
    return ConfiguredFactory(factory, **options)


def _value(agent: str, name: str, text: str, default: object) -> object:
    """Return the value that the text says, of the default's type."""
    if default is None or isinstance(default, str):
        return text
    kind: Callable[[str], object] = _FLAGS.__getitem__ if isinstance(default, bool) else type(default)
    try:
        return kind(text)
    except (KeyError, ValueError):
        expected = "true or false" if isinstance(default, bool) else f"a number, as in {name}={default}"
        raise UsageError(f"the option {name!r} of the agent {agent!r} is {text!r}, expected {expected}.") from None
