"""What a comparison found: frozen facts for reports."""

from __future__ import annotations

from dataclasses import dataclass

from pytest_drive_robust.regression.allowance import DEFAULT_ALLOWANCES, Allowance
from pytest_drive_robust.regression.fingerprint import Mismatch, MismatchPolicy
from pytest_drive_robust.regression.snapshot import RouteScore, Snapshot
from pytest_drive_robust.regression.verdicts import Quartet, Rise, rise_of

_WORST_FIRST = ("error", "fail", "inconclusive", "pass")


@dataclass(frozen=True, slots=True)
class Terms:
    """How two runs are compared: what may get worse, which rule judges it, and what to do when they do not match.

    `kind` is `"evidence"`, `"list"`, `"point"`, or `"auto"`: by the routes and seeds that both runs hold. `open_fails`
    says that the new run must not pass where scores changed and it is open what that means.
    """

    allowances: tuple[Allowance, ...] = DEFAULT_ALLOWANCES
    kind: str = "auto"
    policy: MismatchPolicy = "default"
    open_fails: bool = False


@dataclass(frozen=True, slots=True)
class Numbers:
    """Means over the routes that both runs hold: DS 0..100, SR 0..1, RD (None where a clean score is missing)."""

    ds: float
    sr: float
    rd: float | None


@dataclass(frozen=True, slots=True)
class Flip:
    """A route that succeeded in one run and failed in the other. `fails` is True for a newly failing one."""

    fails: bool
    before: RouteScore
    after: RouteScore


@dataclass(frozen=True, slots=True)
class Finding:
    """The verdict on one allowance: `"pass"`, `"fail"`, `"inconclusive"`, or `"error"` with the reason in `problem`.

    `rule` is what judged it, by the scores of `routes`, of which those of `changed` are others than before: an RD reads
    the clean scores, too. Empty and 0 where nothing judged it.
    """

    allowance: Allowance
    verdict: str
    rule: str = ""
    routes: int = 0
    changed: int = 0
    problem: str = ""

    @property
    def is_open(self) -> bool:
        """True when something changed and it is open what that means."""
        return self.verdict == "inconclusive" and self.changed > 0


@dataclass(frozen=True, slots=True)
class CellComparison:
    """One agent under one setting in both runs. `agent` is its name in the new run, `agent_before` in the old one.

    `routes` are in both runs, `missing` only in the old one, `added` only in the new one; `changed` of the first have
    another score under this setting. `quartets` are those with clean scores in both, none where some route was not
    scored. `same_seeds` says whether both runs drove them with the same seeds.
    """

    agent: str
    agent_before: str
    setting: str
    routes_spec: str
    before: Numbers
    after: Numbers
    routes: int
    missing: int
    added: int
    changed: int
    quartets: tuple[Quartet, ...]
    findings: tuple[Finding, ...]
    flips: tuple[Flip, ...]
    same_seeds: bool

    @property
    def all_routes(self) -> int:
        """How many routes either run holds."""
        return self.routes + self.missing + self.added

    @property
    def verdict(self) -> str:
        """The worst of the findings."""
        found = {finding.verdict for finding in self.findings}
        return next(verdict for verdict in _WORST_FIRST if verdict in found)

    @property
    def is_open(self) -> bool:
        """True when something changed and it is open what that means."""
        return self.verdict == "inconclusive" and any(finding.is_open for finding in self.findings)

    @property
    def regressed(self) -> bool:
        """True when the new run must not pass for as good as the old one: it is worse, or was not scored."""
        return self.verdict in ("fail", "error")

    @property
    def rise(self) -> Rise | None:
        """What RD rose by; None under a clean setting and where too little was driven."""
        return rise_of(self.quartets)


@dataclass(frozen=True, slots=True)
class Comparison:
    """How the run `after` compares with the run `before`, cell by cell.

    `unscored` tells of each setting of the old run of which the new one asked for episodes and scored none. `elsewhere`
    counts the settings that one of the runs holds and the other one lacks.
    """

    before: Snapshot
    after: Snapshot
    terms: Terms
    cells: tuple[CellComparison, ...]
    mismatches: tuple[Mismatch, ...]
    notes: tuple[str, ...] = ()
    unscored: tuple[str, ...] = ()
    elsewhere: int = 0

    @property
    def refusals(self) -> tuple[Mismatch, ...]:
        """The differences that forbid the comparison under its policy; when there are any, no verdict counts."""
        return tuple(item for item in self.mismatches if item.refuses(self.terms.policy))

    @property
    def regressions(self) -> tuple[CellComparison, ...]:
        """The settings that got worse than allowed."""
        return tuple(cell for cell in self.cells if cell.verdict == "fail")

    @property
    def open(self) -> tuple[CellComparison, ...]:
        """The settings in which scores changed and it is open what that means."""
        return tuple(cell for cell in self.cells if cell.is_open)

    @property
    def unjudged(self) -> tuple[str, ...]:
        """`"AGENT under SETTING: REASON"` for each setting that could not be judged."""
        errors = (
            f"{cell.agent} under {cell.setting}: {next(item.problem for item in cell.findings if item.problem)}"
            for cell in self.cells
            if cell.verdict == "error"
        )
        return (*errors, *self.unscored)

    @property
    def regressed(self) -> bool:
        """True when the new run must not pass for as good as the old one, if the two can be compared."""
        return bool(self.regressions or self.unjudged or (self.terms.open_fails and self.open))

    @property
    def mean_rises(self) -> dict[str, Rise]:
        """What the mean RD of all settings rose by, of each agent that has two or more of them."""
        quartets: dict[str, list[tuple[Quartet, ...]]] = {}
        for cell in self.cells:
            if cell.quartets:
                quartets.setdefault(cell.agent, []).append(cell.quartets)
        rises = {agent: rise_of(*settings) for agent, settings in quartets.items() if len(settings) > 1}
        return {agent: rise for agent, rise in rises.items() if rise is not None}
