from __future__ import annotations

import os
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from result_factory import make_result

from pytest_drive_robust.cli.main import main
from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.store import maintenance, record
from pytest_drive_robust.store.folder import FolderStore
from pytest_drive_robust.store.index import indexed_episodes
from pytest_drive_robust.store.maintenance import set_aside, statistics, sweep, verify
from pytest_drive_robust.store.packing import StoredTrace, pack
from pytest_drive_robust.store.record import encode_episode
from pytest_drive_robust.store.record_files import RecordFiles


def age(path: Path, days: float) -> None:
    then_s = time.time() - days * 86_400
    os.utime(path, (then_s, then_s))


def run_cli(store, *words):
    return main(["store", *words, "--store", str(store.folder)])


def test_statistics_count_records_by_agent_and_outcome(store):
    found = statistics(store.folder)
    assert (found.records, found.reusable, found.runs, found.unreadable, found.set_aside) == (4, 3, 1, 0, 0)
    assert found.by_agent == {
        ("driver", "agent_error"): 1,
        ("driver", "completed"): 1,
        ("driver", "failed"): 1,
        ("other", "completed"): 1,
    }
    assert found.size_bytes == sum(path.stat().st_size for path in store.folder.glob("episodes/*/*"))


@pytest.mark.parametrize(("told", "reusable"), [("act raised ValueError: no lane", 4), ("act raised MemoryError", 3)])
def test_statistics_count_what_was_raised_for_lack_of_memory_as_driven_again(store, told, reusable):
    broke = make_result(outcome=Outcome.AGENT_ERROR, end=End.AGENT_CRASHED, end_detail=told)
    RecordFiles(store.folder).write("dd01", encode_episode(broke, {"key": "dd01", "run": "r"}))
    found = statistics(store.folder)
    assert (found.records, found.reusable) == (5, reusable)


def test_a_store_without_records_has_no_statistics(tmp_path):
    assert statistics(tmp_path).records == 0


def test_every_kind_of_damage_is_found_and_nothing_is_changed(store):
    files = RecordFiles(store.folder)
    whole = files.path("aa01").read_bytes()
    files.path("aa01").write_bytes(whole[:-7])
    files.path("aa02").write_bytes(b"")
    files.path("bb01").write_bytes(whole)
    files.write("cc01", encode_episode(make_result(), {"key": "cc01"}))
    count, damages = verify(store.folder)
    assert count == 5
    assert {damage.key: damage.problem for damage in damages} == {
        "aa01": "its checksum does not fit: it was cut off or overwritten",
        "aa02": "it is empty",
        "bb01": "it is the record of 'aa01'",
    }
    assert verify(store.folder) == (count, damages)


def test_sweeping_removes_what_no_run_reads_and_keeps_the_rest(store):
    files = RecordFiles(store.folder)
    half, fresh_half = (store.folder / "episodes" / "aa" / name for name in (".aa05-1-x.tmp", ".aa06-1-x.tmp"))
    half.write_bytes(b"123")
    fresh_half.write_bytes(b"123")
    (store.folder / "aside").mkdir()
    (store.folder / "aside" / "aa09.episode").write_bytes(b"12345")
    age(half, 2)
    mine = store.folder / ".mine.tmp"
    mine.touch()
    age(mine, 2)
    for name in (".now-1.tmp", "..gitignore-1-0a.tmp", ".CACHEDIR-1-0a.tmp"):
        (store.folder / name).touch()
    assert sweep(store.folder, dry=True).leftovers == 1  # those at the root are of today
    for name in (".now-1.tmp", "..gitignore-1-0a.tmp", ".CACHEDIR-1-0a.tmp"):
        age(store.folder / name, 2)
    assert sweep(store.folder, dry=True).leftovers == 4
    assert sweep(store.folder).records == 0  # bb02 is of today
    (store.folder / "aside" / "aa09.episode").write_bytes(b"12345")
    half.write_bytes(b"123")
    age(half, 2)
    age(files.path("bb02"), 2)
    size = files.path("bb02").stat().st_size
    for dry in (True, False):
        swept = sweep(store.folder, dry=dry)
        assert (swept.records, swept.damaged, swept.leftovers, swept.size_bytes) == (1, 1, 1, size + 8)
    assert [path.name for path in sorted(store.folder.glob("episodes/*/*"))] == [
        ".aa06-1-x.tmp",
        "aa01.episode",
        "aa02.episode",
        "bb01.episode",
    ]
    assert list((store.folder / "aside").iterdir()) == []
    assert list(store.folder.glob("*.tmp")) == [mine]


def test_sweeping_takes_old_records_and_those_of_an_agent_when_asked(store):
    files = RecordFiles(store.folder)
    age(files.path("aa01"), 40)
    age(files.path("bb01"), 40)
    assert sweep(store.folder, older_than_s=30 * 86_400.0, agents=["other"], dry=True).records == 1
    assert sweep(store.folder, older_than_s=30 * 86_400.0, agents=["driver"], dry=True).records == 1
    assert sweep(store.folder, older_than_s=30 * 86_400.0, dry=True).records == 2
    assert sweep(store.folder, agents=["driver"]).records == 3
    assert [row.agent for row in indexed_episodes(files)] == ["other"]


def test_a_record_that_is_claimed_stays(store):
    with store.claim("aa01"):
        sweep(store.folder, agents=["driver"])
        assert [row.key for row in indexed_episodes(RecordFiles(store.folder))] == ["aa01", "bb01"]


def test_a_record_that_another_run_replaced_since_it_was_looked_at_stays(store, monkeypatch):
    path = RecordFiles(store.folder).path("bb02")
    age(path, 2)
    look = maintenance._lying_aside

    def meanwhile(folder):
        """What `sweep` asks for next: another run finishes that episode and gives its claim back."""
        other = FolderStore(folder, run="two")
        with other.claim("bb02"):
            other.put("bb02", make_result("3"))
        return look(folder)

    monkeypatch.setattr(maintenance, "_lying_aside", meanwhile)
    assert sweep(store.folder).records == 0
    assert FolderStore(store.folder, run="three").get("bb02").outcome is Outcome.COMPLETED


def test_a_run_of_half_a_day_ago_may_still_read_what_no_other_reuses(store):
    age(RecordFiles(store.folder).path("bb02"), 0.5)
    assert sweep(store.folder).records == 0
    age(RecordFiles(store.folder).path("bb02"), 1.1)
    assert sweep(store.folder).records == 1


def test_the_age_of_a_record_is_by_the_clock_that_dated_it(store, monkeypatch):
    monkeypatch.setattr(maintenance, "time", SimpleNamespace(time=lambda: 4e9))
    assert sweep(store.folder, older_than_s=86_400.0).records == 0


def test_a_trace_that_is_not_the_one_that_its_header_tells_of_is_damaged(store):
    result = make_result()
    trace = StoredTrace(packed=pack(result.trace.rows), ticks=len(result.trace.rows), digest="another")
    RecordFiles(store.folder).write("cc01", encode_episode(replace(result, trace=trace), {"key": "cc01"}))
    _, (damage,) = verify(store.folder)
    assert (damage.key, damage.problem) == ("cc01", "its trace is not the one that its header tells of")


def test_a_record_of_a_later_version_is_not_set_aside(store, monkeypatch):
    files = RecordFiles(store.folder)
    files.path("aa01").write_bytes(b"")
    with monkeypatch.context() as later:
        later.setattr(record, "FORMAT_VERSION", 9)
        store.put("aa02", make_result())
    _, damages = verify(store.folder)
    assert [(damage.key, damage.later_version) for damage in damages] == [("aa01", False), ("aa02", True)]
    assert set_aside(store.folder, damages) == 1
    assert [files.path(key).is_file() for key in ("aa01", "aa02")] == [False, True]


def test_sweeping_removes_damaged_records_that_no_run_met_and_none_of_a_later_version(store, monkeypatch):
    files = RecordFiles(store.folder)
    with monkeypatch.context() as later:
        later.setattr(record, "FORMAT_VERSION", 9)
        store.put("aa02", make_result())
    files.path("aa01").write_bytes(b"12345")
    for dry in (True, False):
        swept = sweep(store.folder, dry=dry)
        assert (swept.records, swept.damaged, swept.size_bytes) == (0, 1, 5)
        assert files.path("aa01").is_file() is dry
    assert [damage.key for damage in verify(store.folder)[1]] == ["aa02"]


def test_old_records_of_another_version_go_with_the_other_old_ones(store, monkeypatch, capsys):
    files = RecordFiles(store.folder)
    with monkeypatch.context() as other:
        other.setattr(record, "FORMAT_VERSION", 0)
        for key in ("aa01", "aa02"):
            store.put(key, make_result())
    age(files.path("aa01"), 40)
    old = ("gc", "--older-than", "30d")
    assert run_cli(store, *old, "--agent", "driver") == run_cli(store, "gc") == 0
    assert files.path("aa01").is_file(), "whose it is, this version cannot tell"
    capsys.readouterr()
    assert run_cli(store, *old) == 0
    assert "removed 1 episode, 0 damaged records" in capsys.readouterr().out
    assert [files.path(key).is_file() for key in ("aa01", "aa02")] == [False, True]


def test_a_record_that_a_run_has_replaced_since_it_was_found_damaged_is_not_set_aside(store):
    files = RecordFiles(store.folder)
    files.path("aa01").write_bytes(b"")
    _, damages = verify(store.folder)
    assert [damage.key for damage in damages] == ["aa01"]
    FolderStore(store.folder, run="two").put("aa01", make_result("3"))
    assert set_aside(store.folder, damages) == 0
    assert FolderStore(store.folder, run="three").get("aa01").episode.route_id == "3"


def test_a_record_that_goes_while_others_are_read_is_not_damaged(store, monkeypatch):
    read = RecordFiles.read

    def meanwhile(self, key):
        """Another command removes the next one."""
        self.path("bb01").unlink(missing_ok=True)
        return read(self, key)

    monkeypatch.setattr(RecordFiles, "read", meanwhile)
    assert verify(store.folder)[1] == ()


def test_a_clock_of_the_future_makes_nothing_old(store):
    age(RecordFiles(store.folder).path("bb02"), -400)
    assert sweep(store.folder, older_than_s=0.0, agents=["nobody"]).records == 0


def test_the_command_tells_what_is_there(store, capsys):
    (store.folder / "aside").mkdir()
    (store.folder / "aside" / "x.episode").write_bytes(b"")
    assert run_cli(store, "stats") == 0
    told = capsys.readouterr().out
    assert "4 episodes" in told
    assert "1 ended in timeouts, crashes or errors of the simulator: other runs drive them again" in told
    assert "aside: 1" in told
    assert [line.split() for line in told.splitlines()[1:4]] == [
        ["agent", "agent_error", "completed", "failed"],
        ["driver", "1", "1", "1"],
        ["other", "0", "1", "0"],
    ]


def test_the_command_verifies_and_sets_aside(store, capsys):
    assert run_cli(store, "verify") == 0
    path = RecordFiles(store.folder).path("aa01")
    path.write_bytes(path.read_bytes()[:-1])
    assert run_cli(store, "verify") == 1
    told = capsys.readouterr().out
    assert f"{path}: its checksum does not fit" in told
    assert "4 episodes, 1 damaged" in told
    (store.folder / "aside").touch()
    assert run_cli(store, "verify", "--fix") == 1
    assert "0 moved to" in capsys.readouterr().out
    (store.folder / "aside").unlink()
    assert run_cli(store, "verify", "--fix") == 0
    assert not path.exists()
    assert run_cli(store, "verify") == 0


def test_a_record_that_the_disk_does_not_give_is_told_and_stays(store, capsys):
    files = RecordFiles(store.folder)
    path = files.path("aa01")
    path.unlink()
    path.mkdir()  # as root, whom no rights keep out, a folder is what cannot be read
    files.path("aa02").write_bytes(b"")
    assert run_cli(store, "verify", "--fix") == 1
    told = capsys.readouterr().out
    assert f"{path}: it cannot be read: Is a directory" in told
    assert "4 episodes, 1 damaged, 1 that could not be read" in told
    assert "1 moved to" in told
    assert path.is_dir()
    assert run_cli(store, "verify") == 1
    assert "3 episodes, 0 damaged, 1 that could not be read" in capsys.readouterr().out


def test_the_command_sweeps_what_it_is_told_to(store, capsys):
    assert run_cli(store, "gc", "--agent", "other", "--dry-run") == 0
    assert "would remove 1 episode, 0 damaged records and 0 leftovers" in capsys.readouterr().out
    assert run_cli(store, "gc", "--agent", "other") == 0
    assert "removed 1 episode," in capsys.readouterr().out
    assert statistics(store.folder).records == 3
    assert run_cli(store, "gc", "--agent", "drivr") == 4
    assert "Did you mean 'driver'" in capsys.readouterr().err


def test_only_what_is_gone_is_reported_as_removed(store, capsys, monkeypatch):
    def refuses(path, missing_ok=False):
        raise PermissionError(13, "Permission denied", str(path))

    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", refuses)
        assert run_cli(store, "gc", "--agent", "other") == 1
    told = capsys.readouterr().out
    assert "removed 0 episodes, 0 damaged records and 0 leftovers of processes that died, 0.0 MB" in told
    assert "1 file could not be removed, first " in told
    assert "Permission denied" in told
    assert statistics(store.folder).records == 4


@pytest.mark.parametrize("what", ["stats", "verify", "gc"])
def test_a_folder_of_other_things_is_no_store(tmp_path, capsys, what):
    (tmp_path / "aside").mkdir()
    mine = tmp_path / "aside" / "mine.txt"
    mine.write_text("kept")
    assert main(["store", what, "--store", str(tmp_path)]) == 4
    assert "is not a store: it has no folder 'episodes'" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["aside"]
    (tmp_path / "episodes").mkdir()
    assert main(["store", what, "--store", str(tmp_path)]) == 0
    assert mine.read_text() == "kept"


def test_an_empty_folder_is_a_store_without_episodes_and_stays_empty(tmp_path, capsys):
    for what in ("stats", "verify", "gc", "stats"):
        assert main(["store", what, "--store", str(tmp_path)]) == 0
    assert f"{tmp_path}: 0 episodes, 0.0 MB, 0 s of driving, 0 runs" in capsys.readouterr().out
    assert list(tmp_path.iterdir()) == []


def test_the_command_finds_the_store_above_and_refuses_none(store, capsys, monkeypatch):
    below = store.folder.parent / "a" / "b"
    below.mkdir(parents=True)
    monkeypatch.chdir(below)
    assert main(["store", "stats"]) == 0
    assert "4 episodes" in capsys.readouterr().out
    assert main(["store", "stats", "--store", "nowhere"]) == 4
    assert "there is no store 'nowhere'" in capsys.readouterr().err
    assert main(["store", "gc", "--older-than", "soon"]) == 4
    assert "--older-than is 'soon', expected a time such as 90s, 20m or 1.5h" in capsys.readouterr().err
    assert main(["store", "gc", "--agent", "driver", "--older-than", ""]) == 4  # or all of it would go
    assert "--older-than is empty, expected TIME: also remove records older than this" in capsys.readouterr().err
