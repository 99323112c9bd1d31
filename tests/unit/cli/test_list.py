"""`drive-robust list`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from pytest_drive_robust.cli.main import main
from pytest_drive_robust.perturbations import Perturbation
from pytest_drive_robust.registry.registry import default_registry, forget_names, hide_names

pytestmark = pytest.mark.usefixtures("agents_folder")


def test_list_shows_every_kind_with_its_origin(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list"]) == 0
    shown = capsys.readouterr().out
    for word in ("agents", "burst-frame-drop", "embedded", "built in", "comfort", "one-per-scenario", "dev10"):
        assert word in shown


def test_a_perturbation_is_shown_with_the_sentence_that_one_types(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "perturbations"]) == 0
    shown = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["inference-latency", "200", "ms", "latency", "built", "in"] in shown


@dataclass
class Strict(Perturbation):
    gain: float = 0.0
    phrase = "strict {gain}"

    def __post_init__(self) -> None:
        assert self.gain > 0.0


def test_a_perturbation_that_refuses_its_own_default_is_shown_without_a_sentence(
    capsys: pytest.CaptureFixture[str],
) -> None:
    kept = hide_names()
    try:
        default_registry().register_perturbation(Strict)
        assert main(["list", "perturbations"]) == 0
    finally:
        forget_names(kept)
    assert ["strict", "test_list.py:Strict"] in [
        [line.split()[0], line.split()[-1].rpartition("/")[2]] for line in capsys.readouterr().out.splitlines() if line
    ]


def test_list_of_one_kind_shows_no_other(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "simulators"]) == 0
    shown = capsys.readouterr().out
    assert "embedded" in shown
    assert "bench2drive" in shown
    assert "burst-frame-drop" not in shown


def test_an_unknown_kind_exits_with_4(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "agnts"]) == 4
    assert "Did you mean 'agents'" in capsys.readouterr().err


def test_entry_points_that_nobody_reads_are_told_below(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    info = tmp_path / "odd-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: odd\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[pytest_drive_robust.metrics]\nDS = odd:ds\n[pytest_drive_robust.metric]\nlost = odd:ds\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    kept = hide_names()
    try:
        assert main(["list", "metrics"]) == 0
    finally:
        forget_names(kept)
    output = " ".join(capsys.readouterr().out.split())
    assert "left out: the metric 'DS' from odd 1.0 cannot be used: 'DS' is a built-in metric" in output
    assert "left out: 'lost' from odd 1.0 is in an unknown entry point group, 'pytest_drive_robust.metric'" in output
