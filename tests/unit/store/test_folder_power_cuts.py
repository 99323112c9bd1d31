"""Wherever the power goes: a record is there whole or not at all, and one that was finished is there."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from failing_power import Operation, Recorder, Tree, after_a_cut, lay_out
from result_factory import make_result

from pytest_drive_robust.store import whole_file
from pytest_drive_robust.store.folder import FolderStore

PUTS = (("aa01", 1.0), ("aa02", 2.0), ("bb01", 3.0), ("aa01", 4.0))
"""Keys, and the seconds by which one knows what was stored; the last one replaces the first."""
PROJECT, STORE = Path("project"), Path("project/kept/.drive-robust")
EMPTY: Tree = {PROJECT: None}
SHARED: Tree = {PROJECT: None, Path("project/kept"): None, STORE: None, STORE / "notes.txt": b"mine"}

pytestmark = pytest.mark.skipif(os.name == "nt", reason="folders cannot be synced there")


def recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, start: Tree) -> list[Operation]:
    """Everything that happens to the disk while `PUTS` are stored, paths from the root of the disk."""
    disk = tmp_path / "disk"
    disk.mkdir()
    lay_out(start, disk)
    recorder = Recorder(disk)
    monkeypatch.setattr(whole_file, "os", recorder)
    monkeypatch.setattr(Path, "mkdir", lambda path, **options: recorder.mkdir(path, **options))
    for number, (key, wall_s) in enumerate(PUTS):
        recorder.note("begun", number)
        FolderStore(disk / STORE, run=f"run {number}").put(key, replace(make_result(key), wall_s=wall_s))
        recorder.note("returned", number)
    monkeypatch.undo()
    return [
        tuple(item.relative_to(disk) if isinstance(item, Path) else item for item in operation)
        for operation in recorder.operations
    ]


def complaints(operations: Sequence[Operation], start: Tree, folder: Path) -> list[str]:
    """What is wrong after a cut at some moment; nothing, where the promise is kept."""
    found: list[str] = []
    seen: set[object] = set()
    for count in range(len(operations) + 1):
        begun = [number for kind, number, *_ in operations[:count] if kind == "begun"]
        returned = [number for kind, number, *_ in operations[:count] if kind == "returned"]
        for tree in after_a_cut(operations[:count], start):
            fingerprint = (tuple(begun), tuple(returned), frozenset(tree.items()))
            if fingerprint not in seen:
                seen.add(fingerprint)
                found += looked_at(tree, begun, returned, folder)
    return found


def looked_at(tree: Tree, begun: list[int], returned: list[int], folder: Path) -> list[str]:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    lay_out(tree, folder)
    store = FolderStore(folder / STORE, run="later")
    found = []
    for key in {key for key, _ in PUTS}:
        result = store.get(key)
        finished = [number for number in returned if PUTS[number][0] == key]
        allowed = {PUTS[number][1] for number in begun if PUTS[number][0] == key and number >= max(finished, default=0)}
        if result is None and finished:
            found.append(f"{key} is lost")
        if result is not None and result.wall_s not in allowed:
            found.append(f"{key} is {result.wall_s}")
    return [*found, *(f"damaged: {problem}" for problem in store.problems())]


@pytest.mark.parametrize("start", [EMPTY, SHARED], ids=["new folder", "folder with other things"])
def test_after_a_power_cut_at_any_moment_a_record_is_whole_or_absent(tmp_path, monkeypatch, start):
    operations = recorded(tmp_path, monkeypatch, start)
    assert {kind for kind, *_ in operations} >= {"name", "bytes", "keep file", "rename", "keep names"}
    assert len(operations) > 30
    assert complaints(operations, start, tmp_path / "after") == []


@pytest.mark.parametrize(("without", "complaint"), [("keep file", "damaged"), ("keep names", "is lost")])
def test_a_store_that_did_not_sync_would_be_found_out(tmp_path, monkeypatch, without, complaint):
    operations = [one for one in recorded(tmp_path, monkeypatch, SHARED) if one[0] != without]
    if without == "keep names":  # with no end of what may be missing: the first record is enough
        operations = operations[: operations.index(("returned", 0)) + 1]
    assert any(complaint in told for told in complaints(operations, SHARED, tmp_path / "after"))
