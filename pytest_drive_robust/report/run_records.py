"""A stored run: its document and the result of each episode, with the trace if it is stored."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, TypeVar

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import DriveRobustError
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.regression.clean_settings import clean_sentence
from pytest_drive_robust.regression.document import damaged, episode_of, routes_of_one_id
from pytest_drive_robust.regression.references import project_store, read_run_document
from pytest_drive_robust.runner.before_driving import routes_of
from pytest_drive_robust.runner.cache_key.identity import route_digest
from pytest_drive_robust.simulators.base import Simulator
from pytest_drive_robust.store.base import Find
from pytest_drive_robust.store.lookup import stored_episodes

T = TypeVar("T")
S = TypeVar("S")


@dataclass(frozen=True)
class RunRecords:
    """One stored run; `results` are the results of its episodes, in the order of the run.

    An episode whose record is missing, or is the record of another drive, has an empty trace. `keys` holds the store
    key of each episode, `routes` the routes of each route specification that can still be resolved. `simulator` is None
    when the simulator cannot be created here. `baselines` maps each setting to its clean setting.
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
        """Return the run of a reference: a stored run, `"latest"` or a JSON file; its episodes come from the store.

        `store` is the folder of the episodes, by default the store of the project. Raises `UsageError`,
        also for a stored episode that cannot be read.
        """
        document = read_run_document(reference)
        stored = document.get("stored")
        label = str(stored.get("name") or reference) if isinstance(stored, dict) else reference
        find = stored_episodes(store or project_store())
        return cls.of(document, find, registry, label=label)

    @classmethod
    def of(cls, document: Mapping[str, Any], find: Find, registry: Registry, *, label: str) -> RunRecords:
        """Return the run of a document, with the stored episodes that `find` returns for its keys.

        Raises `UsageError` for a damaged document, and when two routes have one id.
        """
        try:
            items = document["episodes"]
            episodes = [Episode(item["agent"], item["route_id"], item["setting"], item["seed"]) for item in items]
            known = list(zip(episodes, items, strict=True))
            results = {episode: _result(episode, item, find) for episode, item in known}
            keys = {episode: item["key"] for episode, item in known}
            specs = dict.fromkeys(row["routes_spec"] for row in document["summaries"])
            settings = dict.fromkeys(row["setting"] for row in document["summaries"])
            name = document["settings"]["simulator"]
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise damaged(label, error) from None
        if len(results) < len(episodes):  # two route files with a common id
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
            baselines={name: clean_sentence(name, registry) for name in settings},
        )

    def route(self, route_id: str) -> Route | None:
        """Return a route as the run drove it; None when it was changed, or its specification cannot be resolved."""
        return self._as_driven.get(route_id)

    @property
    def changed_routes(self) -> tuple[str, ...]:
        """The ids of driven routes whose content is not what the run drove: a route file was edited, or is another."""
        driven = dict.fromkeys(episode.route_id for episode in self.results)
        known = {route.id for routes in self.routes.values() for route in routes}
        return tuple(name for name in driven if name in known and name not in self._as_driven)

    @cached_property
    def _as_driven(self) -> Mapping[str, Route]:
        digests = self.document.get("fingerprint", {}).get("routes", {})  # older runs do not tell
        routes = {route.id: route for routes in self.routes.values() for route in routes}
        return {name: route for name, route in routes.items() if digests.get(name) in (None, route_digest(route))}

    def spec_of(self, route_id: str) -> str:
        """Return the route specification that holds a route; the run's first specification if none can be resolved."""
        specs = (spec for spec, routes in self.routes.items() for route in routes if route.id == route_id)
        return next(specs, "") or next((str(row["routes_spec"]) for row in self.document["summaries"]), "")

    @property
    def mode(self) -> str:
        """The metric mode of the run: `"bench2drive"` or `"fixed"`."""
        return str(self.document["settings"]["metrics"])

    @property
    def alpha(self) -> float:
        """The alpha of verdicts from evidence, for each side; 0.05 when the document does not tell."""
        return float(self.document["settings"].get("alpha", 0.05))

    def baseline(self, setting: str) -> str:
        """Return the sentence of the clean setting that `setting` is compared with."""
        return self.baselines.get(setting, str(Setting.CLEAN))

    def is_clean(self, setting: str) -> bool:
        """Return True for a clean setting, with which other settings are compared."""
        return self.baseline(setting) == setting

    def twin(self, episode: Episode) -> EpisodeResult | None:
        """Return the clean episode with which `episode` is compared; None for a clean episode or without a twin."""
        baseline = self.baseline(episode.setting)
        return None if baseline == episode.setting else self.results.get(replace(episode, setting=baseline))

    def of_setting(
        self, agent: str, setting: str, route_ids: Iterable[str], seeds: Sequence[int]
    ) -> list[EpisodeResult]:
        """Return the results of these routes and seeds that the run holds, by route, then by seed."""
        episodes = (Episode(agent, route_id, setting, seed) for route_id in route_ids for seed in seeds)
        return [self.results[episode] for episode in episodes if episode in self.results]


def _result(episode: Episode, item: Mapping[str, Any], find: Find) -> EpisodeResult:
    """Return the stored episode if its name, end and trace digest match the document, else that of the document."""
    stored, said = find(item["key"]), (episode, item["end"], item["trace_digest"])
    if stored is not None and (stored.episode, stored.end.value, stored.trace.digest) == said:
        return stored
    return episode_of(item)


def _found(look_up: Callable[[], T], otherwise: S) -> T | S:
    """Return the result of `look_up`, or `otherwise` when a name or package is unknown on this machine."""
    try:
        return look_up()
    except (DriveRobustError, ImportError):
        return otherwise
