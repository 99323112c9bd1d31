"""What a training lacks is said before it begins, with nothing written."""

# ruff: noqa: E402 - without torch, which is an extra, these tests are skipped before the imports that need it

from __future__ import annotations

import sys
from pathlib import Path

import pytest

torch = pytest.importorskip("torch")
from frames_on_disk import write_frames

from drive_robust_agents.training.__main__ import main
from drive_robust_agents.training.prerequisites import TRAINING, require_device
from pytest_drive_robust.errors import UsageError


@pytest.fixture(autouse=True)
def _blind(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine without CUDA."""
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    with pytest.raises(SystemExit) as left:
        main(list(map(str, arguments)))
    assert left.value.code == 4
    return " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize("package", TRAINING)
def test_reproduce_misses_packages_before_it_collects(
    package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, package, None)  # as where it is not installed
    said = refused(capsys, "reproduce", "--agent", "tcp", "--out", tmp_path)
    assert f"need {package} for this" in said
    assert "pip install 'drive-robust-agents[train]'" in said
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--routes", "nonsense"], "no set of routes named 'nonsense'"),
        (["--routes", "0"], "0 routes per scenario type: expected 1 to 99"),
        (["--device", "cuda"], "sees no CUDA device here. Give cpu."),
        (["--device", "gpu"], "--device gpu: expected cpu, cuda"),
    ],
)
def test_reproduce_refuses_what_a_later_step_would_before_it_collects(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert message in refused(capsys, "reproduce", "--agent", "tcp", "--out", tmp_path, *arguments)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("package", ["torch", "onnx"])
def test_training_misses_packages_before_the_run_has_a_folder(
    package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    frames = write_frames(tmp_path / "frames", rows=8, cameras={"front": (8, 8)}, episodes=2)
    monkeypatch.setitem(sys.modules, package, None)
    said = refused(capsys, "train", "--agent", "tcp", "--frames", frames, "--run", tmp_path / "run")
    assert f"need {package} for this" in said
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("device", ["gpu", "cpu:1", "cuda:", "mps"])
def test_training_refuses_a_device_that_is_none(
    device: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    train = ["train", "--agent", "tcp", "--frames", tmp_path, "--run", tmp_path / "run", "--device", device]
    assert f"--device {device}: expected cpu, cuda" in refused(capsys, *train)
    assert not (tmp_path / "run").exists()


def test_a_number_of_a_device_that_is_not_there_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    require_device("cuda")
    require_device("cuda:1")
    with pytest.raises(UsageError, match="--device cuda:2: torch sees 2 here, cuda:0 to cuda:1"):
        require_device("cuda:2")


def test_collecting_without_rich_is_refused_and_its_help_is_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "rich", None)
    assert "need rich for this" in refused(capsys, "collect", "--agent", "tcp", "--out", tmp_path / "frames")
    assert not (tmp_path / "frames").exists()
    with pytest.raises(SystemExit) as left:
        main(["collect", "--help"])
    assert left.value.code == 0
