"""The episodes of a run as columns, for the tables, filters and links of the pages."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import Infraction, Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.metrics.comfort import comfort
from pytest_drive_robust.metrics.efficiency import efficiency
from pytest_drive_robust.metrics.score import driving_score, is_success
from pytest_drive_robust.report.run_records import RunRecords
from pytest_drive_robust.verdict.explain import PLACELESS, describe_outcome, first_divergence, infraction_s
from pytest_drive_robust.verdict.infraction_words import infraction_words


class EpisodeTable:
    """The table of episodes. Rows refer to each other by number; repeated texts are kept once, in `words`."""

    COLUMNS = (
        "run", "agent", "setting", "route", "seed", "outcome", "end", "story", "ds", "success", "completion",
        "efficiency", "comfort", "seconds", "dt", "wall", "clean", "twin", "parted", "partedBy", "events", "spans",
        "trace", "key",
    )  # fmt: skip
    """The columns of a row. `run` is 0 for the run and 1 for the run that it is compared with; texts are numbers into
    `words`; `dt` is the tick in seconds; `clean` is 1 under a clean setting.
    """

    def __init__(self) -> None:
        self.results: list[EpisodeResult] = []
        self.numbers: dict[tuple[int, Episode], int] = {}
        self.rows: list[list[Any]] = []
        self.words: dict[str, int] = {}

    def word(self, text: str) -> int:
        """Return the number of a text in `words`; add the text if it is new."""
        return self.words.setdefault(text, len(self.words))

    def add(self, records: RunRecords, episodes: Iterable[Episode], *, run: int = 0) -> None:
        """Add episodes of a run with their clean twins; episodes that the table already holds are skipped."""
        for episode in episodes:
            if (run, episode) in self.numbers or episode not in records.results:
                continue
            result, twin = records.results[episode], records.twin(episode)
            twin_number = -1
            if twin is not None:
                self.add(records, [twin.episode], run=run)
                twin_number = self.numbers[run, twin.episode]
            self.numbers[run, episode] = len(self.rows)
            self.results.append(result)
            self.rows.append(self._row(records, result, twin, twin_number, run=run))

    def as_data(self) -> dict[str, Any]:
        """Return the columns by name, and the texts as `words`."""
        columns = zip(*self.rows, strict=True) if self.rows else ((),) * len(self.COLUMNS)
        return {
            **{name: list(column) for name, column in zip(self.COLUMNS, columns, strict=True)},
            "words": list(self.words),
        }

    def _row(
        self, records: RunRecords, result: EpisodeResult, twin: EpisodeResult | None, twin_number: int, *, run: int
    ) -> list[Any]:
        episode, mode = result.episode, records.mode
        scored = result.outcome is not Outcome.INFRA_ERROR
        has_trace = len(result.trace.rows) > 0
        parted = first_divergence(twin, result) if twin is not None and has_trace and len(twin.trace.rows) else None
        speed = efficiency(result, mode=mode) if scored else None
        calm = comfort(result, mode=mode) if scored and has_trace else None
        return [
            run,
            self.word(episode.agent),
            self.word(episode.setting),
            self.word(episode.route_id),
            episode.seed,
            self.word(result.outcome.value),
            self.word(result.end_detail),
            self.word(describe_outcome(result)),
            driving_score(result) if scored else None,  # rounded once, where it is shown
            int(is_success(result)) if scored else None,
            round(float(result.route_completion_pct), 1) if scored else None,
            None if speed is None else round(speed, 1),
            None if calm is None else round(calm, 1),
            round(result.game_s, 2),
            result.dt_s,
            round(result.wall_s, 3),
            int(records.is_clean(episode.setting)),
            twin_number,
            None if parted is None else round(parted.second, 2),
            self.word("" if parted is None else parted.signal),
            self._events(result),
            [[self.word(span.signal), span.first_tick, span.last_tick] for span in result.schedule],
            int(has_trace) + 2 * int(has_trace and result.tracks is not None),
            records.keys[episode][:12],
        ]

    def _events(self, result: EpisodeResult) -> list[list[Any]]:
        """Return kind, second, sentence and place in cm of every infraction, by time; None for unknown values."""
        return [
            [
                self.word(item.kind.value),
                _second(item, result.dt_s),
                self.word(infraction_words(item.detail)),
                *_place(item),
            ]
            for item in sorted(result.infractions, key=lambda event: event.tick)
        ]


def _second(item: Infraction, dt_s: float) -> float | None:
    second = infraction_s(item, dt_s)
    return None if second is None else round(second, 2)


def _place(item: Infraction) -> tuple[int | None, int | None]:
    """Return x and y of an infraction in cm; (None, None) for a kind without a place or an unknown place."""
    # an official message may lack the place, see `official_record.place_of`
    untold = (item.tick, item.x_m, item.y_m) == (0, 0.0, 0.0)
    if item.kind in PLACELESS or untold or not (math.isfinite(item.x_m) and math.isfinite(item.y_m)):
        return None, None
    return round(item.x_m * 100.0), round(item.y_m * 100.0)
