"""Machine code is taken from the cache for the same text only: own code, what it calls, every constant in there."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numba
import pytest
from numba.core.registry import cpu_target

from pytest_drive_robust.jit.cache import KernelCache, cache_folder
from pytest_drive_robust.jit.content import content_digest
from pytest_drive_robust.jit.kernels import ENTRIES
from pytest_drive_robust.jit.signatures import numba_type

TEXT = """
import numpy as np
from pytest_drive_robust.jit.arrays import Floats1
from pytest_drive_robust.jit.kernels import entry, inner
import other

FACTOR = 2.0
TABLE = np.array((1.0, 2.0))

@inner
def part(x: float) -> float:
    return FACTOR * x + other.OFFSET

@entry
def whole(row: Floats1) -> float:
    return part(row[0]) + TABLE[1]
"""


def written(folder: Path, text: str = TEXT, offset: str = "10.0") -> ModuleType:
    """A module of kernels in a folder of its own."""
    folder.mkdir()
    (folder / "other.py").write_text(f"OFFSET = {offset}\n")
    (folder / "some.py").write_text(text)
    modules = {}
    for name in ("other", "some"):
        spec = importlib.util.spec_from_file_location(name, folder / f"{name}.py")
        assert spec is not None
        assert spec.loader is not None
        modules[name] = sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(modules[name])
    return modules["some"]


@pytest.fixture(autouse=True)
def _forget() -> object:
    count = len(ENTRIES)
    yield
    del ENTRIES[count:]
    for name in ("other", "some"):
        sys.modules.pop(name, None)


def test_equal_text_elsewhere_and_later_has_an_equal_digest(tmp_path: Path) -> None:
    first = content_digest(written(tmp_path / "a").whole)
    moved = TEXT.replace("FACTOR = 2.0", "# a word\n\nFACTOR = 2.0")
    time.sleep(0.01)
    assert content_digest(written(tmp_path / "b", moved).whole) == first


@pytest.mark.parametrize(
    "change",
    [
        ("FACTOR = 2.0", "FACTOR = 3.0"),
        ("FACTOR * x", "FACTOR - x"),
        ("(1.0, 2.0)", "(1.0, 2.5)"),
        ("TABLE[1]", "TABLE[0]"),
        ("part(row[0])", "sum([part(x) for x in row])"),
    ],
)
def test_any_change_of_what_is_compiled_changes_it(tmp_path: Path, change: tuple[str, str]) -> None:
    first = content_digest(written(tmp_path / "a").whole)
    assert content_digest(written(tmp_path / "b", TEXT.replace(*change)).whole) != first


def test_a_default_of_a_keyword_changes_it(tmp_path: Path) -> None:
    text = TEXT.replace("part(x: float)", "part(x: float, *, y: float = 3.0)").replace("FACTOR * x", "y * x")
    first = content_digest(written(tmp_path / "a", text).whole)
    assert content_digest(written(tmp_path / "b", text.replace("y: float = 3.0", "y: float = 4.0")).whole) != first


def test_a_constant_of_another_module_changes_it(tmp_path: Path) -> None:
    first = content_digest(written(tmp_path / "a").whole)
    assert content_digest(written(tmp_path / "b", offset="11.0").whole) != first


def test_without_a_home_machine_code_is_kept_with_temporary_files(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_home() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", no_home)
    assert cache_folder() == Path(tempfile.gettempdir()) / "pytest-drive-robust" / "kernels"


def test_another_checkout_takes_the_machine_code_of_the_first(tmp_path: Path) -> None:
    code = """
import sys; sys.path.insert(0, sys.argv[1])
import numpy as np
from some import whole
print(whole(np.array((5.0,))), len(whole.stats.cache_hits))
"""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    said = []
    for name in ("a", "b"):
        written(tmp_path / name)
        command = [sys.executable, "-c", code, str(tmp_path / name)]
        said.append(subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.strip())
    assert said == ["22.0 0", "22.0 1"]
    for file in (tmp_path / "cache").rglob("*.nb?"):
        file.write_bytes(b"what a crash left")
    again = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.strip()
    assert again == "22.0 0"


def test_every_entry_point_keeps_its_code_in_our_cache() -> None:
    assert ENTRIES
    assert all(isinstance(kernel._cache, KernelCache) for kernel in ENTRIES)


def test_the_folder_is_numbas_where_that_is_set(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", "/some/folder")
    assert cache_folder() == Path("/some/folder/pytest-drive-robust")


@pytest.mark.parametrize(
    ("inside", "other"),
    [
        ("[x * 2.0 for x in row]", "[x * 3.0 for x in row]"),
        ("[x for x in row if x in {1.0, 2.0}]", "[x for x in row if x in {1.0, 3.0}]"),
    ],
)
def test_a_constant_within_a_comprehension_or_a_set_counts(tmp_path: Path, inside: str, other: str) -> None:
    first = content_digest(written(tmp_path / "a", TEXT.replace("TABLE[1]", f"len({inside})")).whole)
    assert content_digest(written(tmp_path / "b", TEXT.replace("TABLE[1]", f"len({other})")).whole) != first


def test_what_cannot_be_compared_is_refused(tmp_path: Path) -> None:
    text = TEXT.replace("FACTOR = 2.0", "FACTOR = object()")
    with pytest.raises(TypeError, match="a object has no content"):
        content_digest(written(tmp_path / "a", text).whole)


def test_fields_in_another_order_are_other_machine_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def first_file(fields: list[str]) -> str:
        pair = NamedTuple("Pair", [(name, float) for name in fields])  # type: ignore[misc]

        def difference(pair, scale):  # type: ignore[no-untyped-def]
            return scale[0][0] * (pair.far - pair.near)

        cache = KernelCache(difference)
        types = numba_type(pair), numba_type(tuple[tuple[pair, float], float])  # type: ignore[valid-type]
        cache._open(types, cpu_target.target_context.codegen())
        return str(cache._cache_file._index_path)

    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    names = [first_file(fields) for fields in (["near", "far"], ["near", "far"], ["far", "near"])]
    assert names[0] == names[1] != names[2]
