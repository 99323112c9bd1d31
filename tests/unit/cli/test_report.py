"""`drive-robust report`: a stored run as pages."""

from __future__ import annotations

import errno

import pytest
from report_pages import data_of
from stored_runs import store_run

from pytest_drive_robust.cli.main import main
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.report.film.file_name import film_name
from pytest_drive_robust.store.record_files import RecordFiles


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_a_stored_run_becomes_pages_and_the_path_is_printed(tmp_path, capsys):
    store_run("one")
    assert main(["report", "one"]) == 0
    assert capsys.readouterr().out == f"report: {tmp_path.joinpath('drive-report/index.html').relative_to(tmp_path)}\n"
    assert data_of(tmp_path / "drive-report")["label"] == "one"


def test_a_store_that_is_not_there_is_refused(tmp_path, capsys):
    store_run("one")
    assert main(["report", "one", "--store", "nope"]) == 4
    assert "there is no store 'nope'" in capsys.readouterr().err
    assert not (tmp_path / "drive-report").exists()


def test_against_a_run_says_what_got_worse(tmp_path):
    store_run("one")
    store_run("two", factor=0.5)
    assert main(["report", "two", "--against", "one", "--out", "look"]) == 0
    assert data_of(tmp_path / "look")["comparison"]["regressed"]


def test_against_a_run_of_more_routes_compares_on_request_only(tmp_path):
    store_run("one")
    store_run("two", routes=10)
    arguments = ["report", "two", "--against", "one", "--out", "look"]
    assert main(arguments) == 0
    refused = data_of(tmp_path / "look")["comparison"]
    assert refused["refused"]
    assert "two lacks routes of one: 30 of 40 under clean" in refused["conclusion"]
    assert main([*arguments, "--on-mismatch", "warn"]) == 0
    told = data_of(tmp_path / "look")["comparison"]["conclusion"]
    assert told == "no regression on 10 of 40 routes in 2 settings against one: not one score changed"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["on"], "Did you mean 'one'?"),
        (["one", "--against", "tw"], "there is no stored run named 'tw'"),
        (["one", "--against", ""], "--against is empty, expected"),
        (["one", "--out", "."], "holds other things"),
        (["one", "--films", "films"], "--films is 'films'"),
    ],
    ids=str,
)
def test_what_cannot_be_used_is_refused(capsys, arguments, message):
    store_run("one")
    assert main(["report", *arguments]) == 4
    assert message in capsys.readouterr().err


def test_a_disk_that_is_full_is_told_with_the_folder(monkeypatch, capsys):
    def full(*arguments):
        raise OSError(errno.ENOSPC, "No space left on device")  # as write() has it, without a name

    store_run("one")
    monkeypatch.setattr("pytest_drive_robust.store.whole_file.os.write", full)
    assert main(["report", "one", "--out", "pages"]) == 4
    assert "cannot write 'pages': No space left on device." in capsys.readouterr().err


def test_films_come_along(tmp_path):
    store_run("one")
    (tmp_path / "films").mkdir()
    name = film_name(Episode("driver", "1", "clean", 0))
    (tmp_path / "films" / name).write_bytes(b"film")
    (tmp_path / "films" / "replay-1-clean.mp4").write_bytes(b"a film of an earlier version")
    assert main(["report", "one", "--films", "films"]) == 0
    data = data_of(tmp_path / "drive-report")
    (number,) = data["films"]
    assert data["films"] == {number: name}
    assert data["episodes"]["words"][data["episodes"]["setting"][int(number)]] == "clean"
    assert [path.read_bytes() for path in (tmp_path / "drive-report" / "films").iterdir()] == [b"film"]
    assert "films of no episode here, which are not shown: replay-1-clean.mp4" in data["notes"]


def test_films_in_the_report_that_is_replaced_are_refused_and_stay(tmp_path, capsys):
    store_run("one")
    assert main(["report", "one", "--out", "look"]) == 0
    film = tmp_path / "look" / "films" / "replay-1-clean.mp4"
    film.parent.mkdir(exist_ok=True)
    film.write_bytes(b"film")
    assert main(["report", "one", "--out", "look", "--films", "look/films"]) == 4
    assert "lies in 'look', which is replaced" in capsys.readouterr().err
    assert film.read_bytes() == b"film"


def test_a_damaged_run_leaves_the_earlier_report(tmp_path, capsys):
    store_run("one")
    assert main(["report", "one", "--out", "look"]) == 0
    path = store_run("two")
    path.write_text(path.read_text().replace('"verdict"', '"judgement"'))
    assert main(["report", "two", "--out", "look"]) == 4
    assert "two.json' is damaged: summaries[0] lacks 'verdict'" in capsys.readouterr().err
    assert data_of(tmp_path / "look")["label"] == "one"


def test_a_damaged_episode_is_refused_until_it_is_moved_away(tmp_path, capsys):
    store_run("one")
    RecordFiles(tmp_path / ".drive-robust").write("clean 1", b"torn")
    assert main(["report", "one"]) == 4
    assert "clean 1.episode' cannot be read: it does not begin as a stored episode does" in capsys.readouterr().err
    assert main(["store", "verify", "--fix"]) == 0
    assert main(["report", "one"]) == 0
