"""Whatever a route file holds: routes, or one `RouteError`."""

from __future__ import annotations

import re
import tempfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from official_like import draw

from pytest_drive_robust.domain.route import Route, ScenarioSpec, TriggerPoint, Waypoint
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.simulators.embedded.dense_route import lay_route
from pytest_drive_robust.simulators.embedded.route_xml import load_routes, save_routes
from pytest_drive_robust.simulators.embedded.traced.schema import SCHEMA

NASTY = [
    "",
    "nan",
    "inf",
    "-1e308",
    "1e9",
    "0",
    "-5",
    "Town99",
    "left",
    "&#0;",
    "&amp;",
    "\u202e",
    "a" * 300,
    "1,5",
    "0x1p4",
]
KINDS = sorted(SCHEMA)


@pytest.fixture(scope="module")
def text() -> str:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "dense.xml"
        save_routes([draw(kind, route_id=str(k)) for k, kind in enumerate(KINDS[:3])], path)
        return path.read_text(encoding="utf-8")


def _read(text: str | bytes) -> tuple[Route, ...]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "fuzz.xml"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return load_routes(path)


@settings(max_examples=700, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_changed_values_and_elements_are_read_or_refused(text: str, data: st.DataObject) -> None:
    changed = text
    for _ in range(data.draw(st.integers(1, 4))):
        spots = list(re.finditer(data.draw(st.sampled_from([r'"[^"]*"', r"<[^>]*>", r"\w+=", r">"])), changed))
        if not spots:
            break
        spot = spots[data.draw(st.integers(0, len(spots) - 1))]
        new = data.draw(st.sampled_from(NASTY) | st.text(max_size=8))
        keep = data.draw(st.sampled_from(["quoted", "raw", "twice"]))
        put = {"quoted": f'"{new}"', "raw": new, "twice": spot[0] * 2}[keep]
        changed = changed[: spot.start()] + put + changed[spot.end() :]
    with suppress(RouteError):
        assert all(len(route.waypoints) >= 2 for route in _read(changed.encode("utf-8", "replace")))


@settings(max_examples=200, deadline=None)
@given(blob=st.binary(max_size=200))
def test_bytes_are_read_or_refused(blob: bytes) -> None:
    with suppress(RouteError):
        _read(blob)


NUMBERS = st.floats(-200.0, 200.0) | st.floats(allow_nan=False, allow_infinity=False)
STEPS = st.lists(st.tuples(st.floats(0.0, 60.0), st.floats(-1.5, 1.5)), min_size=1, max_size=40)


@settings(max_examples=160, deadline=None)
@given(
    kind=st.sampled_from(KINDS),
    steps=STEPS,
    dense=st.booleans(),
    at=st.tuples(NUMBERS, NUMBERS),
    trigger=st.floats(0.0, 60.0),
    place=st.tuples(NUMBERS, NUMBERS),
)
def test_any_line_is_a_road_or_refused(
    kind: str,
    steps: list[tuple[float, float]],
    dense: bool,
    at: tuple[float, float],
    trigger: float,
    place: tuple[float, float],
) -> None:
    heading, points = 0.0, [np.array(at)]
    for length, turn in steps:
        heading += turn * (0.2 if dense else 1.0)
        for _ in range(max(1, round(length / 2.0)) if dense else 1):
            points.append(points[-1] + (2.0 if dense else length) * np.array([np.cos(heading), np.sin(heading)]))
    waypoints = tuple(Waypoint(float(x), float(y)) for x, y in points)
    spot = TriggerPoint(at[0] + trigger * np.cos(steps[0][1]), at[1], 0.0, 0.0)
    given_at = {"x": place[0], "y": place[1]}
    names = (*SCHEMA[kind].locations, *SCHEMA[kind].optional_locations)
    route = Route("1", "Town03", waypoints, ScenarioSpec("s", kind, spot, dict.fromkeys(names, given_at)))
    try:
        laid = lay_route(route)
    except RouteError:
        with pytest.raises(RouteError, match=r"^route 1: "):
            lay_route(route)
    else:
        assert np.isfinite(laid.rows).all()
        assert 0.0 <= laid.trigger_m <= laid.length_m


def test_entities_are_not_expanded() -> None:
    bomb = '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa">' + "".join(
        f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in zip("abcdefgh", "bcdefghi", strict=True)
    )
    with pytest.raises(RouteError, match="not a route XML file"):
        _read(bomb + "]><routes>&i;</routes>")


def test_every_mistake_of_a_file_is_told_at_once(text: str) -> None:
    bent = "".join(f'<position x="{20 * (k % 2)}" y="{k % 3}" z="0"/>' for k in range(9))
    wrong = text.replace('type="Accident"', 'type="Acident"', 1).replace("<trigger_point", "<trigger", 2)
    wrong = wrong.replace("<trigger ", "<trigger_point ", 1)
    third = wrong.rindex("<waypoints>")
    wrong = wrong[:third] + "<waypoints>" + bent + wrong[wrong.rindex("</waypoints>") :]
    with pytest.raises(RouteError, match="3 of 3 routes cannot be read") as raised:
        _read(wrong)
    said = str(raised.value)
    for part in ("route 0: unknown scenario type 'Acident', did you mean 'Accident'", "route 1: ", "route 2: "):
        assert part in said
