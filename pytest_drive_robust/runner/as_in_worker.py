"""What is around an agent in a worker process, for what is driven, or looked at, in the process of the run."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def as_in_worker(folder: Path | str = os.curdir) -> Iterator[None]:
    """Be in `folder`, that of the call, wherever a test has gone, and let warnings only warn.

    What a test's folder, or pytest's `-W error`, makes of an episode would be stored, under the key of the one that a
    worker process drives to its end.
    """
    with in_folder(folder), warnings.catch_warnings():
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
