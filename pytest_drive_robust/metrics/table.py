"""The metrics by name, with range, unit and format, for requirements, tables and reports.

A user's metric is a name and a function over the episodes of one setting. `Metric.from_function` wraps the function;
the hook or the entry point group `pytest_drive_robust.metrics` registers it.
"""

from __future__ import annotations

import functools
import math
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Protocol

from pytest_drive_robust.arithmetic.signals import mean
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import ComparisonError, DriveRobustError
from pytest_drive_robust.metrics.comfort import comfort
from pytest_drive_robust.metrics.degradation import paired_driving_scores, robustness_degradation
from pytest_drive_robust.metrics.efficiency import efficiency
from pytest_drive_robust.metrics.episodes import require_mode, require_scorable, values_by_route
from pytest_drive_robust.metrics.score import driving_score, is_success


class MetricFunction(Protocol):
    """A user's metric function: returns the value over the episodes of one setting, or None without data."""

    def __call__(self, results: Sequence[EpisodeResult], /) -> float | None:
        """Return the metric of `results` (one agent, one setting, never an `infra_error`)."""


_USUAL_SPAN = 100.0

EpisodeValue = Callable[[EpisodeResult, str], "float | None"]
"""Returns the value of one episode in a mode; the metric is the mean of the values over routes."""


@dataclass(frozen=True, slots=True)
class Metric:
    """One metric; `low..high` is the range, `decimals` the least number of decimals of a printed value.

    Either `of_episode` or `function` computes the metric; RD has neither, because RD also needs the clean episodes.
    """

    name: str
    meaning: str
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    higher_is_better: bool = True
    decimals: int | None = None
    of_episode: EpisodeValue | None = field(default=None, repr=False)
    function: MetricFunction | None = field(default=None, repr=False)

    @classmethod
    def from_function(cls, name: str, function: MetricFunction) -> Metric:
        """Return the metric of a user's function: any range, no unit, higher is better."""
        written = function.func if isinstance(function, functools.partial) else function
        lines = (getattr(written, "__doc__", None) or "").split("\n")
        meaning = next((line.strip() for line in lines if line.strip()), name)
        return cls(name, meaning, function=function)

    @property
    def needs_clean(self) -> bool:
        """True when the value is relative to the clean episodes."""
        return self.of_episode is None and self.function is None

    @property
    def span(self) -> float:
        """The length of the range, of which margins are shares: 1 for RD, 100 for a metric without an end."""
        span = 1.0 if self.needs_clean else self.high - self.low
        return span if math.isfinite(span) else _USUAL_SPAN

    def __str__(self) -> str:
        return self.name

    def measure(
        self, results: Sequence[EpisodeResult], *, clean: Sequence[EpisodeResult] = (), mode: str = "bench2drive"
    ) -> float | None:
        """Return the value over `results`, or None without data.

        Raises `ComparisonError` as the metric's formula does, and when a user's function raises an error that is no
        `DriveRobustError`; `UnknownNameError` for an unknown mode.
        """
        require_mode(mode)
        require_scorable(results)
        if self.needs_clean:
            return robustness_degradation(clean, results)
        if self.function is not None:
            return self._value_of(self.function, results)
        values, _ = self.by_route(results, mode=mode)
        return mean(values) if values else None

    def by_route(
        self, results: Sequence[EpisodeResult], *, clean: Sequence[EpisodeResult] = (), mode: str = "bench2drive"
    ) -> tuple[list[float], list[float]]:
        """Return the values and the references of all routes with data, as means over seeds, in equal order.

        For RD the values are perturbed driving scores and the references clean driving scores. Other metrics have the
        reference 0. A user's `function` has no values by route. Raises `ComparisonError` when RD is undefined.
        """
        if self.needs_clean:
            references, scores = paired_driving_scores(clean, results)
            return scores, references
        of_episode = self.of_episode
        assert of_episode is not None, f"{self} is a function over all episodes"
        values = list(values_by_route(results, lambda result: of_episode(result, mode)).values())
        return values, [0.0] * len(values)

    def of_route(
        self, results: Sequence[EpisodeResult], *, clean: Sequence[EpisodeResult] = (), mode: str = "bench2drive"
    ) -> tuple[float, float] | None:
        """Return value and reference (see `by_route`) of the episodes of one route, or None without data."""
        if self.needs_clean:
            return mean([driving_score(result) for result in results]), mean([driving_score(item) for item in clean])
        values, references = self.by_route(results, mode=mode)
        return (values[0], references[0]) if values else None

    def _value_of(self, function: MetricFunction, results: Sequence[EpisodeResult]) -> float | None:
        """Call a user's function; turn its error, which is no verdict on the agent, into a `ComparisonError`."""
        try:
            return function(results)
        except DriveRobustError:
            raise
        except (Exception, SystemExit) as error:
            told = f"the metric {self} raised {type(error).__name__}: {error}{_place_of(error)}"
            raise ComparisonError(told) from error

    def format(self, value: float | None) -> str:
        """Return the value for people: `"0.43"`, `"61.25"`; a dash when there is no data."""
        if value is None:
            return "-"
        return f"{value:.{2 if self.decimals is None else self.decimals}f}"

    def format_limit(self, limit: float) -> str:
        """Return the limit for a sentence, exact: `"0.30"` with two decimals at least for RD and SR, else `"40"`."""
        text = f"{limit:g}" if self.decimals is None else f"{limit:.{self.decimals}f}"
        return text if float(text) == limit else repr(float(limit))


def _place_of(error: BaseException) -> str:
    """Return " (file:line)" of the last frame in the user's own file, or an empty string for a function in C."""
    called = traceback.extract_tb(error.__traceback__)[1:]  # the first frame is ours
    own = [frame for frame in called if frame.filename == called[0].filename]
    return f" ({own[-1].filename}:{own[-1].lineno})" if own else ""


_BUILTIN = (
    Metric(
        "RD", "robustness degradation: share of the clean driving score that is lost",
        high=1.0, higher_is_better=False, decimals=2,
    ),
    Metric(
        "DS", "driving score: route completion times penalties",
        low=0.0, high=100.0, of_episode=lambda result, _mode: driving_score(result),
    ),
    Metric(
        "SR", "success rate: routes completed without an infraction",
        low=0.0, high=1.0, decimals=2, of_episode=lambda result, _mode: float(is_success(result)),
    ),
    Metric(
        "efficiency", "speed of the ego in percent of the traffic's",
        unit="%", low=0.0, of_episode=lambda result, mode: efficiency(result, mode=mode),
    ),
    Metric(
        "comfort", "share of seconds within the comfort bounds",
        unit="%", low=0.0, high=100.0, of_episode=lambda result, mode: comfort(result, mode=mode),
    ),
)  # fmt: skip
METRICS: Mapping[str, Metric] = MappingProxyType({metric.name: metric for metric in _BUILTIN})
"""The built-in metrics by the name that requirements use."""
