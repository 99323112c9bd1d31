"""The network of `tcp`: its branches, what inference may leave out, and the distributions of actions."""

# ruff: noqa: E402 - without torch, which is an extra, these tests are skipped before the imports that need it

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")

from tiny_tcp import SPEC, tiny_net

from drive_robust_agents._nets.manifest import plain_spec
from drive_robust_agents._nets.tcp import TcpNet, TcpSpec, beta_mode


def inputs(rows: int) -> dict[str, torch.Tensor]:
    generator = torch.Generator().manual_seed(2)
    return {
        "image": torch.randint(0, 256, (rows, SPEC.height_px, SPEC.width_px, 3), generator=generator).to(torch.uint8),
        "speed": 12.0 * torch.rand(rows, generator=generator),
        "target": 20.0 * torch.randn(rows, 2, generator=generator),
        "command": torch.randint(1, 7, (rows,), generator=generator),
    }


def test_the_network_that_ships_has_the_size_that_is_told() -> None:
    net = TcpNet(TcpSpec())
    assert 1.28e6 < sum(parameter.numel() for parameter in net.parameters()) < 1.30e6
    assert net.eval()(**net.example(1))["waypoints"].shape == (1, 4, 2)


def test_training_sees_every_head() -> None:
    outputs = tiny_net().train()(**inputs(6), full=True)
    shapes = {name: tuple(value.shape) for name, value in outputs.items()}
    assert shapes == {"waypoints": (6, 4, 2), "action": (6, 2), "beta": (6, 5, 2, 2), "speed": (6,), "values": (6, 2)}
    assert outputs["beta"].min() > 1.0
    assert outputs["action"].abs().max() <= 1.0


def test_every_parameter_learns_from_the_full_outputs() -> None:
    net = tiny_net().train()
    sum(value.square().sum() for value in net(**inputs(6), full=True).values()).backward()
    assert [name for name, parameter in net.named_parameters() if parameter.grad is None] == []


def test_what_only_training_needs_changes_nothing_of_the_rest() -> None:
    net = tiny_net().eval()
    with torch.inference_mode():
        outputs, everything = net(**inputs(4)), net(**inputs(4), full=True)
    assert set(outputs) == {"waypoints", "action"}
    assert all(torch.equal(outputs[name], everything[name]) for name in outputs)


def test_the_speed_head_sees_the_image_only() -> None:
    net = tiny_net().eval()
    given = inputs(3)
    other = {**inputs(3), "speed": torch.zeros(3), "target": torch.zeros(3, 2)}
    assert torch.equal(net(**given, full=True)["speed"], net(**other, full=True)["speed"])
    assert not torch.equal(net(**given)["waypoints"], net(**other)["waypoints"])


def test_command_and_target_reach_the_waypoints() -> None:
    net, given = tiny_net().eval(), inputs(3)
    straight = net(**given)["waypoints"]
    assert not torch.equal(straight, net(**{**given, "command": given["command"] % 6 + 1})["waypoints"])
    assert not torch.equal(straight, net(**{**given, "target": given["target"] + 5.0})["waypoints"])


def test_the_mode_of_a_beta_distribution_is_where_its_density_is_largest() -> None:
    parameters = torch.tensor([[3.0, 2.0], [1.5, 6.0], [2.0, 2.0]])
    places = torch.linspace(0.001, 0.999, 999)
    density = torch.distributions.Beta(parameters[:, :1], parameters[:, 1:]).log_prob(places)
    assert torch.allclose(beta_mode(parameters), places[density.argmax(1)], atol=2e-3)


def test_a_specification_of_another_network_is_refused() -> None:
    with pytest.raises(TypeError, match="queries"):
        TcpNet.build({**plain_spec(SPEC), "queries": 24})
