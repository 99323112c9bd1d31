"""Finds the metrics that a requirement may name: the built-in ones and those of plugins."""

from __future__ import annotations

from pytest_drive_robust.errors import RequirementError, did_you_mean
from pytest_drive_robust.metrics.table import METRICS, Metric
from pytest_drive_robust.registry.registry import default_registry


def known_metric(name: str) -> Metric:
    """Return the metric of that name. Raises `RequirementError` with the nearest name, or a broken plugin's error."""
    if isinstance(name, str) and name in METRICS:  # a list has no place in a mapping
        return METRICS[name]
    names = metric_names()
    if name not in names:
        hint = did_you_mean(str(name), names)
        raise RequirementError(f"there is no metric named {name!r}.{hint} Expected one of {', '.join(names)}.")
    return Metric.from_function(name, default_registry().metric(name))


def metric_names() -> list[str]:
    """Return every name that `known_metric` knows, the built-in ones first."""
    return [*METRICS, *(name for name, _ in default_registry().names("metrics") if name not in METRICS)]
