"""What is around an agent in a worker process, for one that is driven in the process of the run."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def as_in_worker() -> Iterator[None]:
    """Let warnings only warn: pytest's `-W error` and `filterwarnings` are for tests, not for an agent.

    What it makes of an episode would be stored, under the key of the one that a worker process drives to its end.
    """
    with warnings.catch_warnings():
        warnings.filters = [
            ("default" if action == "error" else action, message, category, module, line)
            for action, message, category, module, line in warnings.filters
        ]
        yield
