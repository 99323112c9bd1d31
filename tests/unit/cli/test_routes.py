"""`drive-robust routes`: lists and contact sheets."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import pytest

from pytest_drive_robust.cli.main import main
from pytest_drive_robust.simulators.embedded.route_xml import save_routes
from pytest_drive_robust.simulators.routes import resolve_routes


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_routes_are_listed_in_at_most_100_columns(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["routes", "list", "full"]) == 0
    shown = capsys.readouterr().out
    assert max(len(line) for line in shown.splitlines()) <= 100
    for route in resolve_routes("full"):
        rows = [line.split() for line in shown.splitlines() if line.split()[:1] == [route.id]]
        assert [row[1:3] for row in rows] == [[route.scenario.type, route.town]]


def test_ids_are_listed_in_the_order_given(capsys: pytest.CaptureFixture[str]) -> None:
    first, second, *_ = (route.id for route in resolve_routes("full"))
    assert main(["routes", "list", f"{second},{first}"]) == 0
    shown = capsys.readouterr().out
    assert "2 routes" in shown
    assert shown.index(f"{second} ") < shown.index(f"{first} ")


def test_a_path_behind_an_equals_sign_may_begin_with_the_home_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home = tmp_path / "home"
    home.mkdir()
    monkeypatch.setenv("HOME", str(home))
    assert main(["routes", "draw", "101", "--size=64", "--output=~/sheet.png"]) == 0
    assert [path.name for path in home.iterdir()] == ["sheet.png"]


def test_a_world_lists_routes_of_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    world = "gymnasium:roundabout-v0"
    assert main(["routes", "list", "--sim", world]) == 0
    title, _, *rows = capsys.readouterr().out.splitlines()
    assert title.strip() == f"{world}: 10 routes"
    assert rows[1].split()[:4] == ["roundabout-v0-1", "roundabout-v0", world, "-"]
    assert main(["routes", "list", "roundabout-v0-42", "--sim", world]) == 0
    assert "1 route" in capsys.readouterr().out
    for given in ([""], ["", "--sim", world]):
        assert main(["routes", "list", *given]) == 4
        assert "no routes were named" in capsys.readouterr().err
    assert main(["routes", "list", "roundabot-v0-1", "--sim", world]) == 4
    assert "Did you mean 'roundabout-v0-1'?" in capsys.readouterr().err


def test_a_sheet_is_drawn_with_and_without_cameras(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ids = ",".join(route.id for route in resolve_routes("one-per-scenario")[:2])
    assert main(["routes", "draw", ids, "-o", "two.png", "--size", "96"]) == 0
    assert main(["routes", "draw", ids, "-o", "cameras.png", "--size", "96", "--camera"]) == 0
    plain, cameras = cv2.imread(str(tmp_path / "two.png")), cv2.imread(str(tmp_path / "cameras.png"))
    assert plain.shape[0] == cameras.shape[0]
    assert cameras.shape[1] > 2.5 * plain.shape[1]
    assert f"two.png: {plain.shape[1]} x {plain.shape[0]} pixels" in capsys.readouterr().out


def test_a_long_list_goes_on_on_a_second_sheet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("pytest_drive_robust.simulators.embedded.route_sheet.TILES_PER_SHEET", 1)
    ids = ",".join(route.id for route in resolve_routes("one-per-scenario")[:2])
    assert main(["routes", "draw", ids, "-o", "sheet.png", "--size", "64"]) == 0
    assert (tmp_path / "sheet.png").exists()
    assert (tmp_path / "sheet-2.png").exists()
    assert capsys.readouterr().out.count("pixels") == 2


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["list", "one-per-scenari"], "Did you mean 'one-per-scenario'"),
        (["list", "999999"], "no route of 'full' named '999999'"),
        (["draw", "dev10", "-o", "sheet.jpg"], "expected the name of a .png file"),
        (["draw", "dev10", "-o", "nowhere/sheet.png"], "there is no folder 'nowhere'"),
        (["check", ""], "no routes were named"),
        (["draw", "dev10", "--seed", "-1"], "--seed holds -1, expected whole numbers >= 0"),
        (["draw", "dev10", "--size", "9"], "--size is 9, expected 64 to 2048"),
        (["draw", "dev10", "--columns", "0"], "--columns is 0, expected at least 1"),
    ],
)
def test_what_cannot_be_used_exits_with_4(arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["routes", *arguments]) == 4
    assert told in capsys.readouterr().err


def test_a_check_says_what_was_understood(capsys: pytest.CaptureFixture[str]) -> None:
    chosen = resolve_routes("one-per-scenario")[:3]
    assert main(["routes", "check", ",".join(route.id for route in chosen)]) == 0
    shown = capsys.readouterr().out
    assert "3 of 3 routes can be driven" in shown
    assert "lanes" in shown
    assert f"{chosen[0].id} {chosen[0].scenario.type}" in shown


def test_a_check_names_every_route_that_cannot_be_driven(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good, *bad = resolve_routes("one-per-scenario")[:3]
    moved = [
        replace(route, waypoints=tuple(replace(point, x_m=point.x_m + 5000.0) for point in route.waypoints))
        for route in bad
    ]
    save_routes([good, *moved], tmp_path / "mixed.xml")
    assert main(["routes", "check", "mixed.xml"]) == 4
    shown = capsys.readouterr()
    assert "1 of 3 routes can be driven" in shown.out
    assert "2 of 3 routes cannot be driven" in shown.err
    for route in bad:
        assert f"route {route.id}: " in shown.err


def test_single_routes_of_a_file_are_drawn(tmp_path: Path) -> None:
    routes = resolve_routes("one-per-scenario")[:3]
    save_routes(routes, tmp_path / "three.xml")
    assert main(["routes", "draw", "three.xml", routes[1].id, "-o", "one.png", "--size", "96"]) == 0
    assert cv2.imread(str(tmp_path / "one.png")).shape[1] < 2 * 96
