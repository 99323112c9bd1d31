"""Implements the hooks of pytest-xdist, and decides what workers and the controller do, except for usage errors.

The controller makes a folder. Workers share episodes in that folder and append events to their journals there; the
controller reads the journals. A worker may crash at any time: its finished episodes are on disk before it goes on.
"""

from __future__ import annotations

import shutil
import tempfile
import threading
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import pytest

from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.plugin.process_roles import worker_input
from pytest_drive_robust.plugin.terminal import progress_for
from pytest_drive_robust.report.progress import Progress
from pytest_drive_robust.runner.cache_key.code_text import begin_run
from pytest_drive_robust.store.base import EpisodeStore
from pytest_drive_robust.store.events import Advised, Event
from pytest_drive_robust.store.journal import JournalReader, JournalWriter
from pytest_drive_robust.store.opening import open_store

STOP = "stop"
"""The file that tells idle workers that the run is ending: finished or interrupted."""
_INPUT = "drive_robust_folder"
_POLL_S = 0.2


def start_run(config: pytest.Config, options: RunOptions) -> SharedRunRecord:
    """Make the run's folder in the controller and follow the workers; the folder is removed when the session ends."""
    folder = Path(tempfile.mkdtemp(prefix="drive-robust-"))
    config.add_cleanup(lambda: shutil.rmtree(folder, ignore_errors=True))
    record = SharedRunRecord(folder, open_store(options, config.rootpath, run=folder.name, own=folder / "store"))
    config.pluginmanager.register(ControllerPlugin(folder, record, progress_for(config)), "drive_robust_controller")
    return record


def join_run(
    config: pytest.Config, options: RunOptions, drive_here: Callable[[EpisodeStore, WorkerObserver], None]
) -> Path:
    """Drive in a worker with the run's store, write events to the run's folder, and return that folder."""
    given = worker_input(config)
    folder = Path(given[_INPUT])
    observer = WorkerObserver(folder, name=given["workerid"])
    config.add_cleanup(observer.close)
    store = open_store(options, config.rootpath, run=folder.name, own=folder / "store")
    begin_run(folder.name)
    drive_here(store, observer)
    return folder


class WorkerObserver(JournalWriter):
    """Writes the events of a worker to its journal, which the controller reads and shows."""

    def ticked(self) -> None:
        """Do nothing: the controller cannot see ticks."""

    def idle(self) -> None:
        """Do nothing: a worker draws nothing."""


class SharedRunRecord:
    """The events of a run's workers, read from the run's folder."""

    def __init__(self, folder: Path, store: EpisodeStore) -> None:
        self.store = store
        self._reader = JournalReader(folder)
        self._events: list[Event] = []
        self._lock = threading.Lock()

    def events(self) -> list[Event]:
        """Return all events so far, in order within each worker. The progress display calls from its own thread."""
        with self._lock:
            self._events += self._reader.read()
        return self._events


class ControllerPlugin:
    """Gives workers the folder and shows their progress.

    The display has a thread of its own, because the controller's main thread sleeps until a report comes in.
    """

    def __init__(self, folder: Path, record: SharedRunRecord, progress: Progress) -> None:
        self._folder = folder
        self._record = record
        self._progress = progress
        self._stop = threading.Event()
        self._writing = threading.RLock()
        self._seen = 0
        self._advice: dict[str, None] = {}
        self._shown = 0
        self._thread = threading.Thread(target=self._follow, name="drive-robust progress", daemon=True)

    def pytest_configure_node(self, node: Any) -> None:
        """Tell a worker where the run's folder is (a hook of pytest-xdist)."""
        node.workerinput[_INPUT] = str(self._folder)

    @pytest.hookimpl(optionalhook=True)
    def pytest_xdist_node_collection_finished(self, node: Any) -> None:
        """Show each advice of a worker once, after its collection and before its tests (a hook of pytest-xdist)."""
        reporter = node.config.pluginmanager.get_plugin("terminalreporter")
        with self._writing:
            self._see_news()
            fresh = list(self._advice)[self._shown :]
            self._shown = len(self._advice)
            if fresh and reporter is not None:
                self._progress.pause()
                reporter.ensure_newline()
                for text in fresh:
                    reporter.write_line(f"drive-robust: {text}")

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self) -> None:
        """Start the thread of the progress display."""
        self._thread.start()

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_logreport(self) -> Generator[None, None, None]:
        """Clear the progress line while pytest writes about a test."""
        with self._writing:
            self._progress.pause()
            yield

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_sessionfinish(self) -> Generator[None, None, None]:
        """Stop the progress display before the summaries, and stop idle workers from helping."""
        (self._folder / STOP).touch()
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        with self._writing:
            self._progress.pause()
        yield

    def _follow(self) -> None:
        while not self._stop.wait(_POLL_S):
            with self._writing:
                self._see_news()
                self._progress.refresh()

    def _see_news(self) -> None:
        """Show new events. Keep advice for `pytest_xdist_node_collection_finished`: the thread may read first."""
        news = self._record.events()[self._seen :]
        self._seen += len(news)
        for event in news:
            self._progress.see(event)
            if isinstance(event, Advised):
                self._advice.update(dict.fromkeys(event.sentences))
