"""`train --robust`: what deployment does to the inputs of each learned agent, and never to its labels."""

# ruff: noqa: E402 - without torch, which is an extra, these tests are skipped before the imports that need it

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

torch = pytest.importorskip("torch")
import numpy as np
from bev_samples import bev_samples
from frames_on_disk import write_frames
from numpy.typing import NDArray
from simlingo_samples import samples

from drive_robust_agents._nets import words
from drive_robust_agents._nets.manifest import read_manifest
from drive_robust_agents._nets.prompts import by_targets, driving
from drive_robust_agents._wrappers.kalman import PositionFilter
from drive_robust_agents.training.__main__ import main
from drive_robust_agents.training.data.rigs import agent_rig
from drive_robust_agents.training.recipes import simlingo
from drive_robust_agents.training.recipes.failures import MOST_HIDDEN, gps_errors, hang, misread, muddy
from drive_robust_agents.training.recipes.recipe import RECIPES, recipe_of
from pytest_drive_robust import Control

Batch = dict[str, torch.Tensor]
AROUND = pytest.mark.parametrize("agent", ["uniad", "vad"])


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(seed))


def bev_batch(agent: str, *, robust: bool, training: bool = True, seed: int = 1) -> Batch:
    arrays = bev_samples(24) | {"old_ok": np.ones(24, dtype=np.bool_)}
    return recipe_of(agent, robust=robust).batch(arrays, rng(seed), training)


def changed(one: Batch, other: Batch) -> set[str]:
    assert one.keys() == other.keys()
    return {name for name in one if not np.array_equal(one[name], other[name], equal_nan=one[name].is_floating_point())}


# --- every agent ---


@pytest.mark.parametrize("agent", sorted(RECIPES))
def test_every_agent_can_be_trained_for_deployment(agent: str, tmp_path: Path) -> None:
    cameras = {camera.name: (camera.height_px, camera.width_px) for camera in agent_rig(agent).cameras}
    frames = write_frames(tmp_path / "frames", rows=20, cameras=cameras, episodes=5)
    arguments = ["--frames", str(frames), "--run", str(tmp_path / "run"), "--batch", "4", "--visits", "8"]
    assert main(["train", "--agent", agent, "--robust", *arguments]) == 0
    entry = read_manifest(tmp_path / "run" / "weights" / "000000002", agent)
    assert entry.provenance["trainer"]["robust"] is True


# --- six cameras ---


@AROUND
def test_with_six_cameras_the_inputs_suffer_and_the_labels_do_not(agent: str) -> None:
    inputs = {"images", "old_images", "can_bus", "old_can_bus", "motion"}
    plain, robust = (bev_batch(agent, robust=robust, training=True) for robust in (False, True))
    assert changed(plain, robust) == inputs
    assert changed(robust, bev_batch(agent, robust=True)) == set()
    assert changed(robust, bev_batch(agent, robust=True, seed=2)) >= inputs


@AROUND
def test_validation_is_never_spoilt(agent: str) -> None:
    plain, robust = (bev_batch(agent, robust=robust, training=False, seed=int(robust)) for robust in (False, True))
    assert changed(plain, robust) == set()


@AROUND
def test_a_row_without_a_memory_is_told_of_no_jump(agent: str) -> None:
    robust = bev_batch(agent, robust=True)
    alone = robust["known"] == 0.0
    assert 0 < alone.sum() < len(alone)
    assert not robust["motion"][alone].any()
    assert not robust["can_bus"][alone][:, 4:].any()
    assert robust["motion"][~alone][:, 1].abs().max() > 1.0  # the samples drive straight on


def pictures(rows: int, value: int) -> NDArray[np.uint8]:
    return np.full((rows, 6, 32, 64, 3), value, dtype=np.uint8)


def test_mud_covers_a_part_of_every_camera_of_a_row_now_and_before_each_at_its_own_place() -> None:
    now, before = pictures(60, 200), pictures(60, 100)
    muddy(now, before, rng())
    black = np.stack([(images == 0).all(-1) for images in (now, before)], axis=1)  # rows, when, cameras, H, W
    shares = black.mean((-1, -2))
    hit = shares.any((1, 2))
    assert 0.3 < hit.mean() < 0.7
    assert ((shares[hit] > 0.02) & (shares[hit] <= MOST_HIDDEN**2)).all()
    places = {mask.tobytes() for mask in black[hit].reshape(-1, 32, 64)}
    assert len(places) > 0.9 * 12 * hit.sum()


def test_a_camera_that_hangs_shows_the_picture_of_before_where_there_is_one() -> None:
    now, before, known = pictures(90, 200), pictures(90, 100), np.arange(90) % 2 == 0
    hang(now, before, known, rng())
    assert (before == 100).all()
    stale = (now == 100).all((-1, -2, -3))
    assert np.array_equal(stale, (now != 200).any((-1, -2, -3)))
    assert not stale[~known].any()
    rows = stale[known].any(1)
    assert 0.15 < rows.mean() < 0.5
    assert 0.2 < stale[known][rows].mean() < 0.65


def test_a_third_of_the_speedometers_reads_too_low_now_and_before() -> None:
    true = np.full((2, 900), 10.0, dtype=np.float32)
    now, before = misread(true, rng())
    wrong = now != 10.0
    assert np.array_equal(wrong, before != 10.0)
    assert 0.28 < wrong.mean() < 0.38
    assert now[wrong].mean() == pytest.approx(6.0, abs=0.5)
    off = now[wrong] - before[wrong]
    assert off.std() == pytest.approx(10.0 * 0.2 * 2.0**0.5, rel=0.15), "noise is that of the reading"
    assert np.corrcoef(now[wrong], before[wrong])[0, 1] > 0.4, "the fraction is that of the row"


# --- simlingo ---


def simlingo_batch(*, robust: bool, rows: int = 60, talking: float = 1.0) -> tuple[dict[str, Any], Batch]:
    given = samples(rows)
    return given, simlingo.SimLingoRecipe(robust=robust, talking=talking).batch(given, rng(1), training=True)


def test_simlingo_is_given_wrong_speeds_and_targets_and_learns_what_is_true() -> None:
    given, plain = simlingo_batch(robust=False, talking=0.0)
    _, robust = simlingo_batch(robust=True, talking=0.0)
    assert changed(plain, robust) == {"image", "speed", "target", "prompt"}
    reads = robust["speed"].numpy()
    assert 0.2 < (reads != given["speed"]).mean() < 0.5
    for mps, numbers in zip(reads.tolist(), robust["prompt"].tolist(), strict=True):
        assert words.decode(numbers[1:-1]) == driving(by_targets(mps))


def test_target_points_of_simlingo_lie_farther_ahead_the_lower_its_speed_reads() -> None:
    given, robust = simlingo_batch(robust=True, rows=300, talking=0.0)
    off = robust["target"].numpy() - given["target"][:, 1]
    np.testing.assert_allclose(off[:, 0], off[:, 1], atol=1e-4, err_msg="both points are seen from one place")
    low = given["speed"] - robust["speed"].numpy()
    assert np.corrcoef(low, off[:, 0, 0])[0, 1] > 0.9
    assert 0.1 < off[:, 0, 1].std() < 1.3


def test_second_prompts_tell_the_speed_that_was_read() -> None:
    _, robust = simlingo_batch(robust=True)
    for mps, numbers in zip(robust["speed"].tolist(), robust["talk_prompt"].tolist(), strict=True):
        assert words.decode(numbers[1:-1]).startswith(by_targets(mps).split(" target")[0])


def test_what_is_left_of_gps_noise_and_how_far_a_wrong_speed_sets_back_is_what_the_filter_does() -> None:
    def errors(*, std_m: float, factor: float, mps: float = 5.0) -> NDArray[np.float64]:
        """Metres (ahead, right) by which the filter is off on a straight drive, once it has settled."""
        filtered, noise = PositionFilter(), rng(3).normal(0.0, 1.0, (2500, 2)) * std_m
        found = []
        for tick, (east, south) in enumerate(noise.tolist()):
            x_m = 0.05 * mps * tick
            estimate = filtered.step(x_m + east, south, 0.0, factor * mps, Control())
            found.append((estimate.x_m - x_m, estimate.y_m))
        return np.array(found[500:])

    assert errors(std_m=15.0, factor=1.0)[:, 1].std() == pytest.approx(15.0 * simlingo._NOISE_LEFT, rel=0.25)
    assert errors(std_m=0.0, factor=0.5)[:, 0].mean() == pytest.approx(-2.5 * simlingo._LAG_S, rel=0.1)


def test_gps_errors_are_up_to_fifteen_metres_for_a_third_of_the_rows() -> None:
    errors = gps_errors(3000, rng())
    hit = errors.any(1)
    assert 0.3 < hit.mean() < 0.37
    assert errors[hit].std(0) == pytest.approx(np.full(2, 15.0 / 3.0**0.5), rel=0.1)
