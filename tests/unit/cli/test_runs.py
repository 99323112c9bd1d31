"""`drive-robust runs`."""

from __future__ import annotations

import os
from datetime import datetime, timezone

import pytest
from stored_runs import store_run

from pytest_drive_robust.cli.main import main
from pytest_drive_robust.regression import clock

pytestmark = pytest.mark.usefixtures("home")


def test_the_latest_run_is_the_one_that_was_stored_last_though_an_older_one_was_copied_since(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for day, name, factor in ((26, "good", 1.0), (28, "bad", 0.5), (27, "between", 1.0)):
        monkeypatch.setattr(clock, "now", lambda day=day: datetime(2026, 11, day, tzinfo=timezone.utc))
        store_run(name, factor=factor)
    assert main(["compare", "good", "latest"]) == 1
    assert "-> bad (" in capsys.readouterr().out


def test_runs_are_listed_with_their_size_the_oldest_first(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["runs", "list"]) == 0
    assert "no stored run" in capsys.readouterr().out
    first, second = store_run("zebra"), store_run("ant")
    os.utime(first, (1, 1))
    os.utime(second, (2, 2))
    (first.parent / "torn.json").write_text("{")
    (first.parent / "void.json").write_text('{"schema": 1, "settings": {}, "summaries": [{}], "episodes": []}')
    assert main(["runs", "list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[:5]] == ["name", "zebra", "ant", "torn", "void"]
    assert lines[1].split()[-3:] == ["driver", "2", "80"]
    assert "+" not in lines[1]  # the zone of the clock
    assert "torn.json' is not valid JSON" in lines[5]
    assert lines[6].endswith("void.json' is damaged: settings lacks 'simulator'.")


def test_a_link_to_a_run_that_is_gone_and_a_folder_are_no_runs(capsys: pytest.CaptureFixture[str]) -> None:
    folder = store_run("before").parent
    store_run("after")
    (folder / "gone.json").symlink_to("nowhere.json")
    (folder / "folder.json").mkdir()
    assert main(["runs", "list"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == ["name", "before", "after"]
    assert main(["compare", "before", "latest"]) == 0
