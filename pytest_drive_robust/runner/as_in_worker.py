"""Gives an agent in the process of the run the surroundings of a worker process: folder, environment, warnings."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Mapping, MutableMapping
from contextlib import contextmanager
from pathlib import Path

from pytest_drive_robust.registry.exits import exits_raised


@contextmanager
def as_in_worker(folder: Path | str = os.curdir, environment: MutableMapping[str, str] | None = None) -> Iterator[None]:
    """Run the body in `folder`, with the variables of `environment`, and with warnings that are no errors.

    `os._exit` raises there (see `exits_raised`), as nothing else would tell that the agent ended the process.

    `environment` holds the variables from before any test; afterwards it holds them with the agent's changes. None or
    an empty mapping means the present variables.

    Without this, a test's folder and variables, or pytest's `-W error`, could change an episode that is stored under
    the key of a worker process's episode.
    """
    with in_folder(folder), _in_environment(environment), exits_raised(), warnings.catch_warnings():
        warnings.filters = [
            ("default" if action == "error" else action, message, category, module, line)
            for action, message, category, module, line in warnings.filters
        ]
        yield


@contextmanager
def in_folder(folder: Path | str) -> Iterator[None]:
    """Run the body in `folder`, then change back to the earlier folder."""
    try:
        before = os.getcwd()
    except FileNotFoundError:  # a test removed the current folder
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
    """Set the environment variables to `wanted`; write only changed ones: threads of a test may read the others."""
    for name in os.environ.keys() - wanted.keys():
        del os.environ[name]
    os.environ.update({name: text for name, text in wanted.items() if os.environ.get(name) != text})
