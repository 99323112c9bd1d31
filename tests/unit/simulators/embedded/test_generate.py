"""The route generator: seeded, disjoint between seeds, never a route that cannot be staged or started."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.errors import RouteError, UnknownNameError
from pytest_drive_robust.simulators.embedded import generate
from pytest_drive_robust.simulators.embedded.dense_route import lay_route
from pytest_drive_robust.simulators.embedded.generate import (
    SEEDS,
    TOWNS_PER_SEED,
    Site,
    all_sites,
    draw_route,
    draw_routes,
    main,
)
from pytest_drive_robust.simulators.embedded.route_xml import load_routes
from pytest_drive_robust.simulators.embedded.scenarios import SCENARIOS, ScenarioType
from pytest_drive_robust.simulators.embedded.stage import Stage
from pytest_drive_robust.simulators.embedded.state import TWO_WAYS_NEVER
from pytest_drive_robust.simulators.embedded.weathers import weather_name

PLAIN = Site("Street", "road.f0", (80.0, 100.0))
FEW = settings(max_examples=15, deadline=None)


@pytest.fixture(name="staged")
def _staged(monkeypatch: pytest.MonkeyPatch) -> Callable[..., ScenarioType]:
    """Makes a scenario type of a builder and its sites, known while the test runs."""

    def make(build: Callable[[Stage], None], *sites: Site) -> ScenarioType:
        kind = ScenarioType("Tested", build, {}, {}, blocked_test_off=False, two_ways=TWO_WAYS_NEVER)
        monkeypatch.setitem(SCENARIOS, "Tested", kind)
        monkeypatch.setitem(all_sites(), "Tested", sites or (PLAIN,))
        return kind

    return make


def nothing(stage: Stage) -> None:
    """A scenario in which nothing happens."""
    stage.end_m = stage.dense.length_m


def draw(kind: ScenarioType, *, number: int = 0, seed: int = 0) -> Route:
    return draw_route(kind, number=number, seed=seed, route_id="1")


def town_number(route: Route) -> int:
    return int(re.sub(r"\D", "", route.town))


@given(
    seed=st.integers(0, SEEDS - 1),
    number=st.integers(0, 98),
    name=st.sampled_from(["VanillaNonSignalizedTurn", "ControlLoss", "SequentialLaneChange", "HighwayExit"]),
)
@FEW
def test_towns_carry_numbers_that_belong_to_their_seed_alone(seed: int, number: int, name: str) -> None:
    numbers = range(1 + TOWNS_PER_SEED * seed, 1 + TOWNS_PER_SEED * (seed + 1))
    assert town_number(draw(SCENARIOS[name], number=number, seed=seed)) in numbers
    assert numbers.stop - 1 < 10**6, "towns have six digits at most"


@given(seeds=st.lists(st.integers(0, SEEDS - 1), min_size=2, max_size=2, unique=True))
@FEW
def test_the_numbers_of_two_seeds_do_not_overlap(seeds: list[int]) -> None:
    first, second = (range(1 + TOWNS_PER_SEED * s, 1 + TOWNS_PER_SEED * (s + 1)) for s in sorted(seeds))
    assert first.stop <= second.start


def test_two_seeds_share_no_town_and_no_place() -> None:
    drawn = [draw_routes(seed=seed, per_type=1) for seed in (0, 1)]
    assert len(drawn[0]) == len(drawn[1]) == len(SCENARIOS)
    assert not {route.town for route in drawn[0]} & {route.town for route in drawn[1]}
    assert not {town_number(route) for route in drawn[0]} & {town_number(route) for route in drawn[1]}
    assert not {route.waypoints for route in drawn[0]} & {route.waypoints for route in drawn[1]}
    assert [route.id for route in drawn[0]] == [str(100 * (k + 1) + 1) for k in range(len(SCENARIOS))]
    for route in drawn[0]:
        assert weather_name(route.weather) in ("clear noon", "cloudy noon", "wet noon")
        assert 49.0 <= lay_route(route).length_m <= 222.5


def test_a_draw_is_the_same_alone_and_among_others(staged: Callable[..., ScenarioType]) -> None:
    kind = SCENARIOS["SequentialLaneChange"]
    alone = draw(kind, number=3, seed=7)
    draw(staged(nothing), number=3, seed=7)
    assert draw(kind, number=3, seed=7) == alone
    assert draw(kind, number=2, seed=7) != alone


def test_what_stands_where_the_ego_starts_is_named_after_the_last_draw(staged: Callable[..., ScenarioType]) -> None:
    def block(stage: Stage) -> None:
        stage.stand(ActorKind.CONTAINER, -stage.trigger_m)

    with pytest.raises(RouteError, match="a container stands where the ego starts"):
        draw(staged(block))


def test_dirt_under_the_ego_is_no_obstacle(staged: Callable[..., ScenarioType]) -> None:
    def soil(stage: Stage) -> None:
        stage.dirt(-stage.trigger_m)

    assert draw(staged(soil)).scenario.type == "Tested"


def test_a_route_that_cannot_be_staged_is_drawn_anew(staged: Callable[..., ScenarioType]) -> None:
    seen: list[float] = []

    def picky(stage: Stage) -> None:
        seen.append(stage.dense.length_m)
        if stage.dense.length_m < 95.0:
            raise RouteError("too short for me")

    kind = staged(picky)
    routes = [draw(kind, number=number) for number in range(4)]
    assert all(lay_route(route).length_m >= 95.0 for route in routes)
    assert len(seen) > 4, "every first draw was good: the test shows nothing"
    assert [draw(kind, number=number) for number in range(4)] == routes


@pytest.mark.parametrize(
    ("site", "reason"),
    [
        (Site("Street", "road.f0", (80.0, 90.0), before_m=(10.0, 20.0)), "leave before_m out"),
        (Site("OpenTee", "S.left0", (80.0, 90.0), before_m=(200.0, 210.0)), r"before_m is longer than the \d+ m"),
        (Site("Avenue", "road.f0>road.b0", (80.0, 90.0), changes_m=((10.0, 20.0),)), "no place found in 20 draws"),
        (Site("Street", "road.f0", (400.0, 410.0)), "'road.f0' does not fit a route of 4"),
        (Site("Street", "road.f7", (80.0, 90.0)), "Did you mean 'road.f0'"),
        (Site("Strasse", "road.f0", (80.0, 90.0)), "Did you mean 'Street'"),
    ],
)
def test_a_site_that_cannot_be_is_one_clear_error(staged: Callable[..., ScenarioType], site: Site, reason: str) -> None:
    with pytest.raises((RouteError, UnknownNameError), match=reason):
        draw(staged(nothing, site))


@pytest.mark.parametrize(
    ("seed", "per_type", "reason"), [(-1, 1, "seed -1"), (999, 1, "0 to 998"), (0, 100, "1 to 99")]
)
def test_seeds_and_numbers_out_of_range_are_refused(seed: int, per_type: int, reason: str) -> None:
    with pytest.raises(RouteError, match=reason):
        draw_routes(seed=seed, per_type=per_type)


def test_the_command_writes_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    few = {name: SCENARIOS[name] for name in ("ControlLoss", "VanillaNonSignalizedTurn")}
    monkeypatch.setattr(generate, "SCENARIOS", few)
    assert main([str(tmp_path / "new" / "some.xml"), "--seed", "3", "--per-type", "2"]) == 0
    routes = load_routes(tmp_path / "new" / "some.xml")
    assert [route.id for route in routes] == ["101", "102", "201", "202"]
    assert "4 routes of 2 scenario types, seed 3" in capsys.readouterr().out
    with pytest.raises(SystemExit, match="1"):
        main([str(tmp_path / "no.xml"), "--seed", "1000"])
    assert "seed 1000 draws no routes" in capsys.readouterr().err
    assert not (tmp_path / "no.xml").exists()


def test_a_file_that_cannot_be_written_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    drawn: list[int] = []
    monkeypatch.setattr(generate, "draw_routes", lambda *, seed, per_type: drawn.append(seed) or [])
    with pytest.raises(SystemExit, match="1"):
        main([str(tmp_path)])
    assert f"{tmp_path} is a directory: give the name of a file in it" in capsys.readouterr().err
    assert drawn == []
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(SystemExit, match="1"):
        main([str(tmp_path / "taken" / "mine.xml")])
    assert capsys.readouterr().err.count("\n") == 1
