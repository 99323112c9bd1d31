"""What is missing is compiled, in processes or here; what they leave in the cache is loaded."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import filelock
import numba
import numpy as np
import pytest

from pytest_drive_robust.jit import compile_all
from pytest_drive_robust.jit.arrays import Floats1
from pytest_drive_robust.jit.cache import cache_folder
from pytest_drive_robust.jit.entry_groups import group_entries
from pytest_drive_robust.jit.kernels import entry, inner


@inner
def doubled(x: float) -> float:
    return 2.0 * x


@inner
def squared(x: float) -> float:
    return x * x


def kernels() -> list[object]:
    """Three entry points, two of which share a part; none is compiled."""

    def first(row: Floats1) -> float:
        return doubled(row[0]) + squared(row[0])

    def second(row: Floats1) -> float:
        return squared(row[1])

    def apart(row: Floats1) -> float:
        return row[0] + row[1]

    return [entry(function) for function in (first, second, apart)]


@pytest.fixture
def some(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[object]]:
    """Kernels that are the only ones there are, with a cache of their own."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    only: list[object] = []
    monkeypatch.setattr("pytest_drive_robust.jit.kernels.ENTRIES", only)
    monkeypatch.setattr(compile_all, "ENTRIES", only)
    kernels()
    return only


def values(some: list[object]) -> list[float]:
    return [kernel(np.array((3.0, 4.0))) for kernel in some]  # type: ignore[operator]


def from_cache(some: list[object]) -> list[int]:
    return [len(kernel.stats.cache_hits) for kernel in some]  # type: ignore[attr-defined]


@pytest.mark.parametrize("processes", [1, 2])
def test_what_is_missing_is_compiled_and_counted(
    some: list[object], processes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    if processes > 1:
        if sys.platform != "linux":
            pytest.skip("forks")
        monkeypatch.setattr(compile_all, "_may_fork", lambda: True)
    told: list[tuple[int, int]] = []
    assert compile_all.missing_functions() == 5
    assert compile_all.compile_all(processes=processes, tell=lambda *counted: told.append(counted)) == 3
    assert told[0] == (0, 5)
    assert told[-1] == (5, 5)
    assert told == sorted(told)
    assert from_cache(some) == ([0, 0, 0] if processes == 1 else [1, 1, 1])
    assert values(some) == [15.0, 16.0, 7.0]
    assert compile_all.missing_functions() == 0


@pytest.mark.skipif(sys.platform != "linux", reason="forks")
@pytest.mark.parametrize("processes", [1, 2])
def test_what_is_needed_first_is_there_before_the_rest(
    some: list[object], processes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compile_all, "_may_fork", lambda: True)
    told: list[tuple[int, int]] = []
    begun = compile_all.Compilation(some[2:], processes=processes, tell=lambda *counted: told.append(counted))
    assert from_cache(some[2:]) == [1]
    assert begun.missing == 3
    assert set(told) >= {(0, 1), (1, 1)}
    assert begun.progress_fd is not None
    assert len(begun.children) == processes
    while begun.progress_fd is not None:
        begun.read_progress()
    assert told[-1] == (4, 4)
    assert from_cache(some) == [1, 1, 1]
    assert values(some) == [15.0, 16.0, 7.0]


def test_where_nothing_can_be_written_no_process_compiles_in_vain(
    some: list[object], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compile_all, "_may_fork", lambda: True)
    monkeypatch.setattr(compile_all.os, "access", lambda path, mode: False)
    begun = compile_all.Compilation(some[2:], processes=2)
    assert begun.children == []
    assert begun.progress_fd is None
    assert values(some) == [15.0, 16.0, 7.0]


def test_what_is_in_the_cache_is_loaded_and_nothing_told(some: list[object]) -> None:
    compile_all.compile_all(processes=1)
    some.clear()
    kernels()
    told: list[tuple[int, int]] = []
    assert compile_all.compile_all(processes=2, tell=lambda *counted: told.append(counted)) == 0
    assert told == []
    assert from_cache(some) == [1, 1, 1]


def test_entry_points_that_share_a_part_are_compiled_by_one_process(some: list[object]) -> None:
    names = [[kernel.__name__ for kernel in group] for group in group_entries(some)]
    assert names == [["first", "second"], ["apart"]]


def test_a_process_with_threads_does_not_fork() -> None:
    over = threading.Event()
    thread = threading.Thread(target=over.wait)
    thread.start()
    try:
        assert not compile_all._may_fork()
    finally:
        over.set()
        thread.join()


def test_where_nothing_can_be_written_all_is_compiled_here(some: list[object], tmp_path: Path) -> None:
    (tmp_path / "pytest-drive-robust").write_text("a file, where the folder should be")
    assert not cache_folder().is_dir()
    assert compile_all.compile_all(processes=1) == 3
    assert values(some) == [15.0, 16.0, 7.0]


@pytest.mark.parametrize("goes_on", [True, False], ids=["the other ends", "the other hangs"])
def test_another_process_that_compiles_is_named_and_not_waited_for_without_end(
    some: list[object], goes_on: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(compile_all, "_LOCK_TRY_S", 0.1)
    monkeypatch.setattr(compile_all, "_LOCK_WAIT_S", 600.0 if goes_on else 0.3)
    cache_folder().mkdir(parents=True)
    other = filelock.FileLock(cache_folder() / "compiling.lock")
    told: list[tuple[int, int]] = []

    def tell(done: int, total: int) -> None:
        told.append((done, total))
        if goes_on:
            other.release()

    with other:
        assert compile_all.compile_all(processes=1, tell=tell) == 3
    said = capsys.readouterr().err
    assert said.count("another process compiles for the cache") == 1
    assert str(cache_folder()) in said
    assert ("compiling without it" in said) is not goes_on
    assert told[0] == (0, 5)
    assert values(some) == [15.0, 16.0, 7.0]
