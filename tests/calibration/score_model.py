"""Driving scores as agents get them, made up: what the study of the verdicts and `benchmarks/verdicts.py` draw from.

One route's score is a mixture: 100 (success), completed with one to four penalties (mean 56), or given up on the way
(mean 23). The weights meet a mean and a success rate. Clean and perturbed runs of a route share latent scenario and
route effects, so good routes stay good; every run has luck of its own. Routes come in planned order: blocks with one
route of each of the 44 scenario types. The shares were set so that the noise
sd(D) / mean(clean) of the public result files of Bench2Drive agents comes out (0.29 to 0.33 strong, 0.4 to 0.5 others).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

Scores = NDArray[np.float64]

PENALTIES = np.array([0.60, 0.70, 0.65, 0.50, 0.80])
PENALTY_SHARES = np.array([0.65, 0.0875, 0.0875, 0.0875, 0.0875])
TABLE = 20_000
SCENARIOS = 44
SCENARIO_SHARE = 0.15
SEED_BINDS = 0.2
"""How much of a run's luck is that of the seed and not of chaos: clean and perturbed runs use the same seed."""


@dataclass(frozen=True, slots=True)
class Profile:
    """A kind of agent: clean score and success rate, and how much of a run is luck of the seed."""

    ds: float
    sr: float
    seed_share: float


PROFILES = {
    "strong": Profile(85.94, 0.6682, 0.50),
    "mid": Profile(59.90, 0.30, 0.43),
    "weak": Profile(45.81, 0.1636, 0.28),
    "expert": Profile(97.0, 0.92, 0.50),
}


def success_rate(ds: float) -> float:
    """The success rate that goes with a mean score, read off the 48 rows of the paper's table."""
    return float(
        np.interp(ds, [0, 22, 28, 34, 42, 50, 60, 86, 97, 100], [0, 0, 0.02, 0.06, 0.14, 0.23, 0.30, 0.67, 0.92, 1])
    )


@cache
def quantiles(ds: float, sr: float) -> Scores:
    """The score of a run by its luck 0..1, in `TABLE` steps; mean `ds`, exactly 100 for a share of about `sr`."""
    rng = np.random.default_rng(20)
    penalised = 100.0 * _penalties(rng, [0.0, 0.77, 0.14, 0.05, 0.04])
    given_up = 100.0 * rng.beta(1.2, 2.3, TABLE) * _penalties(rng, [0.32, 0.45, 0.14, 0.05, 0.04])
    rest = (ds - 100.0 * sr) / (1.0 - sr) if sr < 1.0 else 0.0
    share = float(np.clip((rest - given_up.mean()) / (penalised.mean() - given_up.mean()), 0.0, 1.0))
    kind = rng.random(TABLE)
    scores = np.where(kind < sr, 100.0, np.where(rng.random(TABLE) < share, penalised, given_up))
    failed = scores < 100.0
    if failed.any():  # meet the mean exactly: the draw of the table is no part of the study
        scores[failed] *= max(0.0, (ds * TABLE - 100.0 * np.sum(~failed)) / scores[failed].sum())
    return np.sort(np.clip(scores, 0.0, 100.0))


def _penalties(rng: np.random.Generator, shares: list[float]) -> Scores:
    count = rng.choice(5, size=TABLE, p=shares)
    factors = rng.choice(PENALTIES, size=(TABLE, 4), p=PENALTY_SHARES)
    return np.where(np.arange(4) < count[:, None], factors, 1.0).prod(axis=1)


def true_rd(profile: str, rd: float) -> float:
    """The RD that the made-up routes of a profile have when `rd` is asked for, exact to rounding."""
    clean, perturbed = _tables(profile, rd)
    return rd_of(clean, perturbed)


def true_means(profile: str, rd: float) -> tuple[float, float]:
    """The mean score and the success rate (0..1) of the perturbed runs."""
    perturbed = _tables(profile, rd)[1]
    return float(perturbed @ _weights()), float((perturbed == 100.0) @ _weights())


def rd_of(clean: Scores, perturbed: Scores) -> float:
    """RD of the population of routes: the tables weighted by how often their entries are drawn."""
    weights = _weights()
    return 1.0 - float(perturbed @ weights) / float(clean @ weights)


@cache
def _weights() -> Scores:
    edges = ndtri(np.linspace(0.0, 1.0, TABLE + 1))[:, None]
    effects = math.sqrt(SCENARIO_SHARE) * scenario_effects()
    reached = ndtr((edges - effects) / math.sqrt(1.0 - SCENARIO_SHARE)).mean(axis=1)
    return np.diff(reached)


@cache
def scenario_effects() -> Scores:
    """The luck of each scenario type: normal, but the same set in every study, because the types are no sample."""
    effects = ndtri((np.arange(SCENARIOS) + 0.5) / SCENARIOS)
    return effects / effects.std()


def _tables(profile: str, rd: float) -> tuple[Scores, Scores]:
    agent = PROFILES[profile]
    ds = agent.ds * (1.0 - rd)
    sr = agent.sr * success_rate(ds) / success_rate(agent.ds)
    return quantiles(agent.ds, agent.sr), quantiles(ds, min(sr, ds / 100.0))


def draw_pairs(profile: str, rd: float, *, studies: int, routes: int, seed: int) -> tuple[Scores, Scores]:
    """Clean and perturbed scores, (studies, routes) each, in planned order: a new set of routes in every study."""
    clean, perturbed = _tables(profile, rd)
    latent = Latent(PROFILES[profile].seed_share, studies, routes, seed)
    return latent.run(clean, twist=0.0), latent.run(perturbed, twist=twist_of(rd))


def draw_runs(profile: str, rd: float, drop: float, *, studies: int, routes: int, seed: int) -> tuple[Scores, Scores]:
    """Two perturbed runs on the same routes with fresh seeds; the second has lost the share `drop` of its score."""
    latent = Latent(PROFILES[profile].seed_share, studies, routes, seed)
    old, new = _tables(profile, rd)[1], _tables(profile, 1.0 - (1.0 - rd) * (1.0 - drop))[1]
    return latent.run(old, twist=0.0, bound=0.0), latent.run(new, twist=twist_of(drop), bound=0.0)


def twist_of(rd: float) -> float:
    """How much of the route effect a perturbation replaces: a hard one hits other routes than those that were hard."""
    return float(np.clip(0.6 * rd, 0.0, 0.5))


class Latent:
    """The luck of the routes of some studies; `run` draws one run on them."""

    def __init__(self, seed_share: float, studies: int, routes: int, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.seed_share = seed_share
        self.shape = (studies, routes)
        order = self.rng.permuted(np.tile(scenario_effects(), (studies, 1)), axis=1)
        self.scenario = math.sqrt(SCENARIO_SHARE) * order[:, np.arange(routes) % SCENARIOS]
        self.route = self.rng.standard_normal(self.shape)
        self.shared_luck = self.rng.standard_normal(self.shape)
        self.route_share = 1.0 - self.seed_share - SCENARIO_SHARE

    def run(self, table: Scores, *, twist: float, bound: float = SEED_BINDS) -> Scores:
        """Scores (studies, routes); `twist` of the route effect is new, `bound` of the luck is that of the seed."""
        own = self.rng.standard_normal(self.shape)
        luck = math.sqrt(bound) * self.shared_luck + math.sqrt(1.0 - bound) * self.rng.standard_normal(self.shape)
        latent = (
            self.scenario
            + math.sqrt(self.route_share * (1.0 - twist)) * self.route
            + math.sqrt(self.route_share * twist) * own
            + math.sqrt(self.seed_share) * luck
        )
        return table[np.minimum((ndtr(latent) * TABLE).astype(int), TABLE - 1)]
