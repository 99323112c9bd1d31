"""The executor behind `--drive-sim bench2drive`: requests are driven by the official evaluator."""

from __future__ import annotations

import hashlib
import os
import threading
from collections import defaultdict
from collections.abc import Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from queue import SimpleQueue

from pytest_drive_robust.bench2drive.agent_argument import require_configuration, split_argument
from pytest_drive_robust.bench2drive.asked_variables import require_planner_type
from pytest_drive_robust.bench2drive.evaluator.attempt import Patience
from pytest_drive_robust.bench2drive.evaluator.checkout import Checkout
from pytest_drive_robust.bench2drive.evaluator.doctor import carla_version, checkout_version
from pytest_drive_robust.bench2drive.evaluator.drive import drive_route
from pytest_drive_robust.bench2drive.evaluator.gpus import visible_gpus
from pytest_drive_robust.bench2drive.evaluator.ports import DEFAULT_PORT, check_ports
from pytest_drive_robust.bench2drive.evaluator.route_result import DrivenRoute, read_finished
from pytest_drive_robust.bench2drive.evaluator.run_folder import RunFolder
from pytest_drive_robust.bench2drive.evaluator.setup import EvaluatorSetup, setting_as_json
from pytest_drive_robust.bench2drive.results.episode_from_record import episode_of
from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.engine.fork_server import Stopped
from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.runner.episode.bare_result import bare_result
from pytest_drive_robust.runner.executor import Executor
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.simulators.embedded.route_xml import load_routes
from pytest_drive_robust.store.record_files import hide_from_git

AGENT_PREFIX = "leaderboard:"


def read_agent(name: str, root: Path) -> tuple[Path, str]:
    """Split `leaderboard:FILE.py+CONFIG` into the absolute path of the file and the text for the agent's `setup`.

    Files that CONFIG names become absolute, except files of the checkout in `root`, where the evaluator runs.

    Raises `UsageError`: only official agents drive in the official evaluator, and only with files that are there.
    """
    if not name.startswith(AGENT_PREFIX):
        raise UsageError(
            f"the agent {name!r} cannot drive in Bench2Drive: expected an official one, as in "
            f"{AGENT_PREFIX}path/to/agent.py+path/to/config"
        )
    argument = name[len(AGENT_PREFIX) :]
    file, config = split_argument(argument)
    require_configuration(argument, config, root=root)
    return file, "+".join(_absolute(part) for part in config.split("+"))


def _absolute(part: str) -> str:
    """Return the absolute path of an existing file or folder, links not resolved; return other text unchanged.

    Raises `UsageError` for a path with a `+`, at which agents would split it.
    """
    path = Path(part).expanduser()
    if not part or not path.exists():
        return part
    absolute = os.path.abspath(path)
    if "+" in absolute:
        raise UsageError(
            f"the configuration {part!r} of the agent is {absolute!r}, which official agents take apart at each '+'. "
            "Move it to a folder without one."
        )
    return absolute


class Bench2DriveExecutor(Executor):
    """Drives `slots` episodes at a time, each in an evaluator and server of its own.

    `routes` is the route file of all requests, in the evaluator's schema. Evaluators write below `folder`; an episode
    that is finished there is not driven again. With `fresh`, only episodes of this executor count as finished.
    `hidden`: keep `folder` out of git. The slots use the GPUs in turn (default: those of `CUDA_VISIBLE_DEVICES`, else
    GPU 0). `tries` and `patience` are those of each `EvaluatorSetup`.
    """

    def __init__(
        self,
        checkout: Checkout,
        *,
        folder: Path,
        routes: Path | None = None,
        slots: int = 1,
        gpus: tuple[int, ...] = (),
        port: int = DEFAULT_PORT,
        fresh: bool = False,
        hidden: bool = False,
        tries: int = 3,
        patience: Patience | None = None,
    ) -> None:
        check_ports(port, slots=slots)
        self._slots = slots
        self._checkout = checkout
        self._folder = folder.resolve()
        self._routes = (routes or checkout.routes).resolve()
        self._gpus = gpus or visible_gpus(os.environ)
        self._fresh = fresh
        self._hidden = hidden
        self._driven: set[tuple[Path, str]] = set()
        self._planned: defaultdict[tuple[object, ...], dict[str, None]] = defaultdict(dict)
        self._planning = threading.Lock()
        self._port, self._tries, self._patience = port, tries, patience or Patience()
        self._stop = threading.Event()
        self._free: SimpleQueue[int] = SimpleQueue()
        for slot in range(slots):
            self._free.put(slot)
        self._pool = ThreadPoolExecutor(slots, thread_name_prefix="drive-robust-b2d")

    @property
    def slots(self) -> int:
        """The number of evaluators that drive at the same time."""
        return self._slots

    @cached_property
    def routes(self) -> tuple[Route, ...]:
        """The routes of the file. Raises `RouteError`."""
        return load_routes(self._routes)

    def check(self, requests: Iterable[EpisodeRequest]) -> None:
        """Raise `UsageError` for a request whose agent, route or setting the evaluator cannot drive."""
        for request in requests:
            agent, _ = read_agent(request.episode.agent, self._checkout.root)
            require_planner_type(agent)
            self._require_route(request.route)
            setting_as_json(request.setting, seed=request.episode.seed)
            with self._planning:
                self._planned[_kind(request)][request.route.id] = None

    def submit(self, request: EpisodeRequest) -> Future[EpisodeResult]:
        """Begin an episode as soon as a slot is free."""
        return self._pool.submit(self._drive, request)

    def finished(self, request: EpisodeRequest) -> EpisodeResult | None:
        """Return the result of an earlier command, or None without one. Raises `UsageError` for a damaged file."""
        run_folder = self.run_folder(request)
        if not self._reuses(run_folder, request):
            return None
        driven = read_finished(run_folder, request.route.id, request.setting, request.episode.seed)
        return None if driven is None else self._result(driven, request, run_folder)

    def run_folder(self, request: EpisodeRequest) -> RunFolder:
        """Return the folder for all requests that agree in everything that decides results, except the route."""
        setup = self._setup(request)
        parts = (*setup.identity.values(), request.identity)
        digest = hashlib.blake2b("\0".join(parts).encode("utf-8", "surrogatepass"), digest_size=6).hexdigest()
        return RunFolder(self._folder / f"{setup.agent.stem}-seed{setup.seed}-{digest}")

    def close(self) -> None:
        """Kill evaluators and servers at once."""
        self._stop.set()
        self._pool.shutdown(cancel_futures=True)

    def _setup(self, request: EpisodeRequest) -> EvaluatorSetup:
        agent, config = read_agent(request.episode.agent, self._checkout.root)
        return EvaluatorSetup(
            self._checkout, agent, config, request.setting, request.episode.seed, self._routes,
            port=self._port, tries=self._tries, patience=self._patience,
        )  # fmt: skip

    def _drive(self, request: EpisodeRequest) -> EpisodeResult:
        self.check((request,))
        if self._hidden:
            self._folder.mkdir(parents=True, exist_ok=True)
            hide_from_git(self._folder)
        run_folder = self.run_folder(request)
        with self._planning:
            planned = tuple(self._planned[_kind(request)])
        run_folder.plan(planned, self._stop)
        reuse = self._reuses(run_folder, request)
        slot = self._free.get()
        try:
            setup = replace(self._setup(request), gpu=self._gpus[slot % len(self._gpus)])
            driven = drive_route(setup, request.route.id, run_folder, slot=slot, stop=self._stop, reuse=reuse)
        finally:
            self._free.put(slot)
        if driven.record is None and self._stop.is_set():
            raise Stopped
        if driven.record is not None:
            self._driven.add((run_folder.folder, request.route.id))
        return self._result(driven, request, run_folder)

    def _reuses(self, run_folder: RunFolder, request: EpisodeRequest) -> bool:
        return not self._fresh or (run_folder.folder, request.route.id) in self._driven

    def _result(self, driven: DrivenRoute, request: EpisodeRequest, run_folder: RunFolder) -> EpisodeResult:
        return replace(_result(driven, request, run_folder), wall_s=driven.wall_s, versions=self._versions)

    @cached_property
    def _versions(self) -> Mapping[str, str]:
        return {
            "bench2drive": checkout_version(self._checkout.root),
            "carla": carla_version(self._checkout.carla_root) or "unknown",
        }

    @cached_property
    def _known(self) -> dict[str, Route]:
        return {route.id: route for route in self.routes}

    def _require_route(self, route: Route) -> None:
        own = self._known.get(route.id)
        if own is None:
            listed_by = f"drive-robust routes list {self._routes}"
            raise UnknownNameError.of(f"route in {str(self._routes)!r}", route.id, self._known, listed_by=listed_by)
        if own != route:
            here, there = (f"{one.scenario.type} in {one.town}" for one in (route, own))
            told = f"{here} for the test, but {there}" if here != there else "another one for the test than it is"
            raise UsageError(
                f"route {route.id} is {told} in {str(self._routes)!r}, which the evaluator drives: give both the same "
                "file with --drive-routes."
            )
        if not route.id.isdecimal():
            raise UsageError(
                f"the route id {route.id!r} is not a number, and the official evaluator takes nothing else."
            )


def _kind(request: EpisodeRequest) -> tuple[object, ...]:
    """Return the key of requests whose results go to the same folder, as long as no file changes."""
    episode = request.episode
    return episode.agent, episode.setting, episode.seed, request.identity


def _result(driven: DrivenRoute, request: EpisodeRequest, run_folder: RunFolder) -> EpisodeResult:
    """Return the episode; `infra_error` when no try gave a score.

    Raises `UsageError` for a record whose score does not follow from its infractions.
    """
    episode = request.episode
    if driven.record is None:
        outcome, end = Outcome.INFRA_ERROR, End.SIMULATION_CRASHED
        return bare_result(request.route, episode, outcome=outcome, end=end, detail="; ".join(driven.troubles))
    result = episode_of(driven.record, agent=episode.agent, setting=episode.setting, folders=(run_folder.results,))
    scenario = result.scenario or request.route.scenario.type
    return replace(result, episode=episode, scenario=scenario, **driven.injected.facts)
