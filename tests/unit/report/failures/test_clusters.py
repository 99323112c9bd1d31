"""Why episodes broke, against what a person saw in a hundred of them."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from result_factory import crashed_simulation, infraction, make_result, trace_of

from pytest_drive_robust.domain.outcome import End, InfractionKind
from pytest_drive_robust.domain.result import Injection
from pytest_drive_robust.domain.truth import EgoState, GroundTruth, WorldState
from pytest_drive_robust.report.failures.clusters import clusters_of, sentence_of
from pytest_drive_robust.report.failures.moment import first_failure, manoeuvre
from pytest_drive_robust.report.failures.road import Road
from pytest_drive_robust.simulators.embedded.dense_route import lay_route
from pytest_drive_robust.simulators.routes import resolve_routes
from pytest_drive_robust.store.record import decode_episode

HERE = Path(__file__).parent
EGO = EgoState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.9, 1.8)
NOTHING = WorldState(0, EGO, np.zeros((0, 10)), np.zeros(0, np.int64))


@cache
def road(route_id: str) -> Road:
    (route,) = resolve_routes(route_id)
    laid = lay_route(route)
    return Road(GroundTruth(NOTHING, laid.lane_map, laid.rows, 0))


def labelled() -> list[tuple[str, str]]:
    lines = (HERE / "labelled_failures.txt").read_text(encoding="utf-8").splitlines()
    return [(parts[0], parts[-1]) for line in lines if line[0] != "#" for parts in [line.split(" | ")]]


def test_at_least_85_of_100_failures_are_told_as_a_person_tells_them():
    told = {}
    with zipfile.ZipFile(HERE / "labelled_failures.zip") as archive:
        for name, label in labelled():
            result = decode_episode(archive.read(name))
            where = road(result.episode.route_id)
            moment = first_failure(result, where)
            doing = manoeuvre(result, moment.tick, where, leaving=moment.leaving) if moment.moves else ""
            told[name] = (label, f"{moment.what} {doing}".strip())
    wrong = {name: pair for name, pair in told.items() if pair[0] != pair[1]}
    assert len(told) == 100
    assert len(wrong) <= 15, wrong


def hit(second: float = 1.0, **given):
    return make_result(infractions=[infraction(InfractionKind.COLLISION_VEHICLE, second=second)], **given)


@pytest.mark.parametrize(
    ("result", "sentence"),
    [
        (hit(), "Hit a vehicle while following the road"),
        (hit(2.0, trace=trace_of(40, yaw_rad=np.linspace(0, 1.2, 40))), "Hit a vehicle while turning right"),
        (hit(2.0, trace=trace_of(40, yaw_rad=np.linspace(0, -1.2, 40))), "Hit a vehicle while turning left"),
        (hit(0.0), "Hit a vehicle"),  # official records do not tell when, so not what the ego was doing
        (make_result(end=End.AGENT_CRASHED), "The agent broke"),
        (crashed_simulation(), "The simulation broke"),
        (make_result(end=End.BLOCKED, trace=trace_of(400)), "Stood still to the end"),
        (make_result(end=End.TICK_CAP, trace=trace_of(400, speed_mps=5.0)), "Ran out of time"),
        (
            replace(make_result(end=End.TICK_CAP, trace=trace_of(0)), ticks=400),
            "Ran out of time",
        ),  # its trace is not stored any more
        (replace(make_result(end=End.BLOCKED, trace=trace_of(0)), ticks=400), "Stood still to the end"),
        (make_result(end=End.DEVIATED), "Left its route while following the road"),
        (
            make_result(infractions=[infraction(InfractionKind.OUTSIDE_LANES, share_pct=5.0)]),
            "Left its lane while following the road",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_without_a_road_the_record_and_the_trace_still_tell(result, sentence):
    assert sentence_of(result, None) == sentence


def test_what_comes_first_counts():
    events = [infraction(InfractionKind.COLLISION_LAYOUT, second=1.5), infraction(InfractionKind.RED_LIGHT, second=0.5)]
    assert sentence_of(make_result(infractions=events), None).startswith("Ran a red light")


def test_a_failure_that_strikes_now_and_then_is_named_when_it_had_just_struck():
    burst = Injection("burst-frame-drop", "front", 10, 19)
    struck = replace(hit(second=1.0, trace=trace_of(200, speed_mps=5.0)), schedule=(burst,))
    assert sentence_of(struck, None) == "Hit a vehicle while following the road in a burst frame drop"
    long_ago = replace(hit(second=5.0, trace=trace_of(200, speed_mps=5.0)), schedule=(burst,))
    always = replace(struck, schedule=(Injection("gps-noise", "gps", 0, 199),))
    afterwards = replace(struck, schedule=(replace(burst, first_tick=struck.infractions[0].tick, last_tick=29),))
    for result in (long_ago, always, afterwards):
        assert sentence_of(result, None) == "Hit a vehicle while following the road"


def test_groups_come_with_the_largest_first_and_a_clear_example():
    twice = hit(trace=trace_of(80, speed_mps=5.0))
    worse = make_result(
        infractions=[infraction(InfractionKind.COLLISION_VEHICLE), infraction(InfractionKind.RED_LIGHT, second=2.0)]
    )
    good, dead = make_result(), make_result(end=End.AGENT_CRASHED)
    numbered = [(7, worse), (3, good), (5, twice), (9, dead)]
    clusters = clusters_of(numbered, lambda result: None)
    assert [(item.sentence, item.episodes, item.example) for item in clusters] == [
        ("Hit a vehicle while following the road", (7, 5), 5),
        ("The agent broke", (9,), 9),
    ]
    assert clusters[0].name == "hit-a-vehicle-while-following-the-road"
