"""The result of a comparison, as frozen dataclasses for reports."""

from __future__ import annotations

from dataclasses import dataclass

from pytest_drive_robust.regression.allowance import DEFAULT_ALLOWANCES, Allowance
from pytest_drive_robust.regression.fingerprint import Mismatch, MismatchPolicy
from pytest_drive_robust.regression.snapshot import RouteScore, Snapshot
from pytest_drive_robust.regression.verdicts import Quartet, Rise, rise_of

_WORST_FIRST = ("error", "fail", "inconclusive", "pass")


@dataclass(frozen=True, slots=True)
class Terms:
    """The terms of a comparison: the allowances, the rule that judges them, and the policy for mismatches.

    `rule` is `"evidence"`, `"list"`, `"point"`, or `"auto"`, which chooses by the routes and seeds that both runs hold.
    With `open_fails` an inconclusive verdict on changed scores counts as a regression.
    """

    allowances: tuple[Allowance, ...] = DEFAULT_ALLOWANCES
    rule: str = "auto"
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
    """A route that succeeded in one run and failed in the other. `fails` is True for a route that newly goes wrong."""

    fails: bool
    before: RouteScore
    after: RouteScore


@dataclass(frozen=True, slots=True)
class Finding:
    """The verdict on one allowance: `"pass"`, `"fail"`, `"inconclusive"` or `"error"`.

    `problem` says why nothing was judged (an error), or why an inconclusive rise of RD cannot pass.

    `rule` is the rule that judged the scores of `routes` routes, of which `changed` routes have other scores than
    before; for RD the clean scores count too. `rule` is empty and the counts are 0 when nothing was judged.
    """

    allowance: Allowance
    verdict: str
    rule: str = ""
    routes: int = 0
    changed: int = 0
    problem: str = ""

    @property
    def is_open(self) -> bool:
        """True when scores changed and the verdict is inconclusive."""
        return self.verdict == "inconclusive" and self.changed > 0


@dataclass(frozen=True, slots=True)
class CellComparison:
    """One agent under one setting in both runs; `agent` is its name in the new run, `agent_before` in the old run.

    `routes` counts the routes in both runs, `missing` the routes only in the old run, `added` the routes only in the
    new run, and `changed` the common routes with another score. `quartets` holds the common routes with clean scores in
    both runs; empty when some episode was not scored. `same_seeds` says whether both runs drove equal seeds.
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
    def name(self) -> str:
        """`"AGENT under SETTING"`, as in the new run."""
        return f"{self.agent} under {self.setting}"

    @property
    def all_routes(self) -> int:
        """The number of routes that the two runs hold together."""
        return self.routes + self.missing + self.added

    @property
    def verdict(self) -> str:
        """The worst verdict of the findings."""
        found = {finding.verdict for finding in self.findings}
        return next(verdict for verdict in _WORST_FIRST if verdict in found)

    @property
    def is_open(self) -> bool:
        """True when scores changed and the verdict is inconclusive."""
        return self.verdict == "inconclusive" and any(finding.is_open for finding in self.findings)

    @property
    def regressed(self) -> bool:
        """True when the new run is worse than the old run, or was not scored."""
        return self.verdict in ("fail", "error")

    @property
    def rise(self) -> Rise | None:
        """The rise of RD; None under a clean setting and when too few routes were driven."""
        return rise_of(self.quartets)


@dataclass(frozen=True, slots=True)
class Comparison:
    """How the run `after` compares with the run `before`, cell by cell.

    `unscored` has a sentence for each setting of the old run of which the new run needed episodes and scored none.
    `elsewhere` counts the settings that cannot be compared because one run lacks the setting or its routes.
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
        """The mismatches that forbid the comparison under its policy; if there are any, no verdict counts."""
        return tuple(item for item in self.mismatches if item.refuses(self.terms.policy))

    @property
    def regressions(self) -> tuple[CellComparison, ...]:
        """The settings that got worse than allowed."""
        return tuple(cell for cell in self.cells if cell.verdict == "fail")

    @property
    def open(self) -> tuple[CellComparison, ...]:
        """The settings in which scores changed and the verdict is inconclusive."""
        return tuple(cell for cell in self.cells if cell.is_open)

    @property
    def unjudged(self) -> tuple[str, ...]:
        """`"AGENT under SETTING: REASON"` for each setting that could not be judged."""
        errors = (
            f"{cell.name}: {next(item.problem for item in cell.findings if item.verdict == 'error')}"
            for cell in self.cells
            if cell.verdict == "error"
        )
        return (*errors, *self.unscored)

    @property
    def regressed(self) -> bool:
        """True when the new run got worse or could not be judged; with `open_fails`, also when a setting is open."""
        return bool(self.regressions or self.unjudged or (self.terms.open_fails and self.open))

    @property
    def mean_rises(self) -> dict[str, Rise]:
        """The rise of the mean RD over all settings, for each agent with two or more settings."""
        quartets: dict[str, list[tuple[Quartet, ...]]] = {}
        for cell in self.cells:
            if cell.quartets:
                quartets.setdefault(cell.agent, []).append(cell.quartets)
        rises = {agent: rise_of(*settings) for agent, settings in quartets.items() if len(settings) > 1}
        return {agent: rise for agent, rise in rises.items() if rise is not None}
