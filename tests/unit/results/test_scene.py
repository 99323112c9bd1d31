"""What is exported of which episodes, and the names of its files."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from result_factory import infraction, make_result, trace_of
from stored_runs import SETTING, run_of

from pytest_drive_robust.domain.geodesy import to_geodetic
from pytest_drive_robust.domain.outcome import End, InfractionKind
from pytest_drive_robust.domain.result import EpisodeResult, Given, Injection, Tracks
from pytest_drive_robust.domain.truth import ActorKind, LightState
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.results.scene import Scene, scenes_of


def test_an_episode_under_a_failure_is_called_perturbed_with_or_without_its_twin() -> None:
    clean, late = make_result("101"), make_result("101", setting=SETTING)
    assert [list(scene.episodes) for scene in scenes_of(run_of(clean, late))] == [["clean", "perturbed"]]
    assert [list(scene.episodes) for scene in scenes_of(run_of(late))] == [["perturbed"]]
    assert [list(scene.episodes) for scene in scenes_of(run_of(clean))] == [["clean"]]


def test_episodes_that_ended_before_a_tick_are_not_said_to_be_missing() -> None:
    broken = replace(make_result("101", end=End.AGENT_CRASHED, end_detail="ValueError: no", trace=trace_of(0)), ticks=0)
    with pytest.raises(UsageError, match=r"none of these episodes lasted a tick: ValueError: no\."):
        list(scenes_of(run_of(broken)))


def test_a_clean_episode_is_shown_alone_where_its_twin_ended_before_a_tick() -> None:
    broken = make_result("101", setting=SETTING, end=End.AGENT_CRASHED, trace=trace_of(0))
    run = run_of(make_result("101"), broken, make_result("102"), make_result("102", setting=SETTING))
    assert [list(scene.episodes) for scene in scenes_of(run)] == [["clean"], ["clean", "perturbed"]]


def name_of(title: str) -> str:
    return Scene(title, {}, {}).file_name


def test_a_plain_title_is_read_in_the_name() -> None:
    assert name_of("3901 GreenLight GPS noise 15 m blind seed 0") == "3901-GreenLight-GPS-noise-15-m-blind-seed-0"


@pytest.mark.parametrize("one", ["a/b S clean x seed 0", "a-b S clean x seed 0", "a:b S clean x seed 0"])
def test_two_titles_never_share_a_file(one: str) -> None:
    other = "a b S clean x seed 0"
    assert name_of(one) != name_of(other)
    assert name_of(one).startswith(name_of(other))


@pytest.mark.parametrize("letter", ["x", "路"])
def test_a_name_fits_on_a_disk_however_long_the_title_is(letter: str) -> None:
    names = {name_of(letter * 400 + end) for end in ("a", "b")}
    assert len(names) == 2
    assert all(len(name.encode()) <= 200 for name in names)


TRACE = trace_of(3, x_m=[10.0, 20.0, 30.0], y_m=[1.0, 5.0, 7.0], yaw_rad=[0.0, math.pi / 2.0, 1.0], speed_mps=4.0)
EAST, SOUTH_EAST = 0, 785
ROUTE = [0, 0, 1000, 0]


def shown(path: str, result: EpisodeResult, world: dict[str, Any] | None = None) -> list[tuple[float, Any]]:
    """Return the seconds and the things of a path, of an episode under a failure."""
    items = Scene("", {"perturbed": result}, world or {}).items()
    assert [second for second, *_ in items] == sorted(second for second, *_ in items)
    return [(second, thing) for second, found, thing in items if found == path]


def tracks(**tables: list[list[int]]) -> Tracks:
    """Return tracks of two samples, a second apart at 20 Hz."""
    columns = {"actors": 6, "motion": 4, "lights": 0, "plans": 4, "points": 2}
    usual = {"lights": [[], []]}
    found = {name: np.array(tables.get(name, usual.get(name, [])), np.int32) for name in columns}
    return Tracks(
        20, **{name: rows.reshape(len(rows), -1 if len(rows) else columns[name]) for name, rows in found.items()}
    )


def test_the_ego_is_where_it_was_at_the_end_of_each_tick_seen_from_above_with_the_north_up() -> None:
    box, *poses = shown("perturbed/ego", make_result(trace=TRACE))
    assert box[0] == 0.0
    assert box[1].frame == box[1].boxes[0].name == "perturbed"
    assert [second for second, _ in poses] == pytest.approx([0.05, 0.10, 0.15])
    assert [tuple(pose) for _, pose in poses] == [(10.0, -1.0, 0.0), (20.0, -5.0, -math.pi / 2.0), (30.0, -7.0, -1.0)]
    assert poses[1][1].turned == pytest.approx((-math.sqrt(0.5), math.sqrt(0.5)))  # a quarter to the right
    places = shown("perturbed/location", make_result(trace=TRACE))
    assert [tuple(place) for _, place in places] == [
        to_geodetic(10.0, 1.0),
        to_geodetic(20.0, 5.0),
        to_geodetic(30.0, 7.0),
    ]
    assert [values["speed_mps"] for _, values in shown("perturbed/state", make_result(trace=TRACE))] == [4.0] * 3


def test_what_the_agent_was_told_of_its_place_stands_at_the_tick_in_which_it_was_told() -> None:
    given = Given(np.array([[0.0, 8.0, 2.0, 0.0, 0.0, 0.0], [2.0, 9.0, 3.0, 0.0, 0.0, 2.0]], np.float32))
    told = shown("perturbed/told", replace(make_result(trace=TRACE), given=given))
    assert told == [(0.0, to_geodetic(8.0, 2.0)), (0.1, to_geodetic(9.0, 3.0))]


def test_a_plan_lies_ahead_and_to_the_right_of_where_the_ego_was_when_it_was_made() -> None:
    plans = [[0, 1, 0, 0], [1, 2, 1, 1], [2, 0, 1, 0]]
    points = [[10, 0], [50, 0], [100, 20], [7, 7], [8, 8], [30, 10]]
    result = replace(make_result(trace=TRACE), tracks=tracks(plans=plans, points=points))
    found = [
        (second, *(line.tolist() for kind in plan.lines for line in kind.lines))
        for second, plan in shown("perturbed/plan", result)
    ]
    assert [second for second, _ in found] == pytest.approx([0.0, 0.05, 0.10])
    assert np.allclose(found[0][1], [[11.0, -1.0]])  # before the first tick: as near as is known
    assert np.allclose(found[1][1], [[15.0, -1.0], [20.0, -3.0]])
    assert np.allclose(found[2][1], [[19.0, -8.0]])  # it drives south, so its right is the west


def test_actors_are_there_for_as_long_as_they_were_and_turned_as_they_were() -> None:
    actors = [[7, ActorKind.CAR, 460, 190, 0, 2], [9, ActorKind.PEDESTRIAN, 50, 60, 1, 1]]
    motion = [[100, 200, 0, 0], [300, 200, 500, 0], [-400, 50, -250, 0]]
    result = replace(make_result(trace=TRACE), tracks=tracks(actors=actors, motion=motion))
    (first, before), (second, after) = shown("perturbed/actors", result)
    assert (first, second) == (0.0, 1.0)
    assert [(box.name, tuple(box.pose)) for box in before.boxes] == [("car 7", (1.0, -2.0, 0.0))]
    assert [(box.name, tuple(box.pose)) for box in after.boxes] == [
        ("car 7", (3.0, -2.0, -0.5)),
        ("pedestrian 9", (-4.0, -0.5, 0.25)),
    ]
    assert [box.size_m for box in after.boxes] == [(4.6, 1.9, 1.5), (0.5, 0.6, 1.75)]
    assert after.boxes[0].colour != after.boxes[1].colour


def test_stop_lines_lie_across_their_lanes_in_the_colour_of_their_lights() -> None:
    stops = [[1000, 200, EAST, 400, 1, 0, 0], [0, 0, SOUTH_EAST, 200, 1, 0, 0]]
    lights = [[LightState.GREEN, LightState.RED], [LightState.YELLOW, LightState.STOP_SIGN]]
    result = replace(make_result(trace=TRACE), tracks=tracks(lights=lights))
    (_, before), (_, after) = shown("perturbed/actors", result, {"route": ROUTE, "stops": stops})
    across, slanted = (line.lines[0] for line in before.lines)
    assert np.allclose(sorted(across.tolist()), [[10.0, -4.0], [10.0, 0.0]])
    assert np.allclose(slanted.mean(axis=0), 0.0)
    assert np.allclose((slanted[0] - slanted[1]) @ (1.0, -1.0), 0.0, atol=1e-2)
    assert np.hypot(*(slanted[0] - slanted[1])) == pytest.approx(2.0)
    green, red, yellow, stop = (line.colour for line in (*before.lines, *after.lines))
    assert len({green, red, yellow}) == 3
    assert stop == red


def test_a_lane_has_its_painted_lines_half_a_width_beside_its_middle() -> None:
    middle = [0, 0, 1000, 0, 2000, 0]
    lanes = [[0, 0, 400, 1, 0, middle], [0, 0, 400, 0, 1, middle], [0, 1, 400, 1, 1, middle]]
    world = {"route": ROUTE, "crossings": [[0, 0, 100, 0, 100, 300]], "lanes": lanes}
    ((_, road),) = shown("road", make_result(trace=TRACE), world)
    crossing, left, right = road.lines[0].lines  # none in a junction
    assert crossing.tolist() == [[0.0, 0.0], [1.0, 0.0], [1.0, -3.0], [0.0, 0.0]]
    assert np.allclose(left, [[0.0, 2.0], [10.0, 2.0], [20.0, 2.0]])
    assert np.allclose(right, [[0.0, -2.0], [10.0, -2.0], [20.0, -2.0]])
    assert [line.tolist() for line in road.lines[1].lines] == [[[0.0, 0.0], [10.0, 0.0]]]


def test_failures_infractions_and_the_end_are_noted_when_they_come() -> None:
    result = replace(
        make_result(trace=trace_of(40), infractions=[infraction(InfractionKind.RED_LIGHT, second=1.5)]),
        schedule=(Injection("gps-noise", "gps", 10, 39),),
    )
    assert [(second, note.text.partition(":")[0], note.bad) for second, note in shown("perturbed/log", result)] == [
        (0.5, "gps-noise begins in gps", False),
        (1.5, InfractionKind.RED_LIGHT.value, True),
        (2.0, "completed, red light at 1.5 s", False),
    ]


def test_a_collision_is_noted_with_its_speed_in_kmh() -> None:
    hit = replace(infraction(InfractionKind.COLLISION_VEHICLE, second=1.5), detail="hit van at 5.0 m/s")
    result = make_result(trace=trace_of(40), infractions=[hit])
    notes = [note.text for _, note in shown("perturbed/log", result)]
    assert notes[0] == f"{InfractionKind.COLLISION_VEHICLE.value}: hit van at 18 km/h"
