from __future__ import annotations

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


def test_a_line_whose_writer_died_is_left_out(tmp_path):
    writer = JournalWriter(tmp_path, name="gw0")
    writer(EVENTS[0])
    writer.close()
    with (tmp_path / "journals" / "gw0.jsonl").open("ab") as file:
        file.write(b'{"event": "Finished", "key": "a')
    assert JournalReader(tmp_path).read() == EVENTS[:1]
