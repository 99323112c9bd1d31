"""A stored run: its document, and the result of each episode, with its trace where one is stored."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import DriveRobustError
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.regression.document import damaged, episode_of, routes_of_one_id
from pytest_drive_robust.regression.references import project_store, read_run_document
from pytest_drive_robust.runner.before_driving import routes_of
from pytest_drive_robust.simulators.base import Simulator
from pytest_drive_robust.store.base import Find
from pytest_drive_robust.store.record import decode_episode
from pytest_drive_robust.store.record_files import RecordFiles

T = TypeVar("T")
S = TypeVar("S")


@dataclass(frozen=True)
class RunRecords:
    """One run. `results` are those of its episodes, in the order of the run.

    An episode whose record was not found, or is that of another drive, has an empty trace. `keys` names each episode in
    the store; `routes` are those of each route specification that can still be resolved, `simulator` is None where it
    cannot be made here.
    """

    label: str
    document: Mapping[str, Any]
    results: Mapping[Episode, EpisodeResult]
    keys: Mapping[Episode, str]
    routes: Mapping[str, tuple[Route, ...]]
    simulator: Simulator | None
    baselines: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def stored(cls, reference: str, registry: Registry, *, store: Path | None = None) -> RunRecords:
        """Read a run that people name: a stored run, `"latest"` or a JSON file; its episodes come from the store.

        `store` is the folder of the episodes where they are not in the project's. Raises `UsageError`.
        """
        document = read_run_document(reference)
        stored = document.get("stored")
        label = str(stored.get("name") or reference) if isinstance(stored, dict) else reference
        find = stored_episodes(store or project_store())
        return cls.of(document, find, registry, label=label)

    @classmethod
    def of(cls, document: Mapping[str, Any], find: Find, registry: Registry, *, label: str) -> RunRecords:
        """Bring together what the document tells and what `find` gives for a key.

        Raises `UsageError` for a document that lacks what runs have, and where two routes have the same id.
        """
        try:
            items = document["episodes"]
            episodes = [Episode(item["agent"], item["route_id"], item["setting"], item["seed"]) for item in items]
            known = list(zip(episodes, items, strict=True))
            results = {episode: _result(item, find) for episode, item in known}
            keys = {episode: item["key"] for episode, item in known}
            specs = dict.fromkeys(row["routes_spec"] for row in document["summaries"])
            settings = dict.fromkeys(row["setting"] for row in document["summaries"])
            name = document["settings"]["simulator"]
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise damaged(label, error) from None
        if len(results) < len(episodes):  # as of two files
            twice = next(episode for episode in episodes if episodes.count(episode) > 1)
            raise routes_of_one_id(label, twice.route_id, f" for {twice.agent} under {twice.setting}")
        simulator = _found(lambda: registry.simulator(name), None)
        routes: dict[str, tuple[Route, ...]] = (
            {} if simulator is None else {spec: _found(partial(routes_of, spec, simulator), ()) for spec in specs}
        )
        found: dict[str, Route] = {}
        for route in (route for spec in routes.values() for route in spec):
            if found.setdefault(route.id, route) != route and any(episode.route_id == route.id for episode in episodes):
                raise routes_of_one_id(label, route.id)
        return cls(
            label=label,
            document=document,
            results=results,
            keys=keys,
            routes=routes,
            simulator=simulator,
            baselines={name: _found(partial(_baseline, name, registry), str(Setting.CLEAN)) for name in settings},
        )

    def route(self, route_id: str) -> Route | None:
        """Return a route of the run; None when its specification does not lead to it any more."""
        return next((route for routes in self.routes.values() for route in routes if route.id == route_id), None)

    def spec_of(self, route_id: str) -> str:
        """Return the route specification that holds a route; the first of the run where none can be resolved."""
        specs = (spec for spec, routes in self.routes.items() for route in routes if route.id == route_id)
        return next(specs, "") or next((str(row["routes_spec"]) for row in self.document["summaries"]), "")

    @property
    def mode(self) -> str:
        """How its metrics were computed: `"bench2drive"` or `"fixed"`."""
        return str(self.document["settings"]["metrics"])

    @property
    def alpha(self) -> float:
        """How often a verdict from evidence was allowed to be wrong, each way; 0.05 where the run does not tell."""
        return float(self.document["settings"].get("alpha", 0.05))

    def baseline(self, setting: str) -> str:
        """Return the sentence of the clean drive that a setting is compared with."""
        return self.baselines.get(setting, str(Setting.CLEAN))

    def is_clean(self, setting: str) -> bool:
        """True for a setting that others are compared with."""
        return self.baseline(setting) == setting

    def twin(self, episode: Episode) -> EpisodeResult | None:
        """Return the clean episode that one under a setting is compared with; None for a clean one."""
        baseline = self.baseline(episode.setting)
        return None if baseline == episode.setting else self.results.get(replace(episode, setting=baseline))

    def of_setting(
        self, agent: str, setting: str, route_ids: Iterable[str], seeds: Sequence[int]
    ) -> list[EpisodeResult]:
        """Return the episodes of these routes and seeds that the run holds, in this order."""
        episodes = (Episode(agent, route_id, setting, seed) for route_id in route_ids for seed in seeds)
        return [self.results[episode] for episode in episodes if episode in self.results]


def _result(item: Mapping[str, Any], find: Find) -> EpisodeResult:
    """Return the stored episode where it is the drive that the document tells of, else what the document tells."""
    stored = find(item["key"])
    if stored is not None and (stored.end.value, stored.trace.digest) == (item["end"], item["trace_digest"]):
        return stored
    return episode_of(item)


def stored_episodes(folder: Path) -> Find:
    """Return what finds an episode in a store; one that is not there or not whole is None."""
    files = RecordFiles(folder)

    def find(key: str) -> EpisodeResult | None:
        try:
            data = files.read(key)
            return None if data is None else decode_episode(data)
        except (OSError, ValueError):
            return None

    return find


def _baseline(setting: str, registry: Registry) -> str:
    return str(Setting.parse(setting, registry.perturbations()).baseline)


def _found(look_up: Callable[[], T], otherwise: S) -> T | S:
    """Return what is looked up; `otherwise` for what this machine does not know."""
    try:
        return look_up()
    except (DriveRobustError, ImportError):
        return otherwise
