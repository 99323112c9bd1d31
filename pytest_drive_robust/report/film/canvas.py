"""Draws the basic shapes and text of the film, and defines its colours. All pictures are RGB uint8."""

from __future__ import annotations

from dataclasses import dataclass

import cv2

from pytest_drive_robust.jit.arrays import Pixels

Colour = tuple[int, int, int]

WIDTH, HEIGHT = 1280, 720
BACKGROUND: Colour = (16, 18, 22)
PANEL: Colour = (34, 38, 46)
INK: Colour = (240, 240, 240)
DIM: Colour = (150, 157, 168)
CLEAN: Colour = (90, 200, 250)
PERTURBED: Colour = (255, 159, 64)
WRONG: Colour = (220, 45, 40)
GOOD: Colour = (52, 180, 92)
MARK: Colour = (255, 221, 51)

_FONT = cv2.FONT_HERSHEY_SIMPLEX
_MOST_LINES = 2
_SMALLEST = 0.8
"""The share of its size down to which long text shrinks before it is cut."""


@dataclass(frozen=True, slots=True)
class Rectangle:
    """A rectangle of the picture in pixels: left, top, width, height."""

    x: int
    y: int
    width: int
    height: int

    @property
    def right(self) -> int:
        """The column after the last one."""
        return self.x + self.width

    @property
    def bottom(self) -> int:
        """The row after the last one."""
        return self.y + self.height

    def of(self, picture: Pixels) -> Pixels:
        """Return a view of the part of a picture inside the rectangle; writing to the view writes to the picture."""
        return picture[self.y : self.bottom, self.x : self.right]


def fill(picture: Pixels, box: Rectangle, colour: Colour) -> None:
    """Paint a box."""
    if box.width > 0 and box.height > 0:
        cv2.rectangle(picture, (box.x, box.y), (box.right - 1, box.bottom - 1), colour, -1)


def text(
    picture: Pixels,
    words: str,
    place: tuple[int, int],
    *,
    size: float = 0.55,
    colour: Colour = INK,
    bold: bool = False,
    within: int | None = None,
    align: str = "left",
) -> int:
    """Write one line whose baseline begins (`"left"`), ends (`"right"`) or centres at `place`; returns its width.

    `within` is the largest width in pixels: a longer line shrinks a little, then loses its end. OpenCV draws only
    ASCII, so other letters become question marks.
    """
    words = words.encode("ascii", "replace").decode()
    thickness = 2 if bold else 1
    if within is not None:
        size = max(size * _SMALLEST, min(size, size * within / max(text_width(words, size, bold=bold), 1)))
        whole = words
        while whole and text_width(words, size, bold=bold) > within:
            whole = whole[:-1]
            words = f"{whole.rstrip()}..."
    width = text_width(words, size, bold=bold)
    x = place[0] - {"left": 0, "right": width, "centre": width // 2}[align]
    cv2.putText(picture, words, (x, place[1]), _FONT, size, colour, thickness, cv2.LINE_AA)
    return width


def text_width(words: str, size: float, *, bold: bool = False) -> int:
    """Return how many pixels wide a line is."""
    return int(cv2.getTextSize(words, _FONT, size, 2 if bold else 1)[0][0]) if words else 0


def wrapped(words: str, *, size: float, within: int, bold: bool = False) -> list[str]:
    """Return `words` split at blanks into at most two lines; the last line may be longer than `within` pixels."""
    found = [""]
    for word in words.split():
        longer = f"{found[-1]} {word}".strip()
        if text_width(longer, size, bold=bold) <= within or len(found) == _MOST_LINES:
            found[-1] = longer
        else:
            found.append(word)
    return found


def bar(picture: Pixels, box: Rectangle, share: float, colour: Colour) -> None:
    """Draw a bar filled from the left by `share` (0..1)."""
    fill(picture, box, BACKGROUND)
    fill(picture, Rectangle(box.x, box.y, round(box.width * min(max(share, 0.0), 1.0)), box.height), colour)
