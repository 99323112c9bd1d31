"""Agreement of the table's cells (RD of an agent in a row) with the paper's cells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from _paper.estimates import IntervalEstimate
from _paper.published import AGENTS, PUBLISHED
from _paper.readings import Drives
from pytest_drive_robust.stats.quantiles import normal_quantile

__all__ = ["DRAWS", "Agreement", "agreement", "rank_correlations"]

DRAWS = 2_000
"""Sets of routes that are drawn for an interval."""

_SEED = 0
_DIGITS = 9
"""Digits to which values are rounded, so that cells that differ only by the order of a sum share their rank."""

_FEWEST_CELLS = 6
"""Least number of cells. Fewer cells are often in order by chance (three cells in one of six cases), which drawing
routes does not show."""

_Values = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Agreement:
    """The comparison of `driven` of the `cells` with the paper's cells.

    `correlation` is Spearman's with 1.96 standard errors to either side, from routes drawn again with replacement, with
    equal draws for all cells. The percentiles of the draws are no interval here: every draw adds noise to the cells, so
    nearly all draws lie nearer to 0 than the estimate. `difference` is the mean absolute difference of RD. Each is None
    when too few cells were driven, the correlation also when the cells of some draw do not differ.
    """

    cells: int
    driven: int
    correlation: IntervalEstimate | None
    difference: float | None


def agreement(drives: Drives, rows: Sequence[str], agents: Sequence[str] = AGENTS) -> Agreement:
    """Compare the RD of some agents in some rows with the paper's."""
    cells = [(agent, row) for agent in agents for row in rows]
    pairs = {cell: pair for cell in cells if (pair := drives.pair(*cell)) is not None}
    if not pairs:
        return Agreement(len(cells), 0, None, None)
    paper = np.array([PUBLISHED[agent][row].rd for agent, row in pairs])
    clean, perturbed = (
        np.array([pair[which].driving_score for pair in pairs.values()], dtype=np.float64).T for which in (0, 1)
    )
    routes = len(drives.results.routes)
    drawn = np.random.Generator(np.random.Philox(_SEED)).multinomial(routes, [1.0 / routes] * routes, DRAWS)
    weights = drawn.astype(np.float64)
    here = _degradations(np.ones((1, routes)), clean, perturbed)
    difference = float(np.abs(here[0] - paper).mean())
    return Agreement(
        len(cells), len(pairs), _estimate(here, _degradations(weights, clean, perturbed), paper), difference
    )


def _degradations(weights: _Values, clean: _Values, perturbed: _Values) -> _Values:
    """Return RD by set of route weights and cell; NaN where the clean score of a draw is 0."""
    before = weights @ clean
    rounded: _Values = np.round(1.0 - (weights @ perturbed) / np.where(before > 0.0, before, np.nan), _DIGITS)
    return rounded


def _estimate(here: _Values, drawn: _Values, paper: _Values) -> IntervalEstimate | None:
    if len(paper) < _FEWEST_CELLS:
        return None
    value = rank_correlations(here, paper)[0]
    resampled = rank_correlations(drawn, paper)
    if np.isnan(value) or np.isnan(resampled).any():
        return None
    # on Fisher's scale, so that it stays within -1..1; perfect order counts as half a swap of two neighbours less
    most = 1.0 - 6.0 / (len(paper) * (len(paper) ** 2 - 1))
    centre = np.arctanh(np.clip(value, -most, most))
    half = normal_quantile(0.975) * np.arctanh(np.clip(resampled, -most, most)).std(ddof=1)
    low, high = np.tanh([centre - half, centre + half])
    return IntervalEstimate(float(value), min(float(value), float(low)), max(float(value), float(high)))


def rank_correlations(rows: _Values, other: _Values) -> _Values:
    """Return Spearman's rank correlation of each row of `rows` with `other`; NaN where a row has one value only."""
    ranks, places = _centred_ranks(rows), _centred_ranks(other[None])[0]
    spread = np.sqrt((ranks**2).sum(axis=1) * (places**2).sum())
    correlations: _Values = (ranks @ places) / np.where(spread > 0.0, spread, np.nan)
    return correlations


def _centred_ranks(rows: _Values) -> _Values:
    """Return ranks around 0, the count of lower values minus the count of higher values; equal values share a rank."""
    ranks: _Values = np.sign(rows[:, :, None] - rows[:, None, :]).sum(axis=2)
    return ranks
