"""What is around an agent in a worker process, for what is driven, or looked at, in the process of the run."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Mapping, MutableMapping
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def as_in_worker(folder: Path | str = os.curdir, environment: MutableMapping[str, str] | None = None) -> Iterator[None]:
    """Be in `folder`, that of the call, with the `environment` of before any test, and let warnings only warn.

    What an agent changes of its environment is in `environment` then.

    What a test's folder and variables, or pytest's `-W error`, make of an episode would be stored, under the key of
    the one that a worker process drives to its end.
    """
    with in_folder(folder), _in_environment(environment), warnings.catch_warnings():
        warnings.filters = [
            ("default" if action == "error" else action, message, category, module, line)
            for action, message, category, module, line in warnings.filters
        ]
        yield


@contextmanager
def in_folder(folder: Path | str) -> Iterator[None]:
    """Be in `folder`, and then where we were."""
    try:
        before = os.getcwd()
    except FileNotFoundError:  # a test went to a folder that it removed
        before = str(folder)
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


@contextmanager
def _in_environment(environment: MutableMapping[str, str] | None) -> Iterator[None]:
    if not environment:
        yield
        return
    before = dict(os.environ)
    _set_environment(environment)
    try:
        yield
    finally:
        environment.clear()
        environment.update(os.environ)
        _set_environment(before)


def _set_environment(wanted: Mapping[str, str]) -> None:
    """Make the variables the wanted ones, and touch no other: threads of a test may look at them."""
    for name in os.environ.keys() - wanted.keys():
        del os.environ[name]
    os.environ.update({name: text for name, text in wanted.items() if os.environ.get(name) != text})
