"""An agent that ships plans tomorrow what it plans today: weights, and everything between a sensor and a control."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import golden_drives
import numpy as np
import pytest
from golden_drives import COMMAND, Drive, Spoil, drive, label, shipped

from pytest_drive_robust import Observation
from pytest_drive_robust.registry.registry import default_registry

TOLERANCE = 1e-3
"""Metres of waypoints, shares of a control: both engines round otherwise, and otherwise on other processors."""

AGENTS = pytest.mark.parametrize("name", sorted(shipped()))


def golden(name: str) -> Drive:
    kept = golden_drives.read(name)
    assert kept.get("weights") == label(name), f"these weights have no golden drive yet: {COMMAND}"
    driven: Drive = kept["drive"]
    return driven


def off(one: Drive, other: Drive) -> float:
    """The largest difference of two numbers; infinite where there are more of them on one side."""
    flat = [[(name, len(values)) for moment in driven for name, values in moment.items()] for driven in (one, other)]
    if flat[0] != flat[1]:
        return float("inf")
    pairs = ((a[name], b[name]) for a, b in zip(one, other, strict=True) for name in a)
    return max(float(np.abs(np.subtract(mine, theirs)).max(initial=0.0)) for mine, theirs in pairs)


@AGENTS
def test_an_agent_plans_what_it_planned_when_its_weights_were_shipped_and_the_same_in_every_process(name: str) -> None:
    kept = golden(name)
    here = drive(default_registry().agent(name))
    command = [sys.executable, str(Path(golden_drives.__file__)), name]
    there = subprocess.run(command, capture_output=True, text=True, check=True, cwd=Path.cwd()).stdout
    assert json.loads(there) == here, "two processes of one machine must agree to the last bit"
    assert off(here, kept) < TOLERANCE, f"{name} plans otherwise; if that is meant: {COMMAND}"


@AGENTS
def test_on_torch_it_plans_the_same(name: str) -> None:
    pytest.importorskip("torch")
    made: Any = default_registry().entry("agents", name).load()
    assert off(drive(made(engine="torch")), golden(name)) < TOLERANCE


def pictures(change: Callable[[np.ndarray], np.ndarray]) -> Spoil:
    return lambda seen: seen.map_images(
        lambda _, image: replace(image, pixels=np.ascontiguousarray(change(image.pixels)))
    )


def turned(seen: Observation) -> Observation:
    return replace(seen, compass=replace(seen.compass, heading_rad=seen.compass.heading_rad + 0.02))


def aside(seen: Observation) -> Observation:
    return replace(seen, gps=replace(seen.gps, y_m=seen.gps.y_m + 0.1))


def in_km_h(seen: Observation) -> Observation:
    return replace(seen, speed=replace(seen.speed, mps=3.6 * seen.speed.mps))


MISTAKES: dict[str, Spoil] = {
    "blue for red": pictures(lambda pixels: pixels[..., ::-1]),
    "half as bright": pictures(lambda pixels: pixels // 2),
    "two pixels aside": pictures(lambda pixels: np.roll(pixels, 2, axis=1)),
    "mirrored": pictures(lambda pixels: pixels[:, ::-1]),
    "yaw of another frame": turned,
    "place of another frame": aside,
    "km/h": in_km_h,
}


@AGENTS
def test_it_would_be_seen_if_what_an_agent_is_given_were_changed(name: str) -> None:
    agent = default_registry().agent(name)
    right = golden(name)[:2]
    found = {mistake: off(drive(agent, spoil=spoil, ticks=20), right) for mistake, spoil in MISTAKES.items()}
    assert off(drive(agent, ticks=20), right) < TOLERANCE
    assert {mistake: by for mistake, by in found.items() if by < 5.0 * TOLERANCE} == {}
