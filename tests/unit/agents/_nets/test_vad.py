"""The network of the compact VAD: the command picks its plan."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")


from drive_robust_agents._nets.vad import VadNet, VadSpec, choose  # noqa: E402


@pytest.fixture(scope="module")
def net() -> VadNet:
    torch.manual_seed(0)
    return VadNet(VadSpec()).eval()


def test_the_command_picks_its_row() -> None:
    plans = torch.arange(2.0 * 6 * 6 * 2).view(2, 6, 6, 2)
    for command in range(1, 7):
        chosen = choose(plans, torch.tensor([command, 7 - command]))
        assert torch.equal(chosen[0], plans[0, command - 1])
        assert torch.equal(chosen[1], plans[1, 6 - command])


def test_the_waypoints_of_the_network_are_those_of_the_command(net: VadNet) -> None:
    inputs = net.example(6) | {"command": torch.arange(1, 7)}
    waypoints = net(**inputs)["waypoints"]
    plans = net.heads(net.encoder(inputs["images"], inputs["can_bus"], inputs["old_bev"], inputs["motion"])[0])["plans"]
    for row in range(6):
        torch.testing.assert_close(waypoints[row], plans[0, row])


def test_speed_reaches_the_plan_through_the_features_only(net: VadNet) -> None:
    inputs = net.example(1)
    can_bus = torch.tensor([[5.0, 0.0, 0.0, 0.0, 2.5, 0.0]], requires_grad=True)
    fused, _ = net.encoder(inputs["images"], can_bus, inputs["old_bev"], inputs["motion"])
    (through,) = torch.autograd.grad(net.heads(fused)["plans"].sum(), can_bus, retain_graph=True)
    beside = torch.autograd.grad(net.heads(fused.detach())["plans"].sum(), can_bus, allow_unused=True)
    assert through[0, 0] != 0.0
    assert beside == (None,)
