from __future__ import annotations

from types import SimpleNamespace

import pytest

from pytest_drive_robust.errors import DriveRobustError
from pytest_drive_robust.store.events import (
    EpisodesNeeded,
    Finished,
    Judged,
    Planned,
    Started,
    StoreTroubled,
)
from pytest_drive_robust.store.journal import JournalReader, JournalWriter

EVENTS = [
    Planned(("a", "b")),
    EpisodesNeeded("driver", "two", "clean", (0, 1), ("a", "b"), ()),
    Started("a", "driver", "clean", "1 Straight"),
    Finished("a", 0.5),
    StoreTroubled("the disk is full"),
    Judged("test_x.py::t", "DS under clean >= 60", "driver", "two", (0,), "DS", "clean", ">=", 60.0, "error"),
]


def test_a_journal_tells_each_event_once(tmp_path):
    reader, writer = JournalReader(tmp_path), JournalWriter(tmp_path, name="gw0")
    assert reader.read() == []
    for event in EVENTS[:2]:
        writer(event)
    assert reader.read() == EVENTS[:2]
    for event in EVENTS[2:]:
        writer(event)
    assert reader.read() == EVENTS[2:]
    writer.close()
    assert JournalReader(tmp_path).read() == EVENTS


def test_a_line_whose_writer_died_is_left_out_and_what_comes_behind_it_is_read(tmp_path):
    writer, reader = JournalWriter(tmp_path, name="gw0"), JournalReader(tmp_path)
    writer(EVENTS[0])
    writer.close()
    with (tmp_path / "journals" / "gw0.jsonl").open("ab") as file:
        file.write(b'{"event": "Finished", "key": "a')
    assert reader.read() == EVENTS[:1]
    later = JournalWriter(tmp_path, name="gw0")
    for event in EVENTS[1:3]:
        later(event)
    later.close()
    assert reader.read() == EVENTS[1:3]
    assert JournalReader(tmp_path).read() == EVENTS[:3]


def test_an_event_behind_one_that_a_full_disk_cut_off_is_read(tmp_path, monkeypatch):
    writer = JournalWriter(tmp_path, name="gw0")
    file, taken = writer._file, iter([7, 0])

    def write(data):
        size = next(taken)
        if not size:
            raise OSError("the disk is full")
        return file.write(data[:size])

    with monkeypatch.context() as full:
        full.setattr(writer, "_file", SimpleNamespace(write=write))
        with pytest.raises(DriveRobustError, match=r"gw0\.jsonl, where the run reads it: the disk is full\. Make"):
            writer(EVENTS[0])
    writer(EVENTS[1])
    writer.close()
    assert JournalReader(tmp_path).read() == EVENTS[1:2]


def test_a_line_that_the_system_takes_in_parts_is_whole(tmp_path, monkeypatch):
    writer = JournalWriter(tmp_path, name="gw0")
    with writer._file as file:
        monkeypatch.setattr(writer, "_file", SimpleNamespace(write=lambda data: file.write(data[:7])))
        for event in EVENTS:
            writer(event)
    assert JournalReader(tmp_path).read() == EVENTS
