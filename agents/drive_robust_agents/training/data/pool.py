"""Write shards in several processes, in the order of completion."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.synchronize import Event

from drive_robust_agents.training.data.shards import Shard, WrittenShard, write
from pytest_drive_robust.errors import SimulationError

__all__ = ["written"]


def written(shards: Sequence[Shard], workers: int) -> Iterator[WrittenShard]:
    """Write shards, here or in other processes; yield each completed shard. Ctrl-C ends the processes cleanly.

    Raises `SimulationError` when a worker was killed.
    """
    if workers == 1 or len(shards) < 2:
        for shard in shards:
            yield write(shard)
        return
    context = multiprocessing.get_context("spawn")
    stop = context.Event()
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_begin, initargs=(stop,)) as pool:
        with _deaf():
            pending: set[Future[WrittenShard]] = {pool.submit(write, shard) for shard in shards}
        try:
            while pending:
                finished, pending = wait(pending, return_when=FIRST_COMPLETED)
                for future in finished:
                    yield future.result()
        except BrokenProcessPool as error:
            raise SimulationError(
                f"one of {workers} workers was killed, perhaps for its memory. The same command goes on with the "
                "shards that are complete; try fewer workers or --shard-routes 1."
            ) from error
        except BaseException:
            stop.set()
            pool.shutdown(wait=True, cancel_futures=True)
            raise


@contextmanager
def _deaf() -> Iterator[None]:
    """Shield processes that start in this context from Ctrl-C, even before their first line runs."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _begin(stop: Event) -> None:
    """Prepare a worker to end at once when the parent stops it or is gone; the shard is written again later."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    for ends in (stop.wait, parent.join):
        threading.Thread(target=_end_after, args=(ends,), daemon=True).start()


def _end_after(ends: Callable[[], object]) -> None:
    ends()
    os._exit(1)
