"""Torch networks by `--drive-lockstep`, where torch is installed: the width does not matter, neighbours must not."""

from __future__ import annotations

from dataclasses import replace

import pytest
from lockstep_suite import LOCKSTEP_CONFTEST

from pytest_drive_robust.store.record import decode_episode, encode_episode

pytest.importorskip("torch")
pytestmark = pytest.mark.slow

TORCH_CONFTEST = """
import torch


class Torch(Row):
    layers = (torch.nn.Linear(4, 64), torch.nn.ReLU(), torch.nn.Linear(64, 3), torch.nn.Tanh())
    for _number, _layer in enumerate(layers[::2]):
        _draw = torch.Generator().manual_seed(_number)
        torch.nn.init.normal_(_layer.weight, std=0.5, generator=_draw)
        torch.nn.init.zeros_(_layer.bias)
    net = torch.nn.Sequential(*layers).eval()

    @classmethod
    def forward(cls, rows):
        with torch.no_grad():
            # A row at a time: on some processors the bits of a product of matrices depend on the rows around.
            inputs = torch.as_tensor(rows, dtype=torch.float32)
            return torch.cat([cls.net(row[None].clone()) for row in inputs]).double().numpy()


class TorchInTraining(Torch):
    net = torch.nn.Sequential(Torch.layers[0], torch.nn.BatchNorm1d(64), *Torch.layers[1:]).train()

    @classmethod
    def forward(cls, rows):
        with torch.no_grad():
            return cls.net(torch.as_tensor(rows, dtype=torch.float32)).double().numpy()


AGENTS += [Torch, TorchInTraining]
"""


def drive(suite, agent: str, store: str, width: int) -> pytest.RunResult:
    project = suite("DS under clean >= 1", conftest=LOCKSTEP_CONFTEST + TORCH_CONFTEST)
    options = ("--drive-executor", "processes", "--drive-workers", "1", "--drive-seeds", "0,1,2")
    return project.runpytest_subprocess(
        "--drive-robust", "--drive-agent", agent, *options, "--drive-store", store, "--drive-lockstep", str(width)
    )


def test_a_network_drives_the_same_bytes_at_every_width(suite, pytester):
    driven = []
    for width in (4, 8):
        drive(suite, "Torch", f"by-{width}", width).assert_outcomes(passed=1)
        results = [decode_episode(path.read_bytes()) for path in (pytester.path / f"by-{width}").rglob("*.episode")]
        assert {one.versions["lockstep"] for one in results} == {str(width)}
        driven.append({str(one.episode): encode_episode(replace(one, wall_s=0.0, versions={})) for one in results})
    assert len(driven[0]) == 9
    assert driven[0] == driven[1]


def test_a_network_in_training_mode_is_refused(suite):
    result = drive(suite, "TorchInTraining", "refused", 8)
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*the agent 'TorchInTraining' cannot be driven in lockstep: act_batch gives *"])
