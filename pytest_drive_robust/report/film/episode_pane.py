"""Draws the pane of one episode: camera pictures, the view from above, controls of agent and car, captions."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.truth import EgoState
from pytest_drive_robust.jit.arrays import Pixels
from pytest_drive_robust.metrics.score import driving_score
from pytest_drive_robust.report.film import canvas as c
from pytest_drive_robust.report.film.story import StoryEvent
from pytest_drive_robust.report.film.top_view import GroundPicture, draw_from_above, misplaced_m
from pytest_drive_robust.report.numbers import counted
from pytest_drive_robust.runner.replay.recording import Tape, TapedMoment, main_camera

_FRESH_S = 1.5
"""Seconds for which a new infraction is highlighted."""
_FRAME: c.Colour = (90, 96, 106)


@dataclass(frozen=True)
class EpisodePane:
    """Draws one tape into one half of the picture; `left` is the first column in pixels."""

    tape: Tape
    title: str
    colour: c.Colour
    ground: GroundPicture
    events: tuple[StoryEvent, ...]
    left: int

    @property
    def camera_box(self) -> c.Rectangle:
        """The rectangle of the camera pictures."""
        return c.Rectangle(self.left + 8, 90, 392, 221)

    def draw(self, picture: Pixels, position: int, *, twin: EgoState | None) -> None:
        """Draw the moment at `position`, or the last moment of a finished episode. `twin` is the clean ego, if any."""
        last = len(self.tape.moments) - 1
        at = min(position, last)
        moment = self.tape.moments[at]
        places = [(event.tick <= position, event.place) for event in self.events if event.place is not None]
        draw_from_above(
            picture,
            c.Rectangle(self.left + 408, 66, 224, 394),
            self.ground,
            moment,
            colour=self.colour,
            twin=twin,
            marks=[place for is_past, place in places if is_past],
            ahead=[place for is_past, place in places if not is_past],
        )
        self._head(picture)
        self._camera(picture, at, moment)
        self._numbers(picture, moment)
        self._captions(picture, position, at)
        if any(0 <= position - event.tick <= _FRESH_S / self.tape.result.dt_s for event in self.events):
            cv2.rectangle(picture, (self.left + 1, 35), (self.left + 638, 463), c.WRONG, 4)

    def _head(self, picture: Pixels) -> None:
        c.fill(picture, c.Rectangle(self.left, 34, 640, 28), self.colour)
        c.text(picture, self.title, (self.left + 10, 55), size=0.7, bold=True, colour=c.BACKGROUND, within=430)
        c.text(
            picture, _score(self.tape), (self.left + 630, 55), size=0.7, bold=True, colour=c.BACKGROUND, align="right"
        )

    def _camera(self, picture: Pixels, at: int, moment: TapedMoment) -> None:
        box = self.camera_box
        c.fill(picture, box, c.PANEL)
        images = self.tape.images(at)
        if not images:
            c.text(picture, "no picture", (box.x + box.width // 2, box.y + 110), colour=c.DIM, align="centre")
            return
        words = "a front camera, not given to the agent" if self.tape.shown_only else "what the agent is given"
        main = main_camera(images)
        if not self.tape.shown_only:
            words += f": {main}"
        c.text(picture, words, (box.x, box.y - 8), size=0.5, colour=c.DIM, within=box.width)
        others = [name for name in images if name != main]
        thumb_px = 0 if not others else min(62, box.width // len(others) * 9 // 16)
        _fit(picture, images[main][0], c.Rectangle(box.x, box.y, box.width, box.height - thumb_px))
        for number, name in enumerate(others):
            width = box.width // len(others)
            _fit(picture, images[name][0], c.Rectangle(box.x + number * width, box.bottom - thumb_px, width, thumb_px))
        if moment.real is not None:
            self._age(picture, moment.state.tick - images[main][1])

    def _age(self, picture: Pixels, ticks: int) -> None:
        """Write the age of a picture that is 2 `ticks` old or older. Called only if the real picture differs."""
        if ticks < 2:
            return
        box = self.camera_box
        cv2.rectangle(picture, (box.x + 1, box.y + 1), (box.right - 2, box.bottom - 2), c.WRONG, 4)
        c.fill(picture, c.Rectangle(box.x, box.y, box.width, 30), c.WRONG)
        words = f"THIS PICTURE IS {ticks * self.tape.result.dt_s:.2f} s OLD"
        c.text(picture, words, (box.x + 10, box.y + 22), size=0.7, bold=True, within=box.width - 20)

    def _numbers(self, picture: Pixels, moment: TapedMoment) -> None:
        """Write the speed in large figures, beside the control that the agent asks for and the control applied."""
        x, y = self.left + 8, self.camera_box.bottom
        speed = f"{moment.state.ego.speed_mps * 3.6:.0f}"
        c.text(picture, speed, (x + 54, y + 37), size=1.2, bold=True, align="right")
        c.text(picture, "km/h", (x + 60, y + 37), size=0.5, colour=c.DIM)
        _pedals(picture, c.Rectangle(x + 114, y + 3, 278, 20), "agent asks", moment.asked)
        _pedals(picture, c.Rectangle(x + 114, y + 26, 278, 20), "car gets", moment.applied)
        c.text(picture, _told(moment), (x + 4, y + 59), size=0.5, bold=True, colour=c.WRONG, within=388)

    def _captions(self, picture: Pixels, position: int, at: int) -> None:
        """Write the newest infraction and the end of the episode, and show the undisturbed camera picture."""
        box = c.Rectangle(self.left + 8, self.camera_box.bottom + 62, 392, 86)
        real = self.tape.real(at)
        if real is not None:
            inset = c.Rectangle(box.right - 153, box.y, 153, box.height)
            _fit(picture, real, inset)
            cv2.rectangle(picture, (inset.x, inset.y), (inset.right - 1, inset.bottom - 1), c.INK, 1)
            c.fill(picture, c.Rectangle(inset.x, inset.y, 88, 17), c.INK)
            c.text(picture, "really there", (inset.x + 5, inset.y + 13), size=0.42, colour=c.BACKGROUND, within=80)
            box = c.Rectangle(box.x, box.y, inset.x - box.x - 6, box.height)
        result = self.tape.result
        over = at == len(self.tape.moments) - 1
        happened = [event for event in self.events if event.tick <= position]
        lines = [(f"{event.tick * result.dt_s:.2f} s  {event.words}", c.WRONG) for event in happened[-1:]]
        loud = bool(happened) and position - happened[-1].tick <= _FRESH_S / result.dt_s
        if over:
            lines.append((result.end_detail, c.GOOD if result.outcome is Outcome.COMPLETED else c.WRONG))
        elif len(happened) > 1:
            lines.insert(0, (f"{counted(len(happened) - 1, 'infraction')} before", c.WRONG))
        y = box.y
        for number, (words, colour) in enumerate(lines):
            newest = number == len(lines) - 1
            place = c.Rectangle(box.x, y, box.width, 40)
            y += _caption(picture, words, place, colour, loud=newest and (loud or over)) + 4


def _caption(picture: Pixels, words: str, box: c.Rectangle, colour: c.Colour, *, loud: bool) -> int:
    """Write a sentence on at most two lines, on coloured ground when `loud`; return the height in pixels."""
    size = 0.6
    lines = c.wrapped(words, size=size, within=box.width - 24, bold=loud)
    height = 20 * len(lines) + 5
    c.fill(picture, c.Rectangle(box.x, box.y, box.width if loud else 6, height), colour)
    for number, line in enumerate(lines):
        place = (box.x + 14, box.y + 18 + 20 * number)
        c.text(picture, line, place, size=size, bold=loud, within=box.width - 20)
    return height


def _pedals(picture: Pixels, box: c.Rectangle, name: str, control: Control | None) -> None:
    """Draw the throttle as a green bar, the brake as a red bar, and steering as a needle."""
    c.text(picture, name, (box.x, box.y + 15), size=0.48, colour=c.INK)
    throttle = c.Rectangle(box.x + 94, box.y, 72, box.height)
    brake = c.Rectangle(box.x + 170, box.y, 60, box.height)
    steer = c.Rectangle(box.x + 234, box.y, 44, box.height)
    c.bar(picture, throttle, 0.0 if control is None else control.throttle, c.GOOD)
    c.bar(picture, brake, 0.0 if control is None else control.brake, c.WRONG)
    for part, words in ((throttle, "throttle"), (brake, "brake"), (steer, "")):
        cv2.rectangle(picture, (part.x, part.y), (part.right - 1, part.bottom - 1), _FRAME, 1)
        c.text(picture, words, (part.x + 5, part.y + 14), size=0.42)
    middle = steer.x + steer.width // 2
    cv2.line(picture, (middle, steer.y + 2), (middle, steer.bottom - 3), _FRAME, 1)
    if control is not None:
        needle = middle + round(control.steer * (steer.width / 2 - 3))
        cv2.line(picture, (needle, steer.y + 2), (needle, steer.bottom - 3), c.INK, 3)


def _told(moment: TapedMoment) -> str:
    """Return what the agent is told wrongly: the speed from 0.3 m/s on, the location from 0.3 m on."""
    given_mps, off_m = moment.speed_mps, misplaced_m(moment)
    words = []
    if given_mps is not None and abs(given_mps - moment.state.ego.speed_mps) > 0.3:
        words.append(f"told {given_mps * 3.6:.0f} km/h")
    if off_m:
        words.append(f"GPS off by {off_m:.0f} m")
    return ", ".join(words)


def _fit(picture: Pixels, pixels: Pixels, box: c.Rectangle) -> None:
    """Draw an image as large as fits into the box at its own aspect ratio."""
    height, width = pixels.shape[:2]
    scale = min(box.width / width, box.height / height)
    wide, high = max(1, math.floor(width * scale)), max(1, math.floor(height * scale))
    method = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_LINEAR
    x, y = box.x + (box.width - wide) // 2, box.y + (box.height - high) // 2
    c.Rectangle(x, y, wide, high).of(picture)[:] = cv2.resize(pixels, (wide, high), interpolation=method)


def _score(tape: Tape) -> str:
    if tape.result.outcome is Outcome.INFRA_ERROR:
        return "not scored"
    return f"DS {driving_score(tape.result):.1f}"
