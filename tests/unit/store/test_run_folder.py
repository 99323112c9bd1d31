from __future__ import annotations

import subprocess
import sys
import threading

import pytest
from result_factory import make_result

from pytest_drive_robust.store.base import MemoryStore
from pytest_drive_robust.store.claims import Claims
from pytest_drive_robust.store.events import Asked, Finished, Judged, Planned, Started
from pytest_drive_robust.store.folder import FolderStore
from pytest_drive_robust.store.journal import JournalReader, JournalWriter

KEYS = ("a", "b", "c", "d")


def drive(store, keys):
    order = []
    for key in store.missing(keys):
        order.append(key)
        store.put(key, make_result(key))
    return order


@pytest.mark.parametrize("make", [lambda _: MemoryStore(), FolderStore], ids=["memory", "folder"])
def test_a_store_asks_for_what_is_missing_and_keeps_it(make, tmp_path):
    store = make(tmp_path)
    assert drive(store, ("a",)) == ["a"]
    assert drive(store, KEYS) == ["b", "c", "d"]
    assert drive(store, KEYS) == []
    assert store.get("c").episode.route_id == "c"
    assert store.get("z") is None


def test_workers_begin_at_different_episodes(tmp_path):
    assert drive(FolderStore(tmp_path, offset=0.5), KEYS) == ["c", "d", "a", "b"]


def test_what_another_process_holds_is_left_for_later(tmp_path):
    first, second = FolderStore(tmp_path), FolderStore(tmp_path)
    busy = first.missing(KEYS)
    assert next(busy) == "a"
    others = second.missing(KEYS)
    for expected in ("b", "c", "d"):
        assert next(others) == expected
        second.put(expected, make_result(expected))
    first.put("a", make_result("a"))
    assert next(busy, None) is None
    assert next(others, None) is None


def test_who_waits_goes_on_when_the_other_is_done(tmp_path):
    first, second = FolderStore(tmp_path), FolderStore(tmp_path)
    busy = first.missing(("a",))
    next(busy)
    waiting = threading.Thread(target=lambda: drive(second, ("a",)))
    waiting.start()
    first.put("a", make_result("a"))
    next(busy, None)
    waiting.join(timeout=10.0)
    assert not waiting.is_alive()


def test_a_claim_that_is_given_back_can_be_taken(tmp_path):
    first, second = FolderStore(tmp_path), FolderStore(tmp_path)
    broken = first.missing(("a",))
    next(broken)
    broken.close()
    assert drive(second, ("a",)) == ["a"]


def test_the_claims_of_a_killed_process_are_free(tmp_path):
    holder = (
        "import sys, time; from pathlib import Path; from pytest_drive_robust.store.claims import Claims\n"
        "with Claims(Path(sys.argv[1])).attempt('a') as ours:\n"
        "    print(ours, flush=True)\n"
        "    time.sleep(60)\n"
    )
    claims = Claims(tmp_path)
    command = [sys.executable, "-c", holder, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "True\n"
        with claims.attempt("a") as ours:
            assert not ours
        process.kill()
    with claims.attempt("a") as ours:
        assert ours


EVENTS = [
    Planned(("a", "b")),
    Asked("driver", "two", "clean", (0, 1), ("a", "b"), ()),
    Started("a", "driver", "clean", "1 Straight"),
    Finished("a", 0.5),
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
