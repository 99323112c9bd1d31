"""Prepare the batches of a training in the background: choose, order, read and augment rows.

A batch is a function of (seed, step): an interrupted training continues with equal batches, for any number of threads.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents.training.data.draws import draws
from drive_robust_agents.training.data.pairs import earlier_rows
from drive_robust_agents.training.loop.sampling import NEEDS, bucket_weights, draw_epoch, level_types
from pytest_drive_robust.errors import UsageError

if TYPE_CHECKING:
    from torch import Tensor

    from drive_robust_agents.training.recipes.recipe import TrainingRecipe

    Batch = dict[str, Tensor]

__all__ = ["Feed", "Source"]

Rows = NDArray[np.int64]


class Source(Protocol):
    """Frames on disk or in memory: rows of named arrays."""

    def __len__(self) -> int:
        """Return the number of rows."""
        ...

    def column(self, name: str) -> NDArray[Any]:
        """Return one small array of all rows."""
        ...

    def arrays(self, names: Sequence[str], rows: Rows) -> dict[str, NDArray[Any]]:
        """Return copies of the named arrays at the given rows, in their order."""
        ...

    def split(self) -> tuple[Rows, Rows]:
        """Return (training rows, validation rows), split by whole episodes."""
        ...


class Feed:
    """The batches of one training, prepared by `threads` threads, twice as many batches ahead.

    Raises `UsageError` when there are too few frames for training and validation.
    """

    def __init__(self, source: Source, recipe: TrainingRecipe, *, batch: int, seed: int, threads: int = 1) -> None:
        self._source, self._recipe = source, recipe
        self._batch, self._seed, self._threads = batch, seed, threads
        self.training, self.validation = _parts(source)
        if len(self.training) < batch:
            raise UsageError(
                f"{len(source)} frames, {len(self.validation)} of them to validate on, do not fill a batch of {batch}: "
                "collect more."
            )
        chosen = {name: source.column(name)[self.training] for name in NEEDS}
        self._weights = level_types(bucket_weights(chosen), chosen["tag"])
        self._earlier = earlier_rows(*map(source.column, ("episode", "tick", "source"))) if recipe.history else None
        self._epoch: tuple[int, Rows] = (-1, np.zeros(0, np.int64))

    def rows(self, step: int) -> Rows:
        """Return the rows of the batch of a step, 0 and up."""
        first, size = step * self._batch, len(self.training)
        parts: list[Rows] = []
        while (missing := self._batch - sum(map(len, parts))) > 0:
            number, begin = divmod(first + self._batch - missing, size)
            parts.append(self._pass(number)[begin : begin + missing])
        return np.concatenate(parts)

    def make(self, step: int) -> Batch:
        """Return the batch of a step."""
        return self._made(self.rows(step), step)

    def batches(self, begin: int, end: int) -> Iterator[Batch]:
        """Return the batches of the steps from `begin` to before `end`."""
        waiting: deque[Future[Batch]] = deque()
        with ThreadPoolExecutor(self._threads, thread_name_prefix="feed") as pool:
            try:
                for step in range(begin, end):
                    waiting.append(pool.submit(self._made, self.rows(step), step))
                    if len(waiting) > 2 * self._threads - 1:
                        yield waiting.popleft().result()
                while waiting:
                    yield waiting.popleft().result()
            finally:
                for future in waiting:
                    future.cancel()

    def validating(self, most: int) -> Iterator[Batch]:
        """Return batches of up to `most` evenly chosen frames of validation episodes, not augmented."""
        count = min(most, len(self.validation))
        chosen = self.validation[np.linspace(0, len(self.validation) - 1, count).astype(np.int64)]
        for begin in range(0, count, self._batch):
            rows = chosen[begin : begin + self._batch]
            yield self._recipe.batch(self._read(rows), draws("validation", begin), training=False)

    def _made(self, rows: Rows, step: int) -> Batch:
        return self._recipe.batch(self._read(rows), draws("augment", self._seed, step), training=True)

    def _read(self, rows: Rows) -> Mapping[str, NDArray[Any]]:
        arrays = self._sorted(self._recipe.needs, rows)
        if self._earlier is not None:
            earlier = self._earlier[rows]
            there = earlier >= 0
            for name, values in self._sorted(self._recipe.history, np.where(there, earlier, rows)).items():
                values[~there] = 0
                arrays[f"old_{name}"] = values
            arrays["old_ok"] = there
        return arrays

    def _sorted(self, names: Sequence[str], rows: Rows) -> dict[str, NDArray[Any]]:
        """Read arrays at rows, each row once and in the order of the disk."""
        unique, places = np.unique(rows, return_inverse=True)
        return {name: values[places] for name, values in self._source.arrays(names, unique).items()}

    def _pass(self, number: int) -> Rows:
        if self._epoch[0] != number:
            order = draw_epoch(self._weights, draws("order", self._seed, number))
            self._epoch = number, self.training[order]
        return self._epoch[1]


def _parts(source: Source) -> tuple[Rows, Rows]:
    """Return (training rows, validation rows); if the split has no validation rows, the last episode validates."""
    training, validation = source.split()
    if len(validation):
        return training, validation
    episodes = source.column("episode")
    held = episodes == episodes.max()
    return np.flatnonzero(~held), np.flatnonzero(held)
