"""All absolute metrics of a set of episodes of one agent under one setting."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from pytest_drive_robust.arithmetic.signals import mean
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.metrics.ability import abilities, mean_ability, signs_between
from pytest_drive_robust.metrics.comfort import comfort
from pytest_drive_robust.metrics.efficiency import efficiency
from pytest_drive_robust.metrics.episodes import mean_over_routes, require_mode, require_scorable, values_by_route
from pytest_drive_robust.metrics.score import driving_score, is_success


@dataclass(frozen=True)
class Summary:
    """One row of a result table.

    `ds` is 0..100, `sr` 0..1, `efficiency` percent of the traffic's speed, `comfort` percent of the segments,
    `abilities` success rates 0..1 by ability; None where no episode has data or the value is not known. `agent_errors`
    counts the episodes of `episodes` that ended with `agent_error`.
    """

    ds: float
    sr: float
    efficiency: float | None
    abilities: Mapping[str, float | None]
    episodes: int
    agent_errors: int
    _results: tuple[EpisodeResult, ...] = field(repr=False, compare=False)
    _mode: str = field(repr=False, compare=False)

    @cached_property
    def comfort(self) -> float | None:
        """Percent of comfortable segments; computed at the first access, because it reads every episode's trace."""
        return mean_over_routes(self._results, lambda result: comfort(result, mode=self._mode))

    @cached_property
    def signs_between(self) -> tuple[float, float] | None:
        """The smallest and largest possible Traffic_Signs rate, 0..1; None when the rate is known or has no route."""
        return signs_between(self._results)

    @property
    def mean_ability(self) -> float | None:
        """The plain mean of the abilities with data, 0..1; None when none has data or Traffic_Signs is unknown."""
        return mean_ability(self.abilities) if self.signs_between is None else None


def summarize(results: Sequence[EpisodeResult], *, mode: str = "bench2drive") -> Summary:
    """Return the metrics of a set of episodes: means over routes, the seeds of a route averaged first.

    Raises `ComparisonError` when there is no episode or one is an `infra_error`, `UnknownNameError` for a mode that is
    neither `bench2drive` nor `fixed`.
    """
    require_mode(mode)
    require_scorable(results)
    return Summary(
        ds=mean(list(values_by_route(results, driving_score).values())),
        sr=mean(list(values_by_route(results, is_success).values())),
        efficiency=mean_over_routes(results, lambda result: efficiency(result, mode=mode)),
        abilities=abilities(results),
        episodes=len(results),
        agent_errors=sum(result.outcome is Outcome.AGENT_ERROR for result in results),
        _results=tuple(results),
        _mode=mode,
    )
