"""The object form of a requirement: `requirement("RD", InferenceLatency(ms=200)) <= 0.30`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

from pytest_drive_robust.errors import RequirementError
from pytest_drive_robust.metrics.table import Metric
from pytest_drive_robust.perturbations.base import Perturbation, Setting
from pytest_drive_robust.verdict.known_metrics import known_metric
from pytest_drive_robust.verdict.requirement import Requirement, as_setting


@dataclass(frozen=True)
class Unjudged:
    """A metric under a setting that waits for its limit: `requirement("RD", InferenceLatency(ms=200)) <= 0.30`."""

    metric: Metric
    setting: Setting

    def __le__(self, limit: float) -> Requirement:
        return Requirement(self.metric, self.setting, "<=", limit)

    def __ge__(self, limit: float) -> Requirement:
        return Requirement(self.metric, self.setting, ">=", limit)

    def __lt__(self, limit: float) -> NoReturn:
        raise RequirementError(f"'{self.metric} under {self.setting} < {limit}': '<' cannot be used here, write '<='.")

    def __gt__(self, limit: float) -> NoReturn:
        raise RequirementError(f"'{self.metric} under {self.setting} > {limit}': '>' cannot be used here, write '>='.")

    def __bool__(self) -> NoReturn:
        raise RequirementError(f"'{self.metric} under {self.setting}' has no limit yet. Add '<= limit' or '>= limit'.")


def requirement(metric: str, setting: Setting | Perturbation = Setting.CLEAN) -> Unjudged:
    """Return the object form of a sentence: `requirement("RD", InferenceLatency(ms=200)) <= 0.30`.

    Raises `RequirementError` for an unknown metric; the comparison with a limit checks the limit.
    """
    return Unjudged(known_metric(metric), as_setting(setting))
