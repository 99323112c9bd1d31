"""`read_run`: what a notebook does with a stored run."""

from __future__ import annotations

import sys
from dataclasses import replace

import pytest

from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.results import TABLES, read_run
from pytest_drive_robust.results.tables import columns_of

pytestmark = pytest.mark.slow


def test_a_run_is_read_as_plain_objects(project):
    run = read_run("one")
    assert [(item.requirement, item.verdict) for item in run.requirements] == [
        ("DS under clean >= 1", "pass"),
        ("DS under GPS noise 15 m >= 99", "fail"),
    ]
    clean, perturbed = run.episodes
    assert run.twin(perturbed) is clean
    assert run.twin(clean) is None
    assert len(perturbed.trace.rows) == perturbed.ticks
    assert len(perturbed.tracks.actors) > 0
    assert run.options["simulator"] == "embedded"


def test_a_file_of_a_run_and_a_store_elsewhere(driven, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = driven / ".drive-robust" / "runs" / "one.json"
    assert [len(result.trace.rows) for result in read_run(file).episodes] == [0, 0]
    assert all(len(result.trace.rows) for result in read_run(file, store=driven / ".drive-robust").episodes)


def test_every_table_has_its_columns_though_it_has_no_rows(project):
    run = read_run("one")
    empty = replace(run, requirements=(), episodes=())
    names = [[list(columns_of(one, table)) for table in TABLES] for one in (empty, run)]
    assert names[0] == names[1]
    assert columns_of(empty, "requirements")["verdict"] == []


def test_the_frames_agree_with_the_objects(project):
    pytest.importorskip("pandas", reason="pandas is not installed: pip install -e '.[dev]'")
    run = read_run()
    episodes, ticks, infractions = (run.frame(name) for name in ("episodes", "ticks", "infractions"))
    assert list(episodes.setting) == ["clean", "GPS noise 15 m"]
    assert list(episodes.clean_key.fillna("")) == ["", episodes.key[0]]
    assert list(ticks.groupby("key", sort=False).size()) == list(episodes.ticks) == [e.ticks for e in run.episodes]
    assert len(infractions) == sum(len(result.infractions) for result in run.episodes)
    perturbed = ticks[ticks.setting == "GPS noise 15 m"]
    assert perturbed.speed_mps.tolist() == run.episodes[1].trace.column("speed_mps").tolist()
    told = perturbed.dropna(subset=["told_x_m"])
    assert len(told) == len(run.episodes[1].given.rows)
    assert 5.0 < (told.told_x_m - told.x_m).std() < 30.0
    only = run.select(setting="clean").frame("ticks")
    assert set(only.setting) == {"clean"}


def test_polars_where_it_is_asked_for(project):
    pytest.importorskip("polars", reason="polars is not installed: pip install polars")
    run = read_run("one")
    for table in TABLES:
        assert len(run.frame(table, library="polars")) == len(run.frame(table, library="pandas"))


def test_what_cannot_be_had_is_refused(project, monkeypatch):
    run = read_run("one")
    with pytest.raises(UnknownNameError, match="Did you mean 'ticks'"):
        run.frame("tick")
    with pytest.raises(UnknownNameError, match="no data frame library named 'panda'"):
        run.frame(library="panda")
    with pytest.raises(UnknownNameError, match="Did you mean 'GPS noise 15 m'"):
        run.select(setting="GPS noise 5 m")
    monkeypatch.setitem(sys.modules, "pandas", None)
    monkeypatch.setitem(sys.modules, "polars", None)
    with pytest.raises(UsageError, match="pip install pandas"):
        run.frame()


def test_a_column_that_no_trace_has_is_refused(project):
    with pytest.raises(UnknownNameError, match=r"no column of a trace named 'speed'\. Did you mean 'speed_mps'"):
        read_run("one").episodes[0].trace.column("speed")


def test_a_store_that_is_not_there_is_refused(project):
    with pytest.raises(UsageError, match="the store is 'nope', expected a folder of stored episodes"):
        read_run("one", store="nope")
