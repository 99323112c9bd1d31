"""The words that requirements may use: metrics and perturbations, built in or registered.

The registry is asked inside the functions, because it imports the perturbations that this package builds on.
"""

from __future__ import annotations

from collections.abc import Mapping

from pytest_drive_robust.errors import RequirementError, nearest
from pytest_drive_robust.metrics.table import METRICS, Metric
from pytest_drive_robust.perturbations.base import Perturbation

__all__ = ["known_metric", "known_perturbations", "metric_names"]


def known_metric(name: str) -> Metric:
    """The metric of that name. Raises `RequirementError` with the nearest name, or what a broken plugin raises."""
    if name in METRICS:
        return METRICS[name]
    names = metric_names()
    if name not in names:
        close = nearest(name, names)
        hint = f" Did you mean {close!r}?" if close else ""
        raise RequirementError(f"there is no metric named {name!r}.{hint} Expected one of {', '.join(names)}.")
    from pytest_drive_robust.registry.registry import default_registry

    return Metric.from_function(name, default_registry().metric(name))


def metric_names() -> list[str]:
    """Every name that `known_metric` knows, the built-in ones first."""
    from pytest_drive_robust.registry.registry import default_registry

    return [*METRICS, *(name for name, _ in default_registry().names("metrics") if name not in METRICS)]


def known_perturbations() -> Mapping[str, type[Perturbation]]:
    """Every perturbation whose phrase a sentence may use."""
    from pytest_drive_robust.registry.registry import default_registry

    return default_registry().perturbations()
