"""Metrics, the factors of infractions, abilities."""

from __future__ import annotations

from pytest_drive_robust.domain.outcome import InfractionKind
from pytest_drive_robust.metrics.ability import ABILITIES
from pytest_drive_robust.metrics.score import PENALTIES
from pytest_drive_robust.metrics.table import METRICS
from reference_parts.rst import escaped, list_table


def metrics() -> str:
    """Return the table of the metrics."""
    rows = [
        (
            f"``{name}``",
            _range(metric.low, metric.high),
            escaped(metric.meaning) + (f" [{metric.unit}]" if metric.unit else ""),
        )
        for name, metric in METRICS.items()
    ]
    return list_table(("metric", "range", "meaning"), rows)


def penalties() -> str:
    """Return the factor of each infraction."""
    rows = [(f"``{kind.value}``", _factor(kind)) for kind in InfractionKind]
    return list_table(("infraction", "factor"), rows)


def abilities() -> str:
    """Return the scenario types of each ability."""
    return list_table(
        ("ability", "scenario types"), [(name, ", ".join(sorted(types))) for name, types in ABILITIES.items()]
    )


def _factor(kind: InfractionKind) -> str:
    if kind is InfractionKind.OUTSIDE_LANES:
        return "1 - the share of the way outside the lanes"
    return f"{PENALTIES[kind]:g}" if kind in PENALTIES else "none"


def _range(low: float, high: float) -> str:
    return f"{low:g} to {high:g}".replace("inf", "∞")
