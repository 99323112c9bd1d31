"""What a comparison needs of a run: per-route scores of each agent and setting, and what they were driven with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean

from pytest_drive_robust.regression.fingerprint import Fingerprint

CellKey = tuple[str, str]
"""(agent, setting), the setting as its sentence."""


@dataclass(frozen=True, slots=True)
class Taken:
    """One scored episode: driving score 0..100, success, and how it ended in a few words."""

    seed: int
    ds: float
    success: bool
    outcome: str


@dataclass(frozen=True, slots=True)
class RouteScore:
    """One route of one agent under one setting, the seeds averaged: `ds` 0..100, `sr` 0..1.

    `outcome` and `worst_seed` are those of the seed with the lowest driving score. `digest` names the content of the
    route and is empty when it was not recorded; `fingerprint` is what it was driven with.
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

    @classmethod
    def of(
        cls, route_id: str, scenario: str, taken: Sequence[Taken], *, digest: str, fingerprint: Fingerprint
    ) -> RouteScore:
        """Return the mean over the episodes of a route, at least one."""
        worst = min(taken, key=lambda item: (item.ds, item.seed))
        return cls(
            route_id=route_id,
            scenario=scenario,
            ds=fmean(item.ds for item in taken),
            sr=fmean(item.success for item in taken),
            seeds=tuple(sorted(item.seed for item in taken)),
            worst_seed=worst.seed,
            outcome=worst.outcome,
            digest=digest,
            fingerprint=fingerprint,
        )

    @property
    def succeeds(self) -> bool:
        """True when more than half of the seeds succeeded."""
        return self.sr > 0.5


@dataclass(frozen=True, slots=True)
class Cell:
    """One agent under one setting. `broken` tells of each episode that the simulator broke: it has no score.

    `routes_spec` leads to each of its routes; it is empty where nothing tells which file holds one.
    `stopped` tells of each set of routes of which verdicts did without some: `"3 of 10 routes of dev10"`. What was
    driven until a verdict was in says nothing about two runs.
    """

    agent: str
    setting: str
    routes_spec: str
    routes: Mapping[str, RouteScore]
    broken: tuple[str, ...] = ()
    stopped: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Snapshot:
    """A run, or what was blessed of several. `label` is how people call it; date and commit are empty if unknown.

    `ended_early` is True where the run ended before all of its tests had, or some broke: settings may be missing.
    """

    label: str
    cells: Mapping[CellKey, Cell]
    date: str = ""
    commit: str = ""
    ended_early: bool = False

    @property
    def made(self) -> str:
        """When and of which commit, in a few words."""
        return ", ".join(text for text in (self.date, self.commit) if text)

    @property
    def simulator(self) -> str | None:
        """The name of the simulator that it was driven in; None when it holds no score."""
        scores = (score for cell in self.cells.values() for score in cell.routes.values())
        return next((score.fingerprint.simulator for score in scores), None)

    @property
    def is_complete(self) -> bool:
        """False where an episode has no score, as the simulator broke it, and where the run ended before its tests."""
        return not (self.ended_early or any(cell.broken for cell in self.cells.values()))

    @property
    def agents(self) -> tuple[str, ...]:
        """Every agent once, in the order of the run."""
        return tuple(dict.fromkeys(agent for agent, _ in self.cells))
