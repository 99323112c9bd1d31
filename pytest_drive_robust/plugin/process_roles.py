"""What this process is to pytest-xdist: a worker, the controller, or a session without workers."""

from __future__ import annotations

import pytest


def is_worker(config: pytest.Config) -> bool:
    """Return True in a worker of pytest-xdist."""
    return hasattr(config, "workerinput")


def is_controller(config: pytest.Config) -> bool:
    """Return True where pytest-xdist will hand all tests to workers: `--dist` alone, as in an ini file, starts none."""
    distributed = config.getoption("dist", "no") != "no" and bool(config.getoption("tx", None))
    return distributed and not is_worker(config)
