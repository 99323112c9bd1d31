"""The arithmetic of the gate: closed forms, no resampling, the same numbers in every process.

`gate(clean, perturbed, threshold, margin, alpha)` is all of it on two lists of scores (`score_lists`). Its parts:
`evidence` turns a requirement into linear forms of one route's scores and reads them, `judges` holds all ways to read
them, `intervals` says how sure a value is, `resolution` what so many routes can show, `multiple_verdicts` what many
mean together.
"""

from __future__ import annotations

from pytest_drive_robust.stats.score_lists import GateVerdict, gate

__all__ = ["GateVerdict", "gate"]
