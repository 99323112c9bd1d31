from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from pytest_drive_robust.engine.worker.loaded_code import LoadedCode
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.cache_key.source_files import content_digest

NAME = "loaded_late_or_early"


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.syspath_prepend(tmp_path)
    path = tmp_path / f"{NAME}.py"
    path.write_text("THROTTLE = 1.0")
    yield path
    sys.modules.pop(NAME, None)


def sources_of(file: Path) -> dict[str, str]:
    return {str(file.resolve()): content_digest(file.name, file.read_bytes())}


def test_a_file_that_changed_before_it_was_loaded_is_refused_again_and_again(file: Path) -> None:
    code = LoadedCode(sources_of(file), loaded=())
    code.check()
    file.write_text("THROTTLE = 0.3")
    importlib.import_module(NAME)
    for _ in range(2):  # the process keeps what it loaded
        with pytest.raises(UsageError, match=rf"{NAME}\.py changed after the tests were collected"):
            code.check()


def test_a_file_that_changes_after_it_was_loaded_changes_nothing(file: Path) -> None:
    sources = sources_of(file)
    code = LoadedCode(sources, loaded=())
    importlib.import_module(NAME)
    code.check()
    forked = LoadedCode(sources, loaded=tuple(sys.modules))
    file.write_text("THROTTLE = 0.3")
    code.check()
    forked.check()


def test_a_file_that_was_removed_since_it_was_loaded_is_not_the_one_that_it_was(file: Path) -> None:
    code = LoadedCode(sources_of(file), loaded=())
    importlib.import_module(NAME)
    file.unlink()
    with pytest.raises(UsageError):
        code.check()
