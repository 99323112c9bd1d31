"""`drive-robust warm`."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from pytest_drive_robust.cli.main import main
from pytest_drive_robust.jit.cache import cache_folder
from pytest_drive_robust.simulators.embedded import compiling

Tell = Callable[[int, int], None]


@pytest.mark.parametrize(
    ("missing", "said"), [(0, "all kernels were compiled: {folder}\n"), (4, "compiled 4 kernels in 0 s: {folder}\n")]
)
def test_it_says_what_was_compiled_and_where_it_is_kept(
    missing: int, said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("time.monotonic", lambda: 1.0)
    monkeypatch.setattr(compiling, "compile_kernels", lambda tell: missing)
    assert main(["warm", "--here"]) == 0
    assert capsys.readouterr() == (said.format(folder=cache_folder()), "")


@pytest.mark.parametrize("missing", [3, 0])
def test_where_nothing_can_be_kept_nothing_is_compiled_for_later(
    missing: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("where a folder should be")
    monkeypatch.setattr("numba.config.CACHE_DIR", str(tmp_path / "file"))
    monkeypatch.setattr(compiling, "missing_functions", lambda: missing)
    monkeypatch.setattr(compiling, "compile_kernels", lambda tell: missing)
    assert main(["warm", "--here"]) == (4 if missing else 0)
    out, told = capsys.readouterr()
    if missing:
        assert out == ""
        assert f"cannot be kept in '{tmp_path / 'file' / 'pytest-drive-robust'}': Not a directory. Make room" in told
        assert "NUMBA_CACHE_DIR" in told


@pytest.mark.parametrize("is_terminal", [True, False])
def test_a_terminal_sees_how_far_it_is(
    is_terminal: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def compile_kernels(tell: Tell) -> int:
        tell(1, 2)
        tell(2, 2)
        return 1

    monkeypatch.setattr(compiling, "compile_kernels", compile_kernels)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: is_terminal, raising=False)
    assert main(["warm", "--here"]) == 0
    shown = capsys.readouterr().err
    assert shown == ("\rcompiling 1 of 2 functions\rcompiling 2 of 2 functions\n" if is_terminal else "")


def test_it_compiles_in_a_process_of_its_own_that_has_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    began = []

    def run(command: tuple[str, ...], **given: object) -> SimpleNamespace:
        began.append((command, given["env"]))
        return SimpleNamespace(returncode=3)

    monkeypatch.setattr(subprocess, "run", run)
    assert main(["warm"]) == 3
    ((command, environment),) = began
    assert command[-2:] == ("warm", "--here")
    assert environment["OPENBLAS_NUM_THREADS"] == "1"
