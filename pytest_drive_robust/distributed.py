"""pytest-xdist: every hook of it and every decision about workers and the controller.

The controller makes a folder, the workers share episodes and append what happens to journals in it, the controller
reads. Nothing rests on a worker ending well: what it finished is on disk before it goes on.
"""

from __future__ import annotations

import shutil
import tempfile
import threading
from collections.abc import Callable, Generator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.runner.progress import Progress
    from pytest_drive_robust.store.base import EpisodeStore
    from pytest_drive_robust.store.events import Event
    from pytest_drive_robust.store.journal import JournalWriter

__all__ = ["ControllerPlugin", "ProblemCourier", "is_controller", "is_worker", "join_run", "sentences", "start_run"]

_INPUT = "drive_robust_folder"
_OUTPUT = "drive_robust_problems"
_POLL_S = 0.2


def is_worker(config: pytest.Config) -> bool:
    """True in a worker of pytest-xdist."""
    return hasattr(config, "workerinput")


def is_controller(config: pytest.Config) -> bool:
    """True where pytest-xdist will hand all tests to workers."""
    return config.getoption("dist", "no") != "no" and not is_worker(config)


def start_run(config: pytest.Config) -> FolderRecord:
    """On the controller: make the run's folder and follow what the workers do. The folder goes with the session."""
    from pytest_drive_robust.screen import progress_for

    folder = Path(tempfile.mkdtemp(prefix="drive-robust-"))
    config.add_cleanup(lambda: shutil.rmtree(folder, ignore_errors=True))
    record = FolderRecord(folder)
    config.pluginmanager.register(ControllerPlugin(folder, record, progress_for(config)), "drive_robust_controller")
    return record


def join_run(config: pytest.Config, drive_here: Callable[[EpisodeStore, WorkerObserver], None]) -> None:
    """In a worker: drive with the run's shared folder."""
    from pytest_drive_robust.store.folder import FolderStore
    from pytest_drive_robust.store.journal import JournalWriter

    workerinput: dict[str, Any] = config.workerinput  # type: ignore[attr-defined]
    folder, name = Path(workerinput[_INPUT]), workerinput["workerid"]
    number, count = int(name.removeprefix("gw")), int(workerinput["workercount"])
    journal = JournalWriter(folder, name=name)
    config.add_cleanup(journal.close)
    drive_here(FolderStore(folder, offset=number % count / count), WorkerObserver(journal))


class WorkerObserver:
    """Writes what happens in a worker to its journal; the controller shows it."""

    def __init__(self, journal: JournalWriter) -> None:
        self._journal = journal

    def __call__(self, event: Event) -> None:
        """Something happened."""
        self._journal(event)

    def ticked(self) -> None:
        """The controller cannot see ticks."""

    def idle(self) -> None:
        """A worker draws nothing."""


class FolderRecord:
    """What the workers of a run did, read from the run's folder."""

    def __init__(self, folder: Path) -> None:
        from pytest_drive_robust.store.folder import FolderStore
        from pytest_drive_robust.store.journal import JournalReader

        self._reader = JournalReader(folder)
        self._store = FolderStore(folder)
        self._events: list[Event] = []
        self._lock = threading.Lock()

    def events(self) -> list[Event]:
        """Everything so far, in order within each worker."""
        self.fresh()
        return self._events

    def fresh(self) -> list[Event]:
        """What was written since the last call. The display's thread asks too, hence the lock."""
        with self._lock:
            events = self._reader.read()
            self._events += events
        return events

    def find(self, key: str) -> EpisodeResult | None:
        """The finished episode of a key, or None."""
        return self._store.get(key)


class ControllerPlugin:
    """Gives workers the folder and shows their progress.

    The display has a thread of its own, because the controller's main thread sleeps until a report comes in.
    """

    def __init__(self, folder: Path, record: FolderRecord, progress: Progress) -> None:
        self._folder = folder
        self._record = record
        self._progress = progress
        self._stop = threading.Event()
        self._writing = threading.RLock()
        self._thread = threading.Thread(target=self._follow, name="drive-robust progress", daemon=True)

    def pytest_configure_node(self, node: Any) -> None:
        """Tell a worker where the run's folder is (a hook of pytest-xdist)."""
        node.workerinput[_INPUT] = str(self._folder)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self) -> None:
        """Begin to follow."""
        self._thread.start()

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_logreport(self) -> Generator[None, None, None]:
        """pytest writes about a test: our line must be gone meanwhile."""
        with self._writing:
            self._progress.pause()
            yield

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_sessionfinish(self) -> Generator[None, None, None]:
        """Stop following before the summaries are written."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        with self._writing:
            self._progress.pause()
        yield

    def _follow(self) -> None:
        while not self._stop.wait(_POLL_S):
            with self._writing:
                for event in self._record.fresh():
                    self._progress.see(event)
                self._progress.refresh()


class ProblemCourier:
    """Carries usage errors from the workers, which collect, to the controller, which decides the exit code."""

    def __init__(self, problems: dict[str, str]) -> None:
        self._problems = problems

    def pytest_testnodedown(self, node: Any) -> None:
        """A worker has ended (a hook of pytest-xdist). One that crashed brings nothing."""
        for problem, place in (getattr(node, "workeroutput", None) or {}).get(_OUTPUT, {}).items():
            self._problems.setdefault(problem, place)

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """In a worker: hand the problems over. On the controller: exit code 4."""
        if is_worker(session.config):
            session.config.workeroutput[_OUTPUT] = self._problems  # type: ignore[attr-defined]
        elif self._problems and is_controller(session.config):
            session.exitstatus = pytest.ExitCode.USAGE_ERROR

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Say what pytest itself would have said without workers."""
        if is_controller(terminalreporter.config):
            for sentence in sentences(self._problems):
                terminalreporter.write_line(f"ERROR: {sentence}", red=True)


def sentences(problems: Mapping[str, str]) -> list[str]:
    """`"test_suite.py::test_it: there is no agent ..."`, each problem once, at its first place."""
    return [f"{place}: {problem}" if place else problem for problem, place in problems.items()]
