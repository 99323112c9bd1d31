"""The snapshot of a run for comparisons: scores by route of each agent and setting, with their fingerprints."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from statistics import fmean

from pytest_drive_robust.regression.clock import minute_text
from pytest_drive_robust.regression.fingerprint import Fingerprint

CellKey = tuple[str, str]
"""(agent, setting), the setting as its sentence."""


@dataclass(frozen=True, slots=True)
class Taken:
    """One scored episode: driving score 0..100, success, and in a few words how the episode ended."""

    seed: int
    ds: float
    success: bool
    outcome: str


@dataclass(frozen=True, slots=True)
class RouteScore:
    """One route of one agent under one setting, the seeds averaged: `ds` 0..100, `sr` 0..1.

    `outcome` and `worst_seed` are those of the seed with the lowest driving score. `digest` is the digest of the
    route's content, empty when not recorded. `fingerprint` says with what the route was driven. `ds_of_seeds` are the
    driving scores of `seeds`, one each, empty when not recorded.
    """

    route_id: str
    scenario: str
    ds: float
    sr: float
    seeds: tuple[int, ...]
    worst_seed: int
    outcome: str
    digest: str
    fingerprint: Fingerprint
    ds_of_seeds: tuple[float, ...] = field(default=(), compare=False)

    @classmethod
    def of(
        cls, route_id: str, scenario: str, taken: Sequence[Taken], *, digest: str, fingerprint: Fingerprint
    ) -> RouteScore:
        """Return the score of a route as the mean over its episodes, at least one."""
        worst = min(taken, key=lambda item: (item.ds, item.seed))
        by_seed = sorted(taken, key=lambda item: item.seed)
        return cls(
            route_id=route_id,
            scenario=scenario,
            ds=fmean(item.ds for item in taken),
            sr=fmean(item.success for item in taken),
            seeds=tuple(item.seed for item in by_seed),
            worst_seed=worst.seed,
            outcome=worst.outcome,
            digest=digest,
            fingerprint=fingerprint,
            ds_of_seeds=tuple(item.ds for item in by_seed),
        )

    def paired_with(self, clean: RouteScore) -> tuple[float, float]:
        """Return the driving score and that of the clean drive of the route, over the seeds that both have.

        Tests may drive a setting and its clean twin with more seeds than those of an RD. Where the scores of the seeds
        were not recorded, all seeds count.
        """
        both = {*self.seeds} & {*clean.seeds}
        return self._ds_over(both), clean._ds_over(both)

    def _ds_over(self, seeds: Collection[int]) -> float:
        known = [ds for seed, ds in zip(self.seeds, self.ds_of_seeds, strict=False) if seed in seeds]
        return fmean(known) if known else self.ds

    @property
    def succeeds(self) -> bool:
        """True when more than half of the seeds succeeded."""
        return self.sr > 0.5


@dataclass(frozen=True, slots=True)
class Cell:
    """One agent under one setting; `broken` has a sentence for each episode without a score.

    `routes_spec` finds each of the cell's routes; it is empty when the file of a route is unknown. `stopped` has text
    such as `"3 of 10 routes of dev10"` for each set of routes of which verdicts left some out. Routes that were driven
    only until a verdict was reached cannot be compared.
    """

    agent: str
    setting: str
    routes_spec: str
    routes: Mapping[str, RouteScore]
    broken: tuple[str, ...] = ()
    stopped: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """`"AGENT under SETTING"`."""
        return f"{self.agent} under {self.setting}"


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The scores of a run, or of baselines. `label` is its name for people; `date` and `commit` are empty if unknown.

    `ended_early` is True when the run ended before all its tests, or some tests broke, so that settings may be missing.
    `stopped_tests` are tests that their own verdict stopped: settings that they state after it are missing, too.
    """

    label: str
    cells: Mapping[CellKey, Cell]
    date: str = ""
    commit: str = ""
    ended_early: bool = False
    stopped_tests: tuple[str, ...] = ()

    @property
    def made(self) -> str:
        """When and from which commit the run was stored, as far as that is known: `"2026-11-30 00:03 UTC, 1a2b3c4"`."""
        return ", ".join(text for text in (minute_text(self.date), self.commit) if text)

    @property
    def simulator(self) -> str | None:
        """The name of the simulator that drove the run, or None when there is no score."""
        scores = (score for cell in self.cells.values() for score in cell.routes.values())
        return next((score.fingerprint.simulator for score in scores), None)

    @property
    def is_complete(self) -> bool:
        """False when an episode has no score or the run ended before all its tests."""
        return not self.lacks

    @property
    def lacks(self) -> str:
        """A clause about what an incomplete run lacks, such as `"a under clean on 7, seed 0: no map, and 1 more"`."""
        broken = [f"{cell.name} on {told}" for cell in self.cells.values() for told in cell.broken]
        return first_of(broken) or ("not all of its tests came to their verdicts" if self.ended_early else "")

    @property
    def left_out(self) -> str:
        """The routes that verdicts left out, such as `"3 of 10 routes of dev10 under clean, and 1 more"`; or empty."""
        return first_of([f"{told} under {cell.setting}" for cell in self.cells.values() for told in cell.stopped])

    def of_agent(self, agent: str) -> Snapshot:
        """Return the snapshot with the cells of one agent."""
        return replace(self, cells={key: cell for key, cell in self.cells.items() if cell.agent == agent})

    @property
    def agents(self) -> tuple[str, ...]:
        """The names of all agents, each once, in the order of the run."""
        return tuple(dict.fromkeys(agent for agent, _ in self.cells))


def first_of(told: Sequence[str]) -> str:
    """Return `"a under clean on 7, and 2 more"`: the first of some clauses and the number of the others; or empty."""
    more = f", and {len(told) - 1} more" if len(told) > 1 else ""
    return told[0] + more if told else ""
