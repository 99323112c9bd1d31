"""Traffic_Signs with the maps of the user's CARLA: here a stand-in whose planner puts a waypoint at each metre."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
from official_records import document, record, write

from pytest_drive_robust.cli.main import main


class Planner:
    """One straight road; `town` is the text of its map: the metre where the junction begins, or nothing."""

    def __init__(self, town: str, step_m: float) -> None:
        self._junction_m = float(town) if town else float("inf")
        self._step_m = step_m

    def trace_route(self, begin: tuple[float, ...], end: tuple[float, ...]) -> list[tuple[Any, None]]:
        metres = range(int(begin[0]), int(end[0]), int(self._step_m))
        return [(SimpleNamespace(is_junction=x >= self._junction_m), None) for x in metres]


@pytest.fixture
def carla_root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    carla, planner = ModuleType("carla"), ModuleType("agents.navigation.global_route_planner")
    vars(carla).update(Map=lambda town, text: text, Location=lambda x, y, z: (x, y, z))
    vars(planner).update(GlobalRoutePlanner=Planner)
    for name, module in {"carla": carla, "agents": ModuleType("agents"), planner.__name__: planner}.items():
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setitem(sys.modules, "agents.navigation", ModuleType("agents.navigation"))
    return tmp_path / "carla"


def put_map(root: Path, *parts: str, junction: str) -> None:
    path = root.joinpath("CarlaUE4", "Content", "Carla", "Maps", *parts)
    path.parent.mkdir(parents=True)
    path.write_text(junction)


def arguments(tmp_path: Path, root: Path, *completions: float, town: str = "Town99") -> list[str]:
    """Routes of 200 m that failed after these percentages without ignoring a sign."""
    one = (
        '<route id="{}" town="{}"><waypoints><position x="0" y="0" z="0"/><position x="50" y="0" z="0"/>'
        '<position x="200" y="0" z="0"/></waypoints><scenarios><scenario name="a" type="T_Junction">'
        '<trigger_point x="0" y="0" z="0" yaw="0"/></scenario></scenarios></route>'
    )
    ids = [str(number) for number in range(len(completions))]
    (tmp_path / "r.xml").write_text(f"<routes>{''.join(one.format(name, town) for name in ids)}</routes>")
    records = [
        record(name, scenario="T_Junction", status="Failed - TickRuntime", completion=completion)
        for name, completion in zip(ids, completions, strict=True)
    ]
    path = write(tmp_path / "r.json", document(*records))
    return ["score", str(path), "--routes", str(tmp_path / "r.xml"), "--carla-root", str(root), "--json"]


@pytest.mark.parametrize("parts", [("OpenDrive", "Town99.xodr"), ("Town99", "OpenDrive", "Town99.xodr")])
def test_the_map_decides_what_was_beyond_the_junction(
    tmp_path: Path, carla_root: Path, capsys: pytest.CaptureFixture[str], parts: tuple[str, ...]
) -> None:
    put_map(carla_root, *parts, junction="91")  # waypoint 92 of 200, and 8 more: passed above 50 %
    assert main(arguments(tmp_path, carla_root, 49.9, 50.0, 50.1, 80.0)) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["abilities"]["Traffic_Signs"] == {"value": 0.5, "low": 0.5, "high": 0.5, "routes": 4}
    assert not any("only the map" in note for note in told["notes"])


def test_what_the_official_tool_stops_at_is_one_sentence(
    tmp_path: Path, carla_root: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = arguments(tmp_path, carla_root, 50.0)
    assert main(given) == 4
    assert "there is no map of 'Town99'" in capsys.readouterr().err
    put_map(carla_root, "OpenDrive", "Town99.xodr", junction="")
    assert main(given) == 4
    assert "has no junction" in capsys.readouterr().err
    sys.modules["carla"] = None  # type: ignore[assignment]
    assert main(given) == 4
    assert "needs 'carla', which cannot be imported" in capsys.readouterr().err


def test_maps_without_routes_are_refused(tmp_path: Path, carla_root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path / "x.json", document(record()))
    assert main(["score", str(path), "--carla-root", str(carla_root)]) == 4
    assert "needs --routes" in capsys.readouterr().err
