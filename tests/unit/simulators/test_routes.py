"""What can be typed for the routes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from pytest_drive_robust.errors import RouteError, UnknownNameError, UsageError
from pytest_drive_robust.options.run import DEFAULT_ROUTES
from pytest_drive_robust.simulators.embedded.route_xml import save_routes
from pytest_drive_robust.simulators.routes import default_spec, resolve_routes, routes_for
from pytest_drive_robust.testing import FakeSimulator, fake_route

ROUTES = """<routes>
  <route id="7" town="Straight">
    <waypoints><position x="0.0" y="0.0" z="0.0"/><position x="60.0" y="0.0" z="0.0"/></waypoints>
    <scenarios>
      <scenario name="ParkedObstacle_1" type="ParkedObstacle">
        <trigger_point x="20.0" y="0.0" z="0.0" yaw="0.0"/>
      </scenario>
    </scenarios>
  </route>
  <route id="12" town="Straight">
    <waypoints><position x="0.0" y="0.0" z="0.0"/><position x="90.0" y="0.0" z="0.0"/></waypoints>
    <scenarios>
      <scenario name="ParkedObstacle_2" type="ParkedObstacle">
        <trigger_point x="20.0" y="0.0" z="0.0" yaw="0.0"/>
      </scenario>
    </scenarios>
  </route>
</routes>
"""


@pytest.fixture
def route_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    (tmp_path / "mine.xml").write_text(ROUTES)
    monkeypatch.chdir(tmp_path)
    return "mine.xml"


def ids(spec: str) -> list[str]:
    return [route.id for route in resolve_routes(spec)]


def test_a_named_set_gives_its_routes() -> None:
    full, first, hard = (resolve_routes(name) for name in ("full", "one-per-scenario", "dev10"))
    assert len({route.id for route in full}) == len(full)
    assert [route.scenario.type for route in first] == sorted({route.scenario.type for route in full})
    assert all(route in first for route in hard)
    assert all(route in full for route in first)
    assert resolve_routes(DEFAULT_ROUTES) == first


def test_ids_alone_are_looked_up_among_all_that_we_ship_and_keep_their_order() -> None:
    first, second, *_ = ids("full")
    assert ids(f"{second},{first}") == [second, first]
    assert ids(f" {second} , {first}, {second}") == [second, first]
    assert ids(f"one-per-scenario:{first}") == [first]
    with pytest.raises(UnknownNameError, match=f"no route of 'one-per-scenario' named '{second}'"):
        ids(f"one-per-scenario:{second}")


def test_a_file_gives_all_of_its_routes_or_those_that_are_named(route_file: str) -> None:
    assert ids(route_file) == ["7", "12"]
    assert ids(f"{route_file}:12") == ["12"]
    assert ids(str(Path(route_file).resolve())) == ["7", "12"]


def test_an_unknown_id_is_answered_with_those_of_the_file(route_file: str) -> None:
    with pytest.raises(UnknownNameError, match=r"no route of 'mine\.xml' named '71'.*Known: 12, 7"):
        resolve_routes(f"{route_file}:71")
    with pytest.raises(
        UnknownNameError, match=r"no route of 'full' named '999999'.*`drive-robust routes list full` shows them"
    ):
        resolve_routes("999999")


def test_of_many_ids_those_nearest_to_an_unknown_one_are_named() -> None:
    with pytest.raises(UnknownNameError) as refused:
        resolve_routes("full:29010")
    told = re.search(r"Nearest of 220: ([\d, ]+)\. `drive-robust routes list full`", str(refused.value))
    assert told is not None, refused.value
    named = told[1].split(", ")
    assert len(named) == 8
    assert named[0] == "2901"


def test_an_unknown_set_or_file_is_answered_with_the_nearest(route_file: str) -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'one-per-scenario'"):
        resolve_routes("one-per-scenrio")
    with pytest.raises(UnknownNameError, match=r"no route file named 'mien\.xml'. Did you mean 'mine\.xml'"):
        resolve_routes("mien.xml")


@pytest.mark.parametrize("spec", ["", "  ", "full:", "full: ,"])
def test_nothing_named_is_an_error(spec: str) -> None:
    with pytest.raises(UsageError, match="no route"):
        resolve_routes(spec)


def test_a_file_that_is_no_route_file_is_a_route_error(tmp_path: Path) -> None:
    path = tmp_path / "broken.xml"
    path.write_text("<routes><route")
    with pytest.raises(RouteError, match=r"broken\.xml"):
        resolve_routes(str(path))


class Island(FakeSimulator):
    """Drives its own three routes, and by name some more."""

    def routes(self, names=()):
        for name in names:
            if not name.startswith("island-"):
                raise UnknownNameError.of("route of fake", name, ["island-1", "island-2"])
        return tuple(fake_route(name) for name in names or ("island-1", "island-2", "island-3"))


def own_ids(spec, simulator):
    return [route.id for route in routes_for(spec, simulator)]


def test_nobody_chose_so_the_simulator_does():
    assert default_spec(DEFAULT_ROUTES, Island(), given=False) == "fake"
    assert own_ids("fake", Island()) == ["island-1", "island-2", "island-3"]


def test_somebody_chose():
    assert default_spec("island-7,island-9", Island(), given=True) == "island-7,island-9"
    assert own_ids("island-7, island-9", Island()) == ["island-7", "island-9"]


def test_without_own_routes_ours_are_the_default():
    assert default_spec(DEFAULT_ROUTES, FakeSimulator(), given=False) == DEFAULT_ROUTES
    assert len(own_ids(DEFAULT_ROUTES, FakeSimulator())) >= 1


def test_files_and_sets_are_understood_and_left_to_check_route(tmp_path: Path):
    save_routes([fake_route("77")], tmp_path / "mine.xml")
    assert own_ids(str(tmp_path / "mine.xml"), Island()) == ["77"]
    assert own_ids(DEFAULT_ROUTES, Island()) == own_ids(DEFAULT_ROUTES, FakeSimulator())


def test_what_is_none_of_both_is_told_in_the_simulator_s_words():
    with pytest.raises(UnknownNameError, match=r"no route of fake named 'ilsand-1'\. Did you mean 'island-1'"):
        routes_for("ilsand-1", Island())
