"""Draws the strips below the panes: speed, pedals and steering over time for both egos, perturbations and events."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.jit.arrays import Floats, Pixels
from pytest_drive_robust.report.film import canvas as c
from pytest_drive_robust.report.film.story import Story

AREA = c.Rectangle(0, 466, 1280, 254)
_LEFT, _RIGHT = 118, 1264
_PERTURBED = c.Rectangle(_LEFT, 486, _RIGHT - _LEFT, 8)
_AXIS_Y = 714
_COLOURS = (c.CLEAN, c.PERTURBED)
_MARK_SIZE = 0.45
_LIMITS_PX = 32
"""The width at the right end of the strip of speed in which the numbers of its axis stand."""
_STEPS_S = (1, 2, 5, 10, 20, 50, 100)


@dataclass(frozen=True, slots=True)
class _Strip:
    name: str
    unit: str
    box: c.Rectangle
    low: float
    high: float


class Strips:
    """The strips of a film, painted once; only the line of the present moment moves."""

    def __init__(self, results: Sequence[EpisodeResult], story: Story) -> None:
        self._story = story
        self._dt_s = results[0].dt_s
        fastest = max(float(result.trace.column("speed_mps").max(initial=0.0)) * 3.6 for result in results)
        self._strips = (
            _Strip("speed", "km/h", c.Rectangle(_LEFT, 500, _RIGHT - _LEFT, 84), 0.0, max(10.0, 1.08 * fastest)),
            _Strip("throttle", "brake", c.Rectangle(_LEFT, 590, _RIGHT - _LEFT, 60), -1.05, 1.05),
            _Strip("steer", "", c.Rectangle(_LEFT, 656, _RIGHT - _LEFT, 40), -1.05, 1.05),
        )
        self._picture = self._painted(results)

    def draw(self, picture: Pixels, position: int) -> None:
        """Draw the strips at a position of the film, with the time after it dimmed."""
        area = AREA.of(picture)
        area[:] = self._picture
        now = self._column(position)
        for box in (_PERTURBED, *(strip.box for strip in self._strips)):
            later = picture[box.y : box.bottom, now : box.right]
            later[:] = later // 2 + np.array(c.BACKGROUND, np.uint8) // 2
        cv2.line(picture, (now, _PERTURBED.y), (now, self._strips[-1].box.bottom), c.INK, 2)
        skims = position in self._story.skimmed and position < self._story.length
        second = f"{position * self._dt_s:.2f} s" + (f"  >> {self._story.SKIM} x" if skims else "")
        free = self._strips[0].box.right - _LIMITS_PX
        if now + 8 + c.text_width(second, 0.5, bold=True) <= free:
            c.text(picture, second, (now + 8, 516), size=0.5, bold=True)
        else:
            c.text(picture, second, (min(now - 8, free), 516), size=0.5, bold=True, align="right")

    def _column(self, position: float) -> int:
        return _LEFT + round((_RIGHT - _LEFT - 1) * position / max(self._story.length, 1))

    def _painted(self, results: Sequence[EpisodeResult]) -> Pixels:
        """Return the strips as they look at the end of the film."""
        whole = np.zeros((AREA.bottom, AREA.width, 3), np.uint8)
        c.fill(whole, AREA, c.BACKGROUND)
        self._scale(whole)
        for result, colour in zip(results, _COLOURS, strict=False):
            for strip, values in zip(self._strips, _curves(result), strict=True):
                self._curve(whole, strip, values, colour)
        self._perturbations(whole, results[-1])
        self._marks(whole)
        area: Pixels = whole[AREA.y :].copy()
        return area

    def _scale(self, picture: Pixels) -> None:
        """Draw boxes, names, and a line for every few seconds."""
        for strip in self._strips:
            c.fill(picture, strip.box, c.PANEL)
            middle = strip.box.y + strip.box.height // 2
            second_line = 18 if strip.unit else 0
            c.text(picture, strip.name, (_LEFT - 10, middle + 5 - second_line // 2), size=0.5, align="right")
            c.text(
                picture, strip.unit, (_LEFT - 10, middle + 5 + second_line // 2), size=0.5, colour=c.DIM, align="right"
            )
        for strip in self._strips[1:]:
            middle = strip.box.y + strip.box.height // 2
            cv2.line(picture, (_LEFT, middle), (_RIGHT - 1, middle), (70, 75, 84), 1)
        speed = self._strips[0]
        step_kmh = 20 if speed.high < 70.0 else 40
        for limit in range(step_kmh, round(0.85 * speed.high) + 1, step_kmh):
            y = self._row(speed, limit)
            cv2.line(picture, (_LEFT, y), (_RIGHT - 1, y), (58, 63, 72), 1)
            c.text(picture, str(limit), (_RIGHT - 4, y - 3), size=0.4, colour=c.DIM, align="right")
        seconds = self._story.length * self._dt_s
        step = next((step for step in _STEPS_S if seconds / step <= 16), 500)
        for second in range(0, int(seconds) + 1, step):
            x = self._column(second / self._dt_s)
            for strip in self._strips:
                cv2.line(picture, (x, strip.box.bottom - 4), (x, strip.box.bottom), c.DIM, 1)
            words = f"{second} s" if second == 0 else str(second)
            c.text(picture, words, (x, _AXIS_Y), size=0.45, colour=c.DIM, align="left" if second == 0 else "centre")

    def _curve(self, picture: Pixels, strip: _Strip, values: Floats, colour: c.Colour) -> None:
        if len(values) < 2:
            return
        x = [self._column(position + 1) for position in range(len(values))]
        share = (np.clip(values, strip.low, strip.high) - strip.low) / (strip.high - strip.low)
        y = strip.box.bottom - 1 - share * (strip.box.height - 1)
        points = np.column_stack((x, np.round(y))).astype(np.int32)
        cv2.polylines(picture, [points], False, colour, 2, cv2.LINE_AA)

    def _row(self, strip: _Strip, value: float) -> int:
        share = (value - strip.low) / (strip.high - strip.low)
        return strip.box.bottom - 1 - round(share * (strip.box.height - 1))

    def _perturbations(self, picture: Pixels, result: EpisodeResult) -> None:
        """Draw the ticks in which a perturbation was active."""
        c.fill(picture, _PERTURBED, c.PANEL)
        c.text(picture, "perturbation", (_LEFT - 10, _PERTURBED.bottom + 2), size=0.5, align="right")
        for span in result.schedule:
            left, right = self._column(span.first_tick), self._column(span.last_tick + 1)
            c.fill(picture, c.Rectangle(left, _PERTURBED.y, max(right - left, 1), _PERTURBED.height), c.PERTURBED)

    def _marks(self, picture: Pixels) -> None:
        """Draw lines through all strips at the first divergence and every infraction, with words if there is room."""
        bottom = self._strips[-1].box.bottom
        marks = [(self._column(event.tick), event.words, c.WRONG) for items in self._story.events for event in items]
        if self._story.divergence is not None:
            at = self._story.divergence[0]
            marks.append((self._column(at), f"first divergence {at * self._dt_s:.2f} s", c.MARK))
        marks.sort(key=lambda mark: mark[:2])
        for number, (x, words, colour) in enumerate(marks):
            cv2.line(picture, (x, _PERTURBED.y - 6), (x, bottom), colour, 2)
            if colour == c.MARK:
                corners = np.array(
                    ((x - 7, _PERTURBED.y - 18), (x + 7, _PERTURBED.y - 18), (x, _PERTURBED.y - 6)), np.int32
                )
                cv2.fillConvexPoly(picture, corners, c.MARK, cv2.LINE_AA)
            else:
                cv2.drawMarker(picture, (x, _PERTURBED.y - 10), c.WRONG, cv2.MARKER_TILTED_CROSS, 11, 3, cv2.LINE_AA)
            self._name(picture, words, x, colour, [mark[0] for mark in marks if mark[0] != x], first=number == 0)

    def _name(
        self, picture: Pixels, words: str, x: int, colour: c.Colour, others: Sequence[int], *, first: bool
    ) -> None:
        """Write the words right of a mark, or left of the first mark; nothing if another mark is in the way."""
        need = c.text_width(words, _MARK_SIZE) + 24
        if x + need <= min((other for other in others if other > x), default=_RIGHT + 12):
            c.text(picture, words, (x + 12, _PERTURBED.y - 6), size=_MARK_SIZE, colour=colour)
        elif first and x - need >= 0:
            c.text(picture, words, (x - 12, _PERTURBED.y - 6), size=_MARK_SIZE, colour=colour, align="right")


def _curves(result: EpisodeResult) -> tuple[Floats, Floats, Floats]:
    """Return speed in km/h, throttle minus brake and steering, each (ticks,)."""
    column = result.trace.column
    return column("speed_mps") * 3.6, column("throttle") - column("brake"), column("steer")
