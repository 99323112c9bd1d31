"""`drive-robust export --format csv|parquet`: tables that their own libraries open again."""

from __future__ import annotations

import csv
import sys

import pytest

from pytest_drive_robust.cli.main import main
from pytest_drive_robust.results import TABLES, read_run

pytestmark = pytest.mark.slow


def test_csv_tables_hold_every_tick(project, tmp_path, capsys):
    assert main(["export", "one", str(tmp_path), "--format", "csv"]) == 0
    assert [line.split(":")[0] for line in capsys.readouterr().out.splitlines()] == [
        str(tmp_path / f"{table}.csv") for table in TABLES
    ]
    run = read_run("one")
    with (tmp_path / "ticks.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == sum(result.ticks for result in run.episodes)
    assert [float(row["x_m"]) for row in rows if row["setting"] == "clean"] == run.episodes[0].trace.column(
        "x_m"
    ).tolist()
    with (tmp_path / "requirements.csv").open(newline="", encoding="utf-8") as file:
        assert [row["verdict"] for row in csv.DictReader(file)] == ["pass", "fail"]


def test_parquet_tables_are_read_by_arrow(project, tmp_path):
    pytest.importorskip("pyarrow", reason="pyarrow is not installed: pip install -e '.[parquet]'")
    from pyarrow import parquet

    assert main(["export", "one", str(tmp_path), "--format", "parquet", "--setting", "GPS noise 15 m"]) == 0
    (result,) = read_run("one").select(setting="GPS noise 15 m").episodes
    ticks = parquet.read_table(tmp_path / "ticks.parquet")
    assert ticks.column("speed_mps").to_pylist() == result.trace.column("speed_mps").tolist()
    assert ticks.column("told_x_m").null_count == result.ticks - len(result.given.rows)
    (episode,) = parquet.read_table(tmp_path / "episodes.parquet").to_pylist()
    assert (episode["route_id"], episode["seed"], episode["outcome"]) == ("3901", 0, result.outcome.value)
    assert parquet.read_table(tmp_path / "infractions.parquet").num_rows == len(result.infractions)


def test_ticks_that_are_not_stored_are_told_of(project, tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    assert main(["export", "one", str(tmp_path), "--format", "csv", "--episodes", str(tmp_path / "empty")]) == 0
    assert "2 of 2 episodes are not in the store, so their ticks are missing" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--format", "parkuet"], "Did you mean 'parquet'"),
        (["--format", "csv", "--route", "3902"], "Did you mean '3901'"),
        (["--format", "csv", "--episodes", "a", "--episodes", "b"], "--episodes is given 2 times"),
        (["--format", "csv", "--episodes", "nowhere"], "--episodes is 'nowhere', expected a folder of stored episodes"),
        ([], "Give DIR"),
        (["somewhere", "--seed", "0"], "Give DIR without --agent"),
    ],
    ids=str,
)
def test_what_cannot_be_used_is_refused(project, capsys, arguments, message):
    assert main(["export", "one", *arguments]) == 4
    assert message in capsys.readouterr().err


def test_a_missing_library_is_named_with_the_command_that_installs_it(project, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert main(["export", "one", str(tmp_path), "--format", "parquet"]) == 4
    assert "pip install 'pytest-drive-robust[parquet]'" in capsys.readouterr().err
