"""Accepting a run: who may, what it replaces, what stays."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from snapshot_factory import PRINT, SIGNATURE, cell, snapshot

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.regression.baselines import Blessing, baseline_file, blessed_snapshot, read_baseline
from pytest_drive_robust.regression.bless import bless
from pytest_drive_robust.regression.comparison import compare
from pytest_drive_robust.regression.snapshot import Cell, Snapshot


def test_a_partial_run_keeps_every_other_score(tmp_path: Path) -> None:
    bless(snapshot(cell([100.0] * 3), cell([50.0] * 3, setting="occlusion 0.5")), tmp_path, SIGNATURE, environ={})
    later = replace(SIGNATURE, reason="route 2 was fixed", date="2026-12-01")
    (blessed,) = bless(snapshot(cell({"2": 90.0})), tmp_path, later, environ={})
    assert (blessed.added, blessed.replaced, blessed.kept) == (0, 1, 5)
    now = blessed_snapshot([read_baseline(blessed.path)], simulator="fake", label="baseline")
    assert [score.ds for score in now.cells["driver", "clean"].routes.values()] == [100.0, 90.0, 100.0]
    assert len(now.cells["driver", "occlusion 0.5"].routes) == 3
    assert {item.reason for item in read_baseline(blessed.path).blessings.values()} == {
        "first baseline",
        "route 2 was fixed",
    }


def test_other_routes_of_the_same_settings_are_dropped_on_request(tmp_path: Path) -> None:
    bless(snapshot(cell([100.0] * 3), cell([50.0] * 3, setting="occlusion 0.5")), tmp_path, SIGNATURE, environ={})
    run = snapshot(cell({"2": 90.0, "9": 80.0}))
    (kept,) = bless(run, tmp_path, SIGNATURE, environ={})
    assert (kept.kept, kept.beside, kept.dropped) == (5, 2, 0)
    before = blessed_snapshot([read_baseline(kept.path)], simulator="fake", label="baseline")
    assert "lacks routes of baseline" in compare(before, run).refusals[0].text
    (only,) = bless(run, tmp_path, SIGNATURE, environ={}, only=True)
    assert (only.added, only.replaced, only.kept, only.beside, only.dropped) == (0, 2, 3, 0, 2)
    before = blessed_snapshot([read_baseline(only.path)], simulator="fake", label="baseline")
    assert list(before.cells["driver", "clean"].routes) == ["2", "9"]
    assert len(before.cells["driver", "occlusion 0.5"].routes) == 3
    assert compare(before, run).refusals == ()


def test_a_blessed_run_compares_with_itself_without_a_word(tmp_path: Path) -> None:
    run = snapshot(cell([100.0, 36.123456, 60.0] * 20))
    (blessed,) = bless(run, tmp_path, SIGNATURE, environ={})
    before = blessed_snapshot([read_baseline(blessed.path)], simulator=None, label="baseline")
    comparison = compare(before, run)
    assert [item.verdict for item in comparison.cells] == ["pass"]
    assert not comparison.mismatches


def test_scores_of_another_simulator_live_beside(tmp_path: Path) -> None:
    other = replace(PRINT, simulator="merge-v0")
    bless(snapshot(cell([100.0])), tmp_path, SIGNATURE, environ={})
    (blessed,) = bless(snapshot(cell([10.0], fingerprint=other)), tmp_path, SIGNATURE, environ={})
    baseline = read_baseline(blessed.path)
    for simulator, ds in (("fake", 100.0), ("merge-v0", 10.0)):
        found = blessed_snapshot([baseline], simulator=simulator, label="baseline")
        assert found.cells["driver", "clean"].routes["1"].ds == ds
    with pytest.raises(UsageError, match="only for: fake, merge-v0"):
        blessed_snapshot([baseline], simulator=None, label="baseline")


@pytest.mark.parametrize(
    ("run", "signature", "environ", "told"),
    [
        (snapshot(cell([1.0])), SIGNATURE, {"CI": "true"}, "CI never blesses"),
        (snapshot(cell([1.0])), replace(SIGNATURE, reason=" "), {}, "needs a reason"),
        (snapshot(cell([1.0], broken=("7, seed 0: no map",))), SIGNATURE, {}, "is incomplete"),
        (snapshot(cell([])), SIGNATURE, {}, "holds no score"),
    ],
    ids=["ci", "no-reason", "infra-error", "empty"],
)
def test_what_must_not_be_blessed_writes_nothing(
    tmp_path: Path, run: Snapshot, signature: Blessing, environ: dict[str, str], told: str
) -> None:
    with pytest.raises(UsageError, match=told):
        bless(run, tmp_path / "baselines", signature, environ=environ)
    assert not (tmp_path / "baselines").exists()


def test_a_route_that_became_another_is_replaced_on_request_only(tmp_path: Path) -> None:
    bless(snapshot(cell([100.0])), tmp_path, SIGNATURE, environ={})
    changed = snapshot(cell([50.0], digest="d1"))
    with pytest.raises(UsageError, match="--replace-routes"):
        bless(changed, tmp_path, SIGNATURE, environ={})
    (blessed,) = bless(changed, tmp_path, SIGNATURE, environ={}, replace_routes=True)
    assert blessed.replaced == 1


def test_a_route_whose_content_was_not_recorded_is_replaced_by_itself(tmp_path: Path) -> None:
    bless(snapshot(cell([100.0], digest="")), tmp_path, SIGNATURE, environ={})
    (blessed,) = bless(snapshot(cell([50.0])), tmp_path, SIGNATURE, environ={})
    assert (blessed.added, blessed.replaced) == (0, 1)


def test_an_unknown_author_stays_unknown(tmp_path: Path) -> None:
    (blessed,) = bless(snapshot(cell([100.0])), tmp_path, Blessing("2026-11-21", "why"), environ={})
    (told,) = json.loads(blessed.path.read_text())["blessings"].values()
    assert (told["by"], told["commit"], told["run"]) == (None, None, None)


def test_two_agents_have_a_file_each_and_no_two_names_share_one(tmp_path: Path) -> None:
    run = snapshot(cell([1.0], agent="mine:Agent"), cell([2.0], agent="mine-Agent"))
    written = bless(run, tmp_path, SIGNATURE, environ={})
    assert len({item.path for item in written}) == 2
    read = [read_baseline(item.path) for item in written]
    scores_of = {found.agent: [route.score.ds for route in found.routes.values()] for found in read}
    assert scores_of == {"mine:Agent": [1.0], "mine-Agent": [2.0]}
    assert baseline_file(tmp_path, "classical").name == "classical.json"


def test_an_empty_cell_takes_nothing_away(tmp_path: Path) -> None:
    bless(snapshot(cell([100.0])), tmp_path, SIGNATURE, environ={})
    run = snapshot(Cell("driver", "clean", "", {}), cell([3.0], setting="occlusion 0.5"))
    (blessed,) = bless(run, tmp_path, SIGNATURE, environ={})
    assert (blessed.added, blessed.replaced, blessed.kept) == (1, 0, 1)
