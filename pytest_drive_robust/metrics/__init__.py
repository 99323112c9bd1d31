"""Scores of finished episodes: each module holds one metric; nothing heavy is imported until a trace is filtered."""

from __future__ import annotations

from pytest_drive_robust.metrics.ability import ABILITIES, abilities, mean_ability
from pytest_drive_robust.metrics.comfort import comfort
from pytest_drive_robust.metrics.degradation import pair_up, paired_driving_scores, robustness_degradation
from pytest_drive_robust.metrics.efficiency import efficiency
from pytest_drive_robust.metrics.guards import MODES
from pytest_drive_robust.metrics.score import PENALTIES, driving_score, is_success, penalty
from pytest_drive_robust.metrics.summary import Summary, summarize
from pytest_drive_robust.metrics.table import METRICS, Metric, MetricFunction

__all__ = [
    "ABILITIES",
    "METRICS",
    "MODES",
    "PENALTIES",
    "Metric",
    "MetricFunction",
    "Summary",
    "abilities",
    "comfort",
    "driving_score",
    "efficiency",
    "is_success",
    "mean_ability",
    "pair_up",
    "paired_driving_scores",
    "penalty",
    "robustness_degradation",
    "summarize",
]
