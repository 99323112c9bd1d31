"""The average that ships follows the trained network."""

# ruff: noqa: E402 - without torch, which is an extra, these tests are skipped before the imports that need it

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")
from tiny_tcp import tiny_net

from drive_robust_agents.training.loop.average import Average


def test_the_average_follows_slowly_and_moves_statistics_too() -> None:
    net = tiny_net()
    average = Average(net)
    with torch.no_grad():
        for value in net.state_dict().values():
            if value.is_floating_point():
                value += 1.0
    before = {name: value.clone() for name, value in average.net.state_dict().items()}
    average.follow(10_000)
    for name, value in average.net.state_dict().items():
        if value.is_floating_point():
            assert torch.allclose(value, before[name] + 0.001, atol=1e-6), name
    average.follow(0)
    weight = average.net.state_dict()["pooled.weight"]
    assert torch.allclose(weight, before["pooled.weight"] + 0.001 + 0.9 * 0.999, atol=1e-5)
