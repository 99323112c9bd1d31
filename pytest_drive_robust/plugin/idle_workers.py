"""Lets a pytest-xdist worker whose tests are done drive the episodes that other workers still wait for."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import pytest

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.marker import MarkerOptions
from pytest_drive_robust.plugin.xdist import STOP
from pytest_drive_robust.runner.campaign import Campaign
from pytest_drive_robust.runner.plan import EpisodeRequest, routes_in_order
from pytest_drive_robust.runner.scopes import Scopes
from pytest_drive_robust.store.claims import Claims
from pytest_drive_robust.store.events import EpisodesNeeded, Judged, Spared, Used
from pytest_drive_robust.store.journal import JournalReader

_BUSY = "busy"


class IdleWorkerPlugin:
    """Lets one worker help others. `folder` is the folder of the run, `name` the name of the worker.

    The worker drives only episodes that another worker has requested and still needs, in the order in which that
    worker's test reads them, and no more at a time than the test itself would: an early verdict wastes few episodes.
    """

    def __init__(self, folder: Path, name: str, scopes: Scopes, campaign: Campaign) -> None:
        self._stop = folder / STOP
        self._folder = folder
        self._name = name
        self._scopes = scopes
        self._campaign = campaign
        self._workers: Claims = Claims(folder / _BUSY)
        self._own = self._workers.attempt(name)  # the operating system frees the claim when this process is killed

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> Generator[None, Any, Any]:
        """Help after the tests of this worker."""
        outcome = yield
        if self._own is not None:
            self._own.release()
        if not (session.shouldstop or session.shouldfail):
            self._help()
        return outcome

    def pytest_unconfigure(self) -> None:
        """Release this worker's claim when no test ran."""
        if self._own is not None:
            self._own.release()

    def _help(self) -> None:
        wanted = OpenRequests(self._folder, self._scopes)
        try:
            while not self._stop.exists() and self._others_are_busy():
                self._campaign.scheduler.assist(wanted.requests())
        except UsageError:  # the worker that asked says so in its test
            return

    def _others_are_busy(self) -> bool:
        for path in (self._folder / _BUSY).glob("*.lock"):
            claim = None if path.stem == self._name else self._workers.attempt(path.stem)
            if claim is not None:
                claim.release()
            elif path.stem != self._name:
                return True
        return False


class OpenRequests:
    """The unanswered episode requests of a run's workers, read from the workers' journals."""

    def __init__(self, folder: Path, scopes: Scopes) -> None:
        self._journals = JournalReader(folder)
        self._scopes = scopes
        self._open: list[tuple[EpisodesNeeded, list[EpisodeRequest]]] = []

    def requests(self) -> Iterator[EpisodeRequest]:
        """Return the open requests, test by test, in the order in which each test reads them. Raises `UsageError`."""
        for event in self._journals.read():
            if isinstance(event, EpisodesNeeded):  # clean twins also came alone before: drop that entry
                self._open = [(needed, requests) for needed, requests in self._open if needed.keys != event.clean_keys]
                self._open.append((event, self._in_order(event)))
            elif isinstance(event, (Used, Spared)):
                done = frozenset(event.keys)
                self._open = [
                    (needed, [request for request in left if request.key not in done]) for needed, left in self._open
                ]
            elif isinstance(event, Judged):
                over = (event.agent, event.routes_spec, event.setting, event.seeds)
                self._open = [
                    (needed, left)
                    for needed, left in self._open
                    if (needed.agent, needed.routes_spec, needed.setting, needed.seeds) != over
                ]
        self._open = [(needed, left) for needed, left in self._open if left]
        return (request for _, left in self._open for request in left)

    def _in_order(self, needed: EpisodesNeeded) -> list[EpisodeRequest]:
        scope = self._scopes.of(MarkerOptions(agent=needed.agent, routes=needed.routes_spec, seeds=needed.seeds))
        need = scope.need(self._scopes.setting(needed.setting), clean=bool(needed.clean_keys))
        wanted = frozenset((*needed.keys, *needed.clean_keys))
        return [
            request for route in routes_in_order(scope, need) for request in route.requests if request.key in wanted
        ]
