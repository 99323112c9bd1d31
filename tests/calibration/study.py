"""The study: what a rule promises, measured on made-up scores whose truth is known.

Every `Bar` is one promise with what was measured; `misses` names those that are broken by more than two standard errors
of the study itself. A rule is any `rule(clean, perturbed, threshold, margin, alpha) -> (verdict, pairs)`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import NamedTuple

import numpy as np
from paper_table import PAPER, SETTINGS
from score_model import (
    PROFILES,
    Latent,
    Scores,
    draw_pairs,
    draw_runs,
    quantiles,
    rd_of,
    true_means,
    true_rd,
    twist_of,
)
from score_shapes import SHAPES, WITHOUT_SPREAD

from pytest_drive_robust.stats import gate
from pytest_drive_robust.stats.evidence import LinearForms, degradation_forms, mean_forms
from pytest_drive_robust.stats.intervals import evidence_interval
from pytest_drive_robust.stats.judges import EvidenceJudge, ListJudge, PointJudge

GateRule = Callable[[Sequence[float], Sequence[float], float, float, float], tuple[str, int]]

ALPHA = 0.05
ROUTES = (20, 50, 100, 220)
AGENTS = ("strong", "mid", "weak")
ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class Bar:
    """`measured` must not be above `at_most`, or not below `at_least`; `error` is its Monte-Carlo standard error."""

    name: str
    measured: float
    error: float
    at_most: float = math.inf
    at_least: float = -math.inf

    @property
    def holds(self) -> bool:
        return self.at_least - 2.0 * self.error <= self.measured <= self.at_most + 2.0 * self.error

    def __str__(self) -> str:
        bound = f"<= {self.at_most:g}" if self.at_most < math.inf else f">= {self.at_least:g}"
        return f"{'ok  ' if self.holds else 'MISS'}  {self.name:58} {self.measured:8.3f}  {bound}"


class Outcome(NamedTuple):
    """Of many studies of one case: shares of the verdicts and the pairs used."""

    studies: int
    fails: float
    passes: float
    pairs: float
    pairs_error: float

    def error(self, probability: float) -> float:
        """The standard error of a share whose truth is `probability`."""
        return math.sqrt(probability * (1.0 - probability) / self.studies)


def misses(bars: Sequence[Bar]) -> list[str]:
    return [str(bar) for bar in bars if not bar.holds]


def judge_all(rule: GateRule, scores: tuple[Scores, Scores], threshold: float, margin: float) -> Outcome:
    found = [
        rule(clean, perturbed, threshold, margin, ALPHA)
        for clean, perturbed in zip(scores[0].tolist(), scores[1].tolist(), strict=True)
    ]
    pairs = np.array([used for _, used in found], dtype=float)
    shares = [sum(verdict == wanted for verdict, _ in found) / len(found) for wanted in ("fail", "pass")]
    return Outcome(len(found), *shares, float(pairs.mean()), float(pairs.std() / math.sqrt(len(found))))


def error_bars(rule: GateRule, studies: int, *, seed: int = 1) -> Iterator[Bar]:
    """False fails with RD at the threshold and wrong passes at threshold + margin: all profiles, shapes and sizes."""
    seeds = count(1000 * seed)
    for profile in PROFILES:
        limit, margin = (0.02, 0.05) if profile == "expert" else (0.30, 0.10)
        for routes in ROUTES:
            at, over = true_rd(profile, limit), true_rd(profile, limit + margin)
            exact = draw_pairs(profile, limit, studies=studies, routes=routes, seed=next(seeds))
            wrong = draw_pairs(profile, limit + margin, studies=studies, routes=routes, seed=next(seeds))
            yield from _both_errors(rule, f"{profile}, {routes} routes", exact, wrong, at, over - margin, margin)
    for name, (shape, limit, margin) in SHAPES.items():
        drawn = math.ceil(studies / 4) if name in WITHOUT_SPREAD else studies
        for routes in ROUTES:
            exact = shape(limit, drawn, routes, next(seeds))
            wrong = shape(limit + margin, drawn, routes, next(seeds))
            yield from _both_errors(rule, f"{name}, {routes} routes", exact, wrong, limit, limit, margin)


def _both_errors(
    rule: GateRule,
    name: str,
    exact: tuple[Scores, Scores],
    wrong: tuple[Scores, Scores],
    limit: float,
    limit_of_wrong: float,
    margin: float,
) -> Iterator[Bar]:
    at = judge_all(rule, exact, limit, margin)
    over = judge_all(rule, wrong, limit_of_wrong, margin)
    yield Bar(f"false fail: {name}", at.fails, at.error(ALPHA), at_most=ALPHA)
    yield Bar(f"wrong pass: {name}", over.passes, over.error(ALPHA), at_most=ALPHA)


def zero_bars(rule: GateRule) -> Iterator[Bar]:
    """Agents that never move: perturbed ones fail, clean ones leave nothing to say."""
    for routes in ROUTES:
        zeros = np.zeros((1, routes))
        dead = judge_all(rule, (zeros + 80.0, zeros), 0.30, 0.10)
        yield Bar(f"fail: perturbed all zero, {routes} routes", dead.fails, 0.0, at_least=1.0)
        for after in (0.0, 80.0):
            unborn = judge_all(rule, (zeros, zeros + after), 0.30, 0.10)
            decided = unborn.fails + unborn.passes
            yield Bar(f"decided: clean all zero, perturbed {after:g}, {routes} routes", decided, 0.0, at_most=0.0)


_POWER = {"strong": (0.97, 60, 22), "mid": (0.92, 80, 33), "weak": (0.92, 95, 40)}


def power_bars(rule: GateRule, studies: int, *, seed: int = 1) -> Iterator[Bar]:
    """220 routes, limit 0.30: what is caught at +0.10 and +0.20, what passes at 0.05, and how soon."""
    seeds = count(1000 * seed + 500)
    for profile, (power, pairs_far, pairs_good) in _POWER.items():

        def outcome(rd: float, profile: str = profile) -> Outcome:
            return judge_all(rule, draw_pairs(profile, rd, studies=studies, routes=220, seed=next(seeds)), 0.30, 0.10)

        below, near, far, good = outcome(0.25), outcome(0.40), outcome(0.50), outcome(0.05)
        yield Bar(f"false fail 0.05 below the limit: {profile}", below.fails, below.error(0.005), at_most=0.005)
        yield Bar(f"power at +0.10: {profile}", near.fails, near.error(power), at_least=power)
        yield Bar(f"power at +0.20: {profile}", far.fails, far.error(0.99), at_least=0.99)
        yield Bar(f"pairs at +0.20: {profile}", far.pairs, far.pairs_error, at_most=pairs_far)
        yield Bar(f"pass at RD 0.05: {profile}", good.passes, good.error(0.99), at_least=0.99)
        yield Bar(f"pairs at RD 0.05: {profile}", good.pairs, good.pairs_error, at_most=pairs_good)


def regression_bars(rule: GateRule, studies: int, *, seed: int = 1) -> Iterator[Bar]:
    """The same rule on a stored run and a new one, fresh seeds: the allowed relative drop is 0.05."""
    seeds = count(1000 * seed + 900)
    for profile, power in (("strong", 0.97), ("mid", 0.93)):
        same = draw_runs(profile, 0.10, 0.0, studies=studies, routes=220, seed=next(seeds))
        worse = draw_runs(profile, 0.10, 0.20, studies=studies, routes=220, seed=next(seeds))
        alarm, caught = judge_all(rule, same, 0.05, 0.10), judge_all(rule, worse, 0.05, 0.10)
        yield Bar(f"alarm on an unchanged agent: {profile}", alarm.fails, alarm.error(0.005), at_most=0.005)
        yield Bar(f"a drop of 0.20 is noticed: {profile}", caught.fails, caught.error(power), at_least=power)


def all_bars(rule: GateRule, studies: int, *, seed: int = 1) -> list[Bar]:
    return [
        *error_bars(rule, studies, seed=seed),
        *zero_bars(rule),
        *power_bars(rule, studies, seed=seed),
        *regression_bars(rule, studies, seed=seed),
    ]


class Cell(NamedTuple):
    """One model under one setting, judged against RD <= 0.30 in many studies."""

    model: str
    setting: str
    rd: float
    outcome: Outcome


def paper_suite(rule: GateRule, studies: int, *, seed: int = 1, routes: int = 220) -> tuple[list[Cell], float]:
    """The 44 cells of the paper's table, and the mean episodes of the whole suite; a clean run is shared by a model."""
    cells, episodes = [], 0.0
    for number, (model, (seed_share, rows)) in enumerate(PAPER.items()):
        latent = Latent(seed_share, studies, routes, 7000 + 10 * seed + number)
        tables = [quantiles(ds, sr / 100.0) for ds, sr in rows]
        clean = latent.run(tables[0], twist=0.0).tolist()
        longest = np.zeros(studies)
        for setting, table in zip(SETTINGS[1:], tables[1:], strict=True):
            rd = rd_of(tables[0], table)
            perturbed = latent.run(table, twist=twist_of(rd)).tolist()
            found = [rule(a, b, 0.30, 0.10, ALPHA) for a, b in zip(clean, perturbed, strict=True)]
            pairs = np.array([used for _, used in found], dtype=float)
            longest = np.maximum(longest, pairs)
            shares = [sum(verdict == wanted for verdict, _ in found) / studies for wanted in ("fail", "pass")]
            cells.append(Cell(model, setting, rd, Outcome(studies, *shares, float(pairs.mean()), float(pairs.std()))))
            episodes += float(pairs.mean())
        episodes += float(longest.mean())
    return cells, episodes


def mean_bars(studies: int, *, seed: int = 1) -> Iterator[Bar]:
    """The rules for SR, DS and efficiency in both directions: wrong verdicts with the truth at the limit and beyond."""
    seeds = count(1000 * seed + 300)
    for routes in ROUTES:
        scores = draw_pairs("mid", 0.10, studies=studies, routes=routes, seed=next(seeds))[1]
        ds, sr = true_means("mid", 0.10)
        speeds = np.random.default_rng(next(seeds)).gamma(2.0, 65.0, (studies, routes))
        for metric, values, truth, high, margin in (
            ("DS", scores, ds, 100.0, 10.0),
            ("SR", (scores == 100.0).astype(float), sr, 1.0, 0.10),
            ("efficiency", speeds, 130.0, math.inf, 30.0),
        ):
            for comparison, worse in ((">=", -1.0), ("<=", 1.0)):
                at = mean_forms(truth, comparison, low=0.0, high=high, margin=margin)
                over = mean_forms(truth - worse * margin, comparison, low=0.0, high=high, margin=margin)
                name = f"{metric} {comparison}, {routes} routes"
                fails = sum(_read(at, route_values) == "fail" for route_values in values.tolist()) / studies
                passes = sum(_read(over, route_values) == "pass" for route_values in values.tolist()) / studies
                error = math.sqrt(ALPHA * (1.0 - ALPHA) / studies)
                yield Bar(f"false fail: {name}", fails, error, at_most=ALPHA)
                yield Bar(f"wrong pass: {name}", passes, error, at_most=ALPHA)


def _read(forms: LinearForms, values: Sequence[float]) -> str:
    judge = EvidenceJudge(forms, alpha=ALPHA)
    for value in values:
        if judge.read(value) is not None:
            break
    return judge.close()


def list_bars(studies: int, *, seed: int = 1) -> Iterator[Bar]:
    """The verdict on a fixed list: how rarely it disagrees with all 220 routes, and what it saves."""
    seeds = count(1000 * seed + 600)
    forms = degradation_forms(0.30)
    pairs_at = {"strong": (17, 26, 33), "mid": (26, 43, 46), "weak": (32, 51, 55)}  # at RD 0, 0.10, 0.50
    for profile in AGENTS:
        for number, rd in enumerate((0.0, 0.10, 0.50, 0.25, 0.30, 0.35)):
            drawn = draw_pairs(profile, rd, studies=studies, routes=220, seed=next(seeds))
            wrong, used = 0, []
            for clean, perturbed in zip(drawn[0].tolist(), drawn[1].tolist(), strict=True):
                judge, full = ListJudge(forms, planned=220, alpha=ALPHA), PointJudge(forms)
                for before, after in zip(clean, perturbed, strict=True):
                    judge.read(after, before)
                    full.read(after, before)
                wrong += judge.close() != full.close()
                used.append(judge.routes)
            error = math.sqrt(ALPHA * (1.0 - ALPHA) / studies)
            yield Bar(f"list disagrees with all: {profile}, RD {rd:.2f}", wrong / studies, error, at_most=ALPHA)
            if number < 3:
                spread = float(np.std(used) / math.sqrt(studies))
                most = pairs_at[profile][number]
                yield Bar(f"pairs of the list: {profile}, RD {rd:.2f}", float(np.mean(used)), spread, at_most=most)


def interval_bars(studies: int, *, seed: int = 1) -> Iterator[Bar]:
    """The interval that a report shows beside a verdict that may have stopped early.

    How often it misses the truth on either side, and that it never contradicts the verdict.
    """
    seeds = count(1000 * seed + 800)
    for profile in AGENTS:
        for rd in (0.10, 0.30, 0.40, 0.50):
            drawn = draw_pairs(profile, rd, studies=studies, routes=220, seed=next(seeds))
            yield from _interval_bars(f"{profile}, RD {rd:.2f}", drawn, true_rd(profile, rd), 0.30, 0.10)
    for name in ("rare failures", "rare successes", "uneven loss"):
        shape, limit, margin = SHAPES[name]
        drawn = shape(limit, studies, 20, next(seeds))
        yield from _interval_bars(f"{name}, 20 routes", drawn, limit, limit, margin)


def _interval_bars(name: str, drawn: tuple[Scores, Scores], truth: float, limit: float, margin: float) -> Iterator[Bar]:
    studies, routes = drawn[0].shape
    above = below = contradicted = 0
    for clean, perturbed in zip(drawn[0].tolist(), drawn[1].tolist(), strict=True):
        verdict, used = gate(clean, perturbed, limit, margin, ALPHA)
        low, high = evidence_interval(clean[:used], perturbed[:used], ALPHA, ended=used == routes)
        above += low > truth + ROUNDING
        below += high < truth - ROUNDING
        contradicted += verdict == "fail" and low < limit - ROUNDING
        contradicted += verdict == "pass" and high > limit + margin + ROUNDING
    error = math.sqrt(ALPHA * (1.0 - ALPHA) / studies)
    yield Bar(f"interval above the truth: {name}", above / studies, error, at_most=ALPHA)
    yield Bar(f"interval below the truth: {name}", below / studies, error, at_most=ALPHA)
    yield Bar(f"interval against its verdict: {name}", contradicted / studies, 0.0, at_most=0.0)
