"""Display the progress of a training: parts of the loss, frames per second, remaining time."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

if TYPE_CHECKING:
    from types import TracebackType

    from torch import Tensor

__all__ = ["Display"]

_LINE_EVERY_S = 30.0
_REDRAW_S = 0.5
_SMOOTH = 0.95


class Display:
    """A bar on a terminal, else a line every 30 s. Losses are read rarely, because reading waits for the device."""

    def __init__(self, *, total: int, done: int, batch: int, console: Console | None = None) -> None:
        self._console = console or Console()
        self._total, self._batch = total, batch
        columns = (
            TextColumn("train"), BarColumn(), TextColumn("{task.completed}/{task.total} steps {task.fields[words]}"),
            TimeElapsedColumn(), TimeRemainingColumn(),
        )  # fmt: skip
        live = self._console.is_terminal
        self._progress = Progress(*columns, console=self._console, disable=not live)
        self._every_s = _REDRAW_S if live else _LINE_EVERY_S
        self._task = self._progress.add_task("", total=total, completed=done, words="")
        self._begin, self._first = time.monotonic(), done
        self._shown = time.monotonic() if not live else 0.0
        self._means: dict[str, float] = {}

    def __enter__(self) -> Display:
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._progress.stop()

    def step(self, done: int, parts: Mapping[str, Tensor | float], rate: float) -> None:
        """Show the number of finished steps `done` and the losses of the last step."""
        now = time.monotonic()
        if now - self._shown < self._every_s and done < self._total:
            return
        self._shown = now
        for name, value in parts.items():
            fresh = float(value)
            self._means[name] = _SMOOTH * self._means.get(name, fresh) + (1.0 - _SMOOTH) * fresh
        losses = " ".join(f"{name} {value:.3f}" for name, value in self._means.items())
        speed = (done - self._first) * self._batch / max(now - self._begin, 1e-9)
        words = f"{losses} lr {rate:.1e} {speed:.0f} frames/s"
        self._progress.update(self._task, completed=done, words=words)
        if not self._console.is_terminal:
            left_min = (self._total - done) * self._batch / max(speed, 1e-9) / 60.0
            self._console.print(f"{done}/{self._total} {words}, {left_min:.1f} min left", soft_wrap=True)

    def validated(self, step: int, parts: Mapping[str, float]) -> None:
        """Print a line with the losses on validation frames."""
        losses = " ".join(f"{name} {value:.3f}" for name, value in parts.items())
        self._progress.console.print(f"step {step}: validation {losses}", soft_wrap=True, highlight=False)
