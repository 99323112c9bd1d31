"""Watches both seams of an episode: did the perturbations change the agent's observation or the vehicle's control?

A perturbation may list an injection in its schedule and still change nothing: zero metres of noise, or a camera that
the agent does not have. So the loop compares, at almost no cost: first objects by identity, then ticks and values.
Pixels are compared only for images in different memory with the same tick of capture, and only until a change of that
camera was seen once; after that, different memory counts as a change.
"""

from __future__ import annotations

from array import array
from math import nan

import numpy as np

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import Image, Observation
from pytest_drive_robust.domain.result import CONTROL, Given, Reception, Touch, read_only


class Witness:
    """Counts the changed ticks of one episode. `seen` and `applied` run at most once per tick, 1 to 2 us each."""

    __slots__ = ("_cameras", "_consumes", "_counts", "_firsts", "_observations", "_told")

    def __init__(self, cameras: tuple[str, ...] = (), consumes: tuple[str, ...] = ()) -> None:
        self._cameras = cameras
        self._consumes = consumes
        self._observations = 0
        self._counts: dict[str, int] = {}
        self._firsts: dict[str, int] = {}
        self._told = array("f")

    def seen(self, captured: Observation, given: Observation) -> None:
        """Compare the observation `given` to the agent with the observation `captured` by the sensors."""
        self._observations += 1
        gps = given.gps
        self._told.extend((captured.tick, gps.x_m, gps.y_m, given.compass.heading_rad, given.speed.mps))
        for name in self._cameras:
            image = given.cameras.get(name)
            self._told.append(nan if image is None else image.tick)
        if given is captured:
            return
        for signal in ("gps", "speed", "imu", "compass"):
            one, other = getattr(captured, signal), getattr(given, signal)
            if other is not one and other != one:
                self._touch(signal, captured.tick)
        if given.cameras is not captured.cameras:
            self._compare_images(captured, given)

    def applied(self, tick: int, asked: Control | None, given: Control) -> None:
        """Compare the control `given` to the vehicle with the agent's answer `asked`, None when it was not asked."""
        if given is not asked and given != asked:
            self._touch(CONTROL, tick)

    def reception(self) -> Reception:
        """Return the counts of changes so far."""
        touched = tuple(Touch(signal, count, self._firsts[signal]) for signal, count in self._counts.items())
        return Reception(self._cameras, self._consumes, self._observations, touched)

    def given(self) -> Given:
        """Return the signals that the agent was given so far, in their own memory."""
        width = len(Given.COLUMNS) + len(self._cameras)
        whole = len(self._told) // width  # the last row is partial when a perturbation gave no number
        return Given(read_only(np.array(self._told[: whole * width], dtype=np.float32).reshape(whole, width)))

    def _compare_images(self, captured: Observation, given: Observation) -> None:
        for name, image in captured.cameras.items():
            other = given.cameras.get(name)
            if other is not image and (other is None or self._differ(name, image, other)):
                self._touch(name, captured.tick)

    def _differ(self, camera: str, one: Image, other: Image) -> bool:
        if one.tick != other.tick:
            return True
        if one.pixels is other.pixels:
            return False
        if camera in self._counts:
            return True
        return not np.array_equal(one.pixels, other.pixels)

    def _touch(self, signal: str, tick: int) -> None:
        count = self._counts.get(signal, 0)
        if count == 0:
            self._firsts[signal] = tick
        self._counts[signal] = count + 1
