"""What workers advise before they begin is shown by the controller, whoever of its two threads reads it first."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest
from patience import PATIENCE_S

from pytest_drive_robust.plugin.xdist import ControllerPlugin, SharedRunRecord, WorkerObserver
from pytest_drive_robust.report.progress import Progress
from pytest_drive_robust.store.base import EpisodeStore
from pytest_drive_robust.store.events import Advised, Event


class Watched(Progress):
    def __init__(self) -> None:
        self.events: list[Event] = []

    def see(self, event: Event) -> None:
        self.events.append(event)


@pytest.fixture
def progress() -> Watched:
    return Watched()


@pytest.fixture
def controller(tmp_path: Path, progress: Watched) -> Iterator[ControllerPlugin]:
    plugin = ControllerPlugin(tmp_path, SharedRunRecord(tmp_path, cast(EpisodeStore, None)), progress)
    yield plugin
    for _ in plugin.pytest_sessionfinish():
        pass


def test_advice_that_the_display_reads_first_is_shown_once(
    tmp_path: Path, controller: ControllerPlugin, progress: Watched
) -> None:
    lines: list[str] = []
    reporter = SimpleNamespace(ensure_newline=lambda: None, write_line=lines.append)
    node = SimpleNamespace(config=SimpleNamespace(pluginmanager=SimpleNamespace(get_plugin=lambda name: reporter)))
    for name in ("gw0", "gw1"):
        worker = WorkerObserver(tmp_path, name=name)
        worker(Advised(("only 4 routes",)))
        worker.close()
    controller.pytest_runtestloop()
    ends_s = time.monotonic() + PATIENCE_S
    while len(progress.events) < 2 and time.monotonic() < ends_s:
        time.sleep(0.01)
    assert len(progress.events) == 2
    for _ in range(2):
        controller.pytest_xdist_node_collection_finished(node)
    assert lines == ["drive-robust: only 4 routes"]
