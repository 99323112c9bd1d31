"""`drive-robust export --format rrd`: what Rerun opens."""

from __future__ import annotations

import sys

import pytest
from full_disk import full_disk

from pytest_drive_robust.cli.main import main
from pytest_drive_robust.results import read_run

pytestmark = pytest.mark.slow


def test_rerun_reads_both_episodes_and_the_road(project, tmp_path):
    rerun = pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install -e '.[rrd]'")
    reading = pytest.importorskip("rerun.chunk", reason="this rerun-sdk cannot read its files without a viewer")
    assert main(["export", "one", str(tmp_path), "--format", "rrd", "--setting", "GPS noise 15 m"]) == 0
    (path,) = tmp_path.glob("*.rrd")
    reader = reading.RrdReader(path)
    assert len(reader.recordings()) == len(reader.blueprints()) == 1
    timelines = {"time"} if hasattr(rerun.RecordingStream, "set_log_time_enabled") else {"time", "log_time"}
    rows: dict[str, int] = {}
    for chunk in reader.stream(store=reader.recordings()[0]):
        assert set(chunk.timeline_names) <= timelines
        rows[chunk.entity_path] = rows.get(chunk.entity_path, 0) + chunk.num_rows
    run = read_run("one")
    for name, result in zip(("clean", "perturbed"), run.episodes, strict=True):
        assert rows[f"/{name}/state/speed_mps"] == rows[f"/{name}/location"] == result.ticks
        assert rows[f"/{name}/ego"] == result.ticks + 2
        assert rows[f"/{name}/actors"] == 2 * len(result.tracks.lights)
        assert rows[f"/{name}/log"] >= len(result.infractions) + 1
        assert rows[f"/{name}/told"] == len(result.given.rows)
    assert rows["/road"] == 2


def test_a_disk_that_is_full_is_said_and_leaves_no_half_of_a_file(project, tmp_path, capsys):
    pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install -e '.[rrd]'")
    with full_disk(100_000):
        assert main(["export", "one", str(tmp_path), "--format", "rrd", "--setting", "GPS noise 15 m"]) == 4
    assert f"cannot write to '{tmp_path}': File too large." in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_what_it_needs_is_named(project, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert main(["export", "one", str(tmp_path), "--format", "rrd"]) == 4
    assert "pip install 'pytest-drive-robust[rrd]'" in capsys.readouterr().err
