from __future__ import annotations

import os
from dataclasses import replace

import pytest
from result_factory import make_result

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.store.folder import FolderStore
from pytest_drive_robust.store.reuse import is_reusable

KEY = "abcdef0123456789"

TIMED_OUT = make_result(end=End.BLOCKED, outcome=Outcome.AGENT_ERROR)

RAISED = make_result(end=End.AGENT_CRASHED)

OURS = make_result(end=End.SIMULATION_CRASHED)


def test_nothing_is_made_before_something_is_stored(tmp_path):
    store = FolderStore(tmp_path / "store")
    assert store.get(KEY) is None
    assert not (tmp_path / "store").exists()
    store.put(KEY, make_result())
    names = {path.relative_to(tmp_path / "store").as_posix() for path in (tmp_path / "store").rglob("*")}
    assert names == {"episodes", "episodes/ab", f"episodes/ab/{KEY}.episode", ".gitignore", "CACHEDIR.TAG"}
    assert (tmp_path / "store" / ".gitignore").read_text() == "*\n"
    assert (tmp_path / "store" / "CACHEDIR.TAG").read_text().startswith("Signature: 8a477f597d28d172789f06886806bc55")


def test_a_folder_with_other_things_in_it_is_not_hidden_from_git(tmp_path):
    (tmp_path / "results.csv").write_text("mine")
    FolderStore(tmp_path).put(KEY, make_result())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["episodes", "results.csv"]


def test_what_is_missing_is_looked_for_again_each_time(tmp_path):
    one, other = FolderStore(tmp_path, run="r"), FolderStore(tmp_path, run="r")
    assert one.get(KEY) is None
    other.put(KEY, make_result())
    assert one.get(KEY) is not None


@pytest.mark.parametrize(
    ("result", "reused"),
    [
        (make_result(), True),
        (make_result(end=End.AGENT_CRASHED, end_detail="act raised ValueError: no lane (mine.py:3 in act)"), True),
        (make_result(end=End.AGENT_CRASHED, end_detail="act raised MemoryError"), False),
        (
            make_result(
                end=End.AGENT_CRASHED,
                end_detail="act raised RuntimeError: DefaultCPUAllocator: can't allocate memory: you tried to allocate "
                "4096 bytes. Error code 12 (Cannot allocate memory)",
            ),
            False,
        ),
        (
            make_result(
                end=End.AGENT_CRASHED,
                end_detail="act raised cv2.error: error: (-4:Insufficient memory) Failed to allocate 4096 bytes in "
                "function 'OutOfMemoryError'",
            ),
            False,
        ),
        (
            make_result(end=End.AGENT_CRASHED, end_detail="torch.OutOfMemoryError: CUDA out of memory"),
            False,
        ),
        (
            make_result(
                end=End.AGENT_CRASHED,
                end_detail="act raised RuntimeError: CUDA error: CUBLAS_STATUS_ALLOC_FAILED when calling cublasCreate",
            ),
            False,
        ),
        (
            make_result(end=End.AGENT_CRASHED, end_detail="OSError: [Errno 28] No space left on device"),
            False,
        ),
        (
            make_result(end=End.AGENT_CRASHED, end_detail="OSError: [Errno 122] Disk quota exceeded"),
            False,
        ),
        (
            make_result(end=End.AGENT_CRASHED, end_detail="act raised OSError: [Errno 24] Too many open files: 'map'"),
            False,
        ),
        (
            make_result(end=End.AGENT_CRASHED, end_detail="act raised RuntimeError: can't start new thread"),
            False,
        ),
        (
            make_result(end=End.AGENT_CRASHED, end_detail="[Errno 11] Resource temporarily unavailable"),
            False,
        ),
        (make_result(end=End.TICK_CAP), True),
        (RAISED, True),
        (TIMED_OUT, False),
        (OURS, False),
    ],
    ids=[
        "completed",
        "explained",
        "memory",
        "memory by torch",
        "memory by OpenCV",
        "memory of a GPU",
        "memory by cuBLAS",
        "disk",
        "quota",
        "files",
        "threads",
        "processes",
        "failed",
        "raised",
        "timed out",
        "our fault",
    ],
)
def test_what_another_run_drove_counts_when_driving_again_would_give_the_same(result, reused, tmp_path):
    assert is_reusable(result) is reused
    FolderStore(tmp_path, run="first").put(KEY, result)
    assert FolderStore(tmp_path, run="first").get(KEY) is not None
    assert (FolderStore(tmp_path, run="second").get(KEY) is not None) is reused
    assert FolderStore(tmp_path, run="second", fresh=True).get(KEY) is None
    assert FolderStore(tmp_path, run="first", fresh=True).get(KEY) is not None


def test_what_could_not_be_reused_is_replaced_and_seen_by_who_waited(tmp_path):
    FolderStore(tmp_path, run="first").put(KEY, OURS)
    waiting, driving = FolderStore(tmp_path, run="second"), FolderStore(tmp_path, run="second")
    assert waiting.get(KEY) is None
    assert waiting.get(KEY) is None
    driving.put(KEY, make_result())
    assert waiting.get(KEY).outcome is Outcome.COMPLETED


@pytest.mark.parametrize("late", [TIMED_OUT, OURS], ids=["timed out", "our fault"])
def test_what_may_be_the_machines_doing_replaces_no_whole_drive_and_its_own_run_sees_it_all_the_same(tmp_path, late):
    folder, spill = tmp_path / "store", tmp_path / "spill"
    FolderStore(folder, run="first").put(KEY, make_result())
    for fresh in (True, False):
        store = FolderStore(folder, run="second", fresh=fresh, spill=spill)
        store.put(KEY, late)
        beside = FolderStore(folder, run="second", fresh=fresh, spill=spill)
        assert store.get(KEY).outcome is beside.get(KEY).outcome is late.outcome
        assert store.problems() == ()
    assert FolderStore(folder, run="third").get(KEY).outcome is Outcome.COMPLETED
    FolderStore(folder, run="fourth").put(KEY, make_result(end=End.TICK_CAP))
    assert FolderStore(folder, run="fifth").get(KEY).end is End.TICK_CAP


def test_what_may_be_the_machines_doing_replaces_a_damaged_record(tmp_path):
    FolderStore(tmp_path, run="first").put(KEY, make_result())
    path = tmp_path / "episodes" / "ab" / f"{KEY}.episode"
    path.write_bytes(path.read_bytes()[:-1])
    FolderStore(tmp_path, run="second").put(KEY, OURS)
    assert FolderStore(tmp_path, run="second").get(KEY).outcome is Outcome.INFRA_ERROR


def test_a_record_under_a_wrong_name_is_damaged(tmp_path):
    store = FolderStore(tmp_path)
    store.put(KEY, make_result())
    other = KEY[:-1] + "a"
    os.rename(store._files.path(KEY), store._files.path(other))
    fresh = FolderStore(tmp_path)
    assert fresh.get(other) is None
    assert fresh.get(other) is None
    (problem,) = fresh.problems()
    assert f"is damaged: it is the record of '{KEY}'. It was moved to" in problem
    assert [path.name for path in (tmp_path / "aside").iterdir()] == [f"{other}.episode"]


def test_a_damaged_record_is_set_aside_told_once_and_driven_again(tmp_path):
    for number in (1, 2):
        FolderStore(tmp_path).put(KEY, make_result(str(number)))
        path = tmp_path / "episodes" / "ab" / f"{KEY}.episode"
        path.write_bytes(path.read_bytes()[:-1])
        store = FolderStore(tmp_path)
        assert store.get(KEY) is None
        assert store.get(KEY) is None
        (problem,) = store.problems()
        assert "is damaged: its checksum does not fit" in problem
        assert problem.endswith("the episode is driven again.")
        store.put(KEY, make_result("9"))
        assert FolderStore(tmp_path).get(KEY).episode.route_id == "9"
    names = sorted(path.name for path in (tmp_path / "aside").iterdir())
    assert names == [f"{KEY}.2.episode", f"{KEY}.episode"]


def test_a_record_of_a_later_version_stays_where_it_is(tmp_path, monkeypatch):
    from pytest_drive_robust.store import record

    monkeypatch.setattr(record, "FORMAT_VERSION", 99)
    FolderStore(tmp_path).put(KEY, make_result())
    monkeypatch.undo()
    store = FolderStore(tmp_path)
    assert store.get(KEY) is None
    assert store.problems() == ()
    assert (tmp_path / "episodes" / "ab" / f"{KEY}.episode").exists()


def test_numbers_of_a_stored_result_are_those_that_were_put(tmp_path):
    result = replace(make_result("1"), wall_s=0.1 + 0.2)
    FolderStore(tmp_path).put(KEY, result)
    back = FolderStore(tmp_path).get(KEY)
    assert replace(back, trace=result.trace) == result
    assert back.trace.rows.tobytes() == result.trace.rows.tobytes()


@pytest.mark.parametrize("then_s", [0.0, 4e9], ids=["1970", "2096"])
def test_the_dates_of_files_decide_nothing(tmp_path, then_s, monkeypatch):
    FolderStore(tmp_path, run="first").put(KEY, make_result("1"))
    FolderStore(tmp_path, run="first").put("aa01", OURS)
    for path in tmp_path.rglob("*"):
        os.utime(path, (then_s, then_s))
    monkeypatch.setattr("time.time", lambda: -then_s)
    waiting, store = FolderStore(tmp_path, run="second"), FolderStore(tmp_path, run="second")
    assert store.get(KEY).episode.route_id == "1"
    assert waiting.get("aa01") is None
    with store.claim("aa01"):
        store.put("aa01", make_result("2"))
        os.utime(tmp_path / "episodes" / "aa" / "aa01.episode", (then_s, then_s))
        assert waiting.claim("aa01") is None
    assert waiting.get("aa01").episode.route_id == "2"
