"""The arithmetic of the gate: closed forms, no resampling, the same numbers in every process.

`gate(clean, perturbed, threshold, margin, alpha)` gives the verdict on two lists of scores (`score_lists`). The parts:
`evidence` turns a requirement into linear forms of one route's scores, `judges` holds the verdict rules that read the
forms, `pace` estimates how many routes a verdict will read, `intervals` computes confidence intervals, `resolution`
estimates what a number of routes can show, and `multiple_verdicts` corrects for many verdicts at once.
"""

from __future__ import annotations

from pytest_drive_robust.stats.score_lists import GateVerdict, gate

__all__ = ["GateVerdict", "gate"]
