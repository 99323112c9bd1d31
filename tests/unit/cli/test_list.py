"""`drive-robust list`."""

from __future__ import annotations

import pytest

from pytest_drive_robust.cli.main import main

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


def test_list_of_one_kind_shows_no_other(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "simulators"]) == 0
    shown = capsys.readouterr().out
    assert "embedded" in shown
    assert "bench2drive" in shown
    assert "burst-frame-drop" not in shown


def test_an_unknown_kind_exits_with_4(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "agnts"]) == 4
    assert "Did you mean 'agents'" in capsys.readouterr().err
