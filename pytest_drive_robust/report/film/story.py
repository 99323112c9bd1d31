"""The story of two tapes: where the egos part, what goes wrong when, and how long the film shows each moment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.runner.replay.recording import Tape
from pytest_drive_robust.verdict.explain import PLACELESS, first_divergence
from pytest_drive_robust.verdict.infraction_words import infraction_words

_MOST_TELLING = 6
_HOLD_S = 1.0
_LAST_HOLD_S = 2.0
_STILL_MPS = 0.05
_STILL_S = 3.0
"""Seconds without motion after which the film skims."""


@dataclass(frozen=True, slots=True)
class StoryEvent:
    """One thing that went wrong: the tick, a sentence, and where in metres (None when it has no place)."""

    tick: int
    words: str
    place: tuple[float, float] | None


@dataclass(frozen=True, slots=True)
class Story:
    """The plot of a film.

    `length` is the last position: position `k` is the world after `k` ticks, and a finished episode stays at its end.
    `divergence` is (position, signal) of the first divergence, or None. `events` holds the events of each tape. In the
    `skimmed` positions no ego has moved for long and nothing happens.
    """

    length: int
    divergence: tuple[int, str] | None
    events: tuple[tuple[StoryEvent, ...], ...]
    skimmed: frozenset[int] = frozenset()

    SKIM: ClassVar[int] = 8
    """A film shows one of this many positions of a skimmed stretch."""

    def showing(self, dt_s: float) -> list[int]:
        """Return the positions in the order of showing; a position is repeated where something happens."""
        pauses = {item.tick for items in self.events for item in items}
        if self.divergence is not None:
            pauses.add(self.divergence[0])
        shown: list[int] = []
        for position in range(self.length + 1):
            if position in self.skimmed and position % self.SKIM:
                continue
            shown += [position] * (1 + (round(_HOLD_S / dt_s) if position in pauses else 0))
        return shown + [self.length] * round(_LAST_HOLD_S / dt_s)

    def telling(self) -> list[int]:
        """Return the positions for a contact sheet, at most six: start, divergence, infractions, end."""
        happened = sorted({item.tick for items in self.events for item in items})
        first = [] if self.divergence is None else [self.divergence[0]]
        kept = [0, *first, *happened[: _MOST_TELLING - 2 - len(first)], self.length]
        return sorted(set(kept))


def story_of(tapes: tuple[Tape, ...]) -> Story:
    """Return the story of a clean and a perturbed tape, or of a single tape."""
    results = tuple(tape.result for tape in tapes)
    events = tuple(_events(result) for result in results)
    return Story(
        length=max(len(tape.moments) for tape in tapes) - 1,
        divergence=_divergence(*results) if len(results) == 2 else None,
        events=events,
        skimmed=_skimmed(tapes, {event.tick for items in events for event in items}),
    )


def _skimmed(tapes: tuple[Tape, ...], busy: set[int]) -> frozenset[int]:
    """Return the positions of long waits; a finished episode counts as not moving."""
    patience = round(_STILL_S / tapes[0].result.dt_s)
    found: set[int] = set()
    stood = 0
    for position in range(max(len(tape.moments) for tape in tapes)):
        moving = any(
            position < len(tape.moments) and tape.moments[position].state.ego.speed_mps > _STILL_MPS for tape in tapes
        )
        stood = 0 if moving or position in busy else stood + 1
        if stood > patience:
            found.add(position)
    return frozenset(found)


def _divergence(clean: EpisodeResult, perturbed: EpisodeResult) -> tuple[int, str] | None:
    found = first_divergence(clean, perturbed)
    return None if found is None else (round(found.second / clean.dt_s), found.signal)


def _events(result: EpisodeResult) -> tuple[StoryEvent, ...]:
    events = [
        StoryEvent(item.tick, infraction_words(item.detail), None if item.kind in PLACELESS else (item.x_m, item.y_m))
        for item in result.infractions
    ]
    if result.outcome in (Outcome.AGENT_ERROR, Outcome.INFRA_ERROR):
        events.append(StoryEvent(result.ticks, result.end_detail, None))
    return tuple(sorted(events, key=lambda event: event.tick))
