"""Groups the episodes that went wrong by what happened, with one sentence for each group."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.metrics.score import is_success
from pytest_drive_robust.report.failures.moment import first_failure, manoeuvre
from pytest_drive_robust.report.failures.road import Road

_RECENT_S = 2.0
_MOSTLY = 0.9
"""The largest share of an episode during which a perturbation may be active and still explain a moment."""


@dataclass(frozen=True, slots=True)
class Cluster:
    """Numbers of the episodes that went wrong alike; `example` is the number of the clearest episode."""

    sentence: str
    episodes: tuple[int, ...]
    example: int

    @property
    def name(self) -> str:
        """The sentence in small letters with dashes, for links."""
        return re.sub(r"[^a-z0-9]+", "-", self.sentence.lower()).strip("-")


def clusters_of(
    results: Iterable[tuple[int, EpisodeResult]], road_of: Callable[[EpisodeResult], Road | None]
) -> tuple[Cluster, ...]:
    """Return the groups of all episodes without success, the largest first. `road_of` returns None if unknown."""
    found: dict[str, list[tuple[int, EpisodeResult]]] = {}
    for number, result in results:
        if result.outcome is Outcome.INFRA_ERROR or not is_success(result):
            found.setdefault(sentence_of(result, road_of(result)), []).append((number, result))
    clusters = [
        Cluster(sentence, tuple(number for number, _ in members), _example(members))
        for sentence, members in found.items()
    ]
    return tuple(sorted(clusters, key=lambda cluster: (-len(cluster.episodes), cluster.sentence)))


def sentence_of(result: EpisodeResult, road: Road | None) -> str:
    """Return what happened in an episode that went wrong, as in `"Hit a vehicle while turning left"`."""
    moment = first_failure(result, road)
    parts = [moment.what]
    if moment.moves:
        parts += [manoeuvre(result, moment.tick, road, leaving=moment.leaving), _during(result, moment.tick)]
    return " ".join(part for part in parts if part)


def _during(result: EpisodeResult, tick: int) -> str:
    """Return which perturbation was active shortly before `tick`, or an empty string; permanent ones do not count.

    An event of `tick` happens at the end of the tick, so a perturbation that begins in `tick` comes too late to count.
    """
    recent = tick - round(_RECENT_S / result.dt_s)
    for item in result.schedule:
        active = sum(
            span.last_tick - span.first_tick + 1
            for span in result.schedule
            if (span.perturbation, span.signal) == (item.perturbation, item.signal)
        )
        if item.first_tick < tick and item.last_tick >= recent and active < _MOSTLY * result.ticks:
            return f"in a {item.perturbation.replace('-', ' ')}"
    return ""


def _example(members: list[tuple[int, EpisodeResult]]) -> int:
    """Return the number of the clearest episode: with a trace, the fewest infractions, then the fewest ticks."""

    def rank(member: tuple[int, EpisodeResult]) -> tuple[bool, int, int, int]:
        number, result = member
        return (not len(result.trace.rows), len(result.infractions), result.ticks, number)

    return min(members, key=rank)[0]
