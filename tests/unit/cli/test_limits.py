"""`drive-robust limits` on stored runs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from full_disk import full_disk
from stored_runs import store_run

from pytest_drive_robust import requirements
from pytest_drive_robust.cli.main import main

pytestmark = pytest.mark.usefixtures("home")


def proposed(*arguments: str) -> list[str]:
    assert main(["limits", "--agent", "driver", *arguments]) == 0
    return list(map(str, requirements(Path("limits-driver.txt").read_text(encoding="utf-8"))))


def test_they_keep_the_distance_that_evidence_needs() -> None:
    store_run("a", factor=0.8)
    # DS 74 on 40 routes with a spread of 27.5 is told apart from what lies 13 below; 10 of that is the margin
    # RD is 0.20 on every route; evidence reckons with one route more, on which all is lost
    assert proposed() == ["DS under clean >= 70", "RD under 200 ms latency <= 0.25"]


def test_few_routes_are_warned_of(capsys: pytest.CaptureFixture[str]) -> None:
    store_run("few", routes=3)
    proposed()
    assert "warning: 3 routes show little of an agent" in capsys.readouterr().out
    Path("limits-driver.txt").unlink()
    store_run("many", routes=12)
    proposed()
    assert "warning" not in capsys.readouterr().out


def test_a_run_is_named_or_the_latest(capsys: pytest.CaptureFixture[str]) -> None:
    store_run("a", factor=0.5)
    store_run("b")
    assert proposed("--run", "a")[1] == "RD under 200 ms latency <= 0.50"
    assert "limits-driver.txt: 2 limits" in capsys.readouterr().out


def test_what_has_no_proposal_is_kept_as_it_was_stated(capsys: pytest.CaptureFixture[str]) -> None:
    path = store_run("a", factor=0.8)
    document = json.loads(path.read_text())
    stated = [
        ("driver", "hardest_braking", "200 ms latency", "hardest_braking under 200 ms latency <= 7"),
        ("driver", "hardest_braking", "200 ms latency", "hardest_braking under 200 ms latency <= 7"),
        ("driver", "RD", "200 ms latency", "RD under 200 ms latency <= 0.90"),
        ("driver", "RD", "200 ms latency", "latency margin >= 200 ms (RD <= 0.30)"),
        ("driver", "SR", "clean", "SR under clean >= 0.5"),
        ("other", "comfort", "clean", "comfort under clean >= 10"),
    ]
    names = ("agent", "metric", "setting", "requirement")
    others = {"nodeid": "test_it", "routes_spec": "routes.xml", "seeds": [0], "routes": 40}
    others |= {"comparison": "<=", "limit": 1.0, "verdict": "pass", "value": 0.5}
    document["requirements"] = [others | dict(zip(names, item, strict=True)) for item in stated]
    path.write_text(json.dumps(document))
    assert main(["limits", "--agent", "driver"]) == 0
    lines = Path("limits-driver.txt").read_text(encoding="utf-8").splitlines()
    assert [line.partition("  ")[0] for line in lines[2:]] == [
        "DS under clean >= 70",
        "RD under 200 ms latency <= 0.25",
        "hardest_braking under 200 ms latency <= 7",
        "latency margin >= 200 ms (RD <= 0.30)",
        "SR under clean >= 0.5",
    ]
    assert all(line.endswith("  # kept as it was: no limit is proposed for it") for line in lines[4:])
    assert "2 limits and 3 more of the run's requirements, as they were." in capsys.readouterr().out


def test_a_file_that_exists_is_kept(capsys: pytest.CaptureFixture[str]) -> None:
    store_run("a")
    Path("limits-driver.txt").write_text("mine")
    assert main(["limits", "--agent", "driver"]) == 4
    assert Path("limits-driver.txt").read_text() == "mine"
    assert "--out" in capsys.readouterr().err


def test_a_full_disk_leaves_no_half_of_a_file_in_the_way_of_another_try(capsys: pytest.CaptureFixture[str]) -> None:
    store_run("a")
    with full_disk(100):
        assert main(["limits", "--agent", "driver"]) == 4
    assert "cannot write 'limits-driver.txt': File too large." in capsys.readouterr().err
    assert proposed()


@pytest.mark.parametrize(
    ("stated", "told"), [({"agent": "driver"}, "lacks 'nodeid'"), (None, "must be object, not null")]
)
def test_a_run_whose_requirements_lack_something_is_called_damaged(
    stated: object, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = store_run("a")
    path.write_text(json.dumps({**json.loads(path.read_text()), "requirements": [stated]}))
    assert main(["limits", "--agent", "driver"]) == 4
    assert f"a.json' is damaged: requirements[0] {told}" in capsys.readouterr().err
    assert not list(Path().glob("limits-*"))


def test_an_agent_that_is_not_there_is_refused_with_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    store_run("a")
    assert main(["limits", "--agent", "drivr"]) == 4
    assert "Did you mean 'driver'?" in capsys.readouterr().err
