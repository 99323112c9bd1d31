from __future__ import annotations

import os
from pathlib import Path

import pytest

from pytest_drive_robust.store.whole_file import whole_file, write_whole


@pytest.mark.parametrize("synced", [False, True])
@pytest.mark.parametrize(("content", "data"), [("a ≤ b\n", b"a \xe2\x89\xa4 b\n"), (b"\0\r\n", b"\0\r\n"), ("", b"")])
def test_a_file_holds_what_was_written_and_nothing_else_is_left(tmp_path, content, data, synced):
    (tmp_path / "file").write_bytes(b"old and longer than the new")
    write_whole(tmp_path / "file", content, synced=synced)
    assert (tmp_path / "file").read_bytes() == data
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.skipif(os.name == "nt", reason="no such permissions there")
def test_a_file_has_the_permissions_of_a_new_one(tmp_path):
    (tmp_path / "plain").touch()
    write_whole(tmp_path / "whole", "text")
    assert (tmp_path / "whole").stat().st_mode == (tmp_path / "plain").stat().st_mode


@pytest.mark.skipif(os.name == "nt", reason="a link needs a privilege there")
def test_a_link_stays_and_the_file_that_it_leads_to_is_written(tmp_path):
    (tmp_path / "far").mkdir()
    (tmp_path / "link").symlink_to(Path("far", "file"))
    for content in ("new", "newer"):  # the file was not there at first
        write_whole(tmp_path / "link", content)
        assert (tmp_path / "link").is_symlink()
        assert [(path.name, path.read_text()) for path in (tmp_path / "far").iterdir()] == [("file", content)]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["far", "link"]


def test_what_cannot_be_written_leaves_the_old_file(tmp_path):
    (tmp_path / "file").write_text("old")
    with pytest.raises(UnicodeEncodeError):
        write_whole(tmp_path / "file", "half a character: \ud800")
    with pytest.raises(ZeroDivisionError), whole_file(tmp_path / "file") as temporary:
        _write_half(temporary)
    assert (tmp_path / "file").read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_folder_that_is_not_there_is_not_made(tmp_path):
    with pytest.raises(FileNotFoundError):
        write_whole(tmp_path / "none" / "file", "text")
    assert list(tmp_path.iterdir()) == []


def _write_half(path):
    path.write_text("half")
    raise ZeroDivisionError


def test_two_writers_of_one_file_do_not_meet(tmp_path):
    with whole_file(tmp_path / "one.txt") as first, whole_file(tmp_path / "one.txt") as second:
        assert first != second
        for place in (first, second):
            place.write_text("whole")
    assert [path.name for path in tmp_path.iterdir()] == ["one.txt"]
