"""The film of one or two tapes: returns the picture of each position."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from pytest_drive_robust.domain.truth import EgoState
from pytest_drive_robust.jit.arrays import Pixels
from pytest_drive_robust.report.film import canvas as c
from pytest_drive_robust.report.film.episode_pane import EpisodePane
from pytest_drive_robust.report.film.story import story_of
from pytest_drive_robust.report.film.strips import Strips
from pytest_drive_robust.report.film.top_view import PATH, ROUTE, SPEED_POINT, TARGET_POINT, GroundPicture, misplaced_m
from pytest_drive_robust.runner.replay.recording import Tape

_BANNER_S = 1.5


class Film:
    """Shows `clean` on the left and `perturbed` on the right, tick by tick; a single tape stands in the middle.

    >>> c.HEIGHT, c.WIDTH
    (720, 1280)
    """

    def __init__(self, clean: Tape, perturbed: Tape | None = None) -> None:
        tapes = (clean,) if perturbed is None else (clean, perturbed)
        ground = GroundPicture(clean.lane_map, clean.route)
        self.story = story_of(tapes)
        self.dt_s = clean.result.dt_s
        places = (0, 640) if perturbed is not None else (320,)
        self._panes = tuple(
            EpisodePane(tape, tape.result.episode.setting, colour, ground, events, left)
            for tape, colour, events, left in zip(
                tapes, (c.CLEAN, c.PERTURBED), self.story.events, places, strict=False
            )
        )
        self._strips = Strips([tape.result for tape in tapes], self.story)
        self._empty = _backdrop(tapes)

    @property
    def rate_hz(self) -> int:
        """Pictures per second for a film at the speed of the episode."""
        return round(1.0 / self.dt_s)

    @property
    def positions(self) -> list[int]:
        """The positions in the order of showing."""
        return self.story.showing(self.dt_s)

    def pictures(self) -> Iterator[Pixels]:
        """Yield the pictures in order, (720, 1280, 3) uint8 RGB; a repeated picture is the same object."""
        shown, picture = -1, self._empty
        for position in self.positions:
            if position != shown:
                picture, shown = self.picture(position), position
            yield picture

    def picture(self, position: int) -> Pixels:
        """Return a new picture of the world after `position` ticks, (720, 1280, 3) uint8 RGB."""
        picture: Pixels = self._empty.copy()
        for pane in self._panes:
            pane.draw(picture, position, twin=self._twin(pane, position))
        self._strips.draw(picture, position)
        self._banner(picture, position)
        return picture

    def sheet(self) -> Pixels:
        """Return one picture of the story's most telling moments, two in a row, RGB uint8."""
        pictures = [self.picture(position) for position in self.story.telling()]
        if len(pictures) % 2 and len(pictures) > 1:
            pictures.append(np.full_like(pictures[0], c.BACKGROUND))
        rows = [np.concatenate(pictures[i : i + 2], axis=1) for i in range(0, len(pictures), 2)]
        return np.asarray(np.concatenate(rows), np.uint8)

    def _twin(self, pane: EpisodePane, position: int) -> EgoState | None:
        """Return the clean ego at this position for the perturbed pane, None for the clean pane."""
        clean = self._panes[0]
        if pane is clean:
            return None
        moments = clean.tape.moments
        return moments[min(position, len(moments) - 1)].state.ego

    def _banner(self, picture: Pixels, position: int) -> None:
        """Draw a flag across both panes at the first divergence."""
        if self.story.divergence is None:
            return
        at, apart = self.story.divergence
        if not at <= position <= at + _BANNER_S / self.dt_s:
            return
        words = f"FIRST DIVERGENCE at {at * self.dt_s:.2f} s: {apart}"
        c.fill(picture, c.Rectangle(0, 0, c.WIDTH, 34), c.MARK)
        c.text(
            picture, words, (c.WIDTH // 2, 25), size=0.75, bold=True, colour=c.BACKGROUND, within=1240, align="centre"
        )
        cv2.rectangle(picture, (1, 34), (c.WIDTH - 2, 463), c.MARK, 3)


def _backdrop(tapes: tuple[Tape, ...]) -> Pixels:
    """Return the part of the picture that never changes: the title and the legend of the views from above."""
    picture = np.full((c.HEIGHT, c.WIDTH, 3), c.BACKGROUND, np.uint8)
    episode = tapes[0].result.episode
    title = f"{episode.agent} on {episode.route_id} {tapes[0].result.scenario}, seed {episode.seed}"
    plans = [moment.plan for tape in tapes for moment in tape.moments if moment.plan is not None]
    entries: list[tuple[str, c.Colour, bool]] = [
        ("route", ROUTE, True),
        ("plan", PATH, any(plan.path for plan in plans)),
        ("target points", TARGET_POINT, any(plan.target_points for plan in plans)),
        ("speed points", SPEED_POINT, any(plan.speed_points for plan in plans)),
        ("clean twin", c.CLEAN, len(tapes) == 2),
        ("told place", c.INK, any(misplaced_m(moment) for tape in tapes for moment in tape.moments)),
    ]
    x = c.WIDTH - 10
    for words, colour, there in reversed(entries):
        if there:
            x -= c.text(picture, words, (x, 23), size=0.5, colour=c.DIM, align="right") + 6
            cv2.line(picture, (x - 18, 18), (x, 18), colour, 4)
            x -= 32
    c.text(picture, title, (10, 24), size=0.65, colour=c.INK, bold=True, within=x - 20)
    return picture
