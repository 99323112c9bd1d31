"""The role of this process in pytest-xdist (worker, controller or neither), and the data that both exchange."""

from __future__ import annotations

from typing import Any

import pytest


def is_worker(config: pytest.Config) -> bool:
    """Return True in a worker of pytest-xdist."""
    return hasattr(config, "workerinput")


def is_controller(config: pytest.Config) -> bool:
    """Return True where pytest-xdist will hand all tests to workers: `--dist` alone, as in an ini file, starts none."""
    distributed = config.getoption("dist", "no") != "no" and bool(config.getoption("tx", None))
    return distributed and not is_worker(config)


def worker_input(config: pytest.Config) -> dict[str, Any]:
    """Return what the controller gave to this worker, `"workerid"` among it."""
    given: dict[str, Any] = vars(config)["workerinput"]
    return given


def worker_output(config: pytest.Config) -> dict[str, Any]:
    """Return what this worker hands to the controller at its end: plain values, by name."""
    output: dict[str, Any] = vars(config)["workeroutput"]
    return output


def output_of(node: Any) -> dict[str, Any]:
    """Return the output of an ended worker; empty for a crashed one. `node` is the controller's view of the worker."""
    return getattr(node, "workeroutput", None) or {}
