"""The compact UniAD's network: who reads whom, what memory does, and rows that keep to themselves."""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from drive_robust_agents._nets.bev import warp  # noqa: E402
from drive_robust_agents._nets.bev_grid import BevSpec  # noqa: E402
from drive_robust_agents._nets.blocks import channels_last, fold_batch_norm  # noqa: E402
from drive_robust_agents._nets.uniad import UniadNet, UniadSpec, move  # noqa: E402
from drive_robust_agents._nets.uniad_ahead import PlannerHead  # noqa: E402
from drive_robust_agents._nets.uniad_heads import MapView, PriorAgents  # noqa: E402

Inputs = dict[str, torch.Tensor]


@pytest.fixture(scope="module")
def net() -> UniadNet:
    torch.manual_seed(0)
    made = UniadNet(UniadSpec()).eval().requires_grad_(False)
    channels_last(fold_batch_norm(made))
    return made


def inputs(net: UniadNet, rows: int, *, seed: int = 0) -> Inputs:
    draw = torch.Generator().manual_seed(seed)
    made = {}
    for name, value in net.example(rows).items():
        if value.dtype == torch.uint8:
            made[name] = torch.randint(0, 256, value.shape, generator=draw, dtype=torch.uint8)
        elif value.dtype == torch.int64:
            made[name] = torch.randint(1, 7, value.shape, generator=draw)
        else:
            made[name] = torch.randn(value.shape, generator=draw)
    made["known"] = (torch.arange(rows) % 2 == 0).float()
    return made


def test_it_is_small_and_its_outputs_are_what_the_agent_expects(net: UniadNet) -> None:
    assert sum(value.numel() for value in net.parameters()) < 1_000_000
    out = net(**inputs(net, 2))
    shapes = {"waypoints": (6, 2), "occupancy": (5, 80, 32), "bev": (64, 40, 16), "queries": (24, 64), "spots": (24, 2)}
    assert {name: tuple(value.shape[1:]) for name, value in out.items()} == shapes
    assert all(bool(value.isfinite().all()) for value in out.values())
    assert 0.0 <= out["occupancy"].min() <= out["occupancy"].max() <= 1.0


def test_a_network_is_rebuilt_from_what_json_keeps_of_its_specification() -> None:
    spec = replace(UniadSpec(), agents=8, bev=BevSpec(cameras=("front", "front_left", "front_right"), rows=20))
    assert UniadNet.build(json.loads(json.dumps(asdict(spec)))).spec == spec


def test_an_unknown_field_of_a_specification_is_refused() -> None:
    with pytest.raises(TypeError):
        UniadNet.build(asdict(UniadSpec()) | {"wheels": 4})


@pytest.mark.parametrize("rows", [4, 8])
def test_a_row_does_not_depend_on_its_neighbours(net: UniadNet, rows: int) -> None:
    """But for last bits: on some processors those of a matrix product depend on the rows around (then no lockstep)."""
    given, others = inputs(net, rows), inputs(net, rows, seed=1)
    mixed = {name: torch.cat((value.flip(0)[: rows - 1], others[name][:1])) for name, value in given.items()}
    first, again = net(**given), net(**mixed)
    for name, value in first.items():
        torch.testing.assert_close(again[name][: rows - 1], value.flip(0)[: rows - 1], rtol=1e-4, atol=1e-5)


def test_what_is_not_known_does_not_matter(net: UniadNet) -> None:
    given = inputs(net, 2)
    given["known"][:] = 0.0
    first = net(**given)
    given["old_bev"] = given["old_bev"].flip(1)
    given["old_queries"] = -given["old_queries"]
    given["old_spots"] = given["old_spots"] + 30.0
    second = net(**given)
    assert all(torch.equal(first[name], second[name]) for name in first)


@pytest.mark.parametrize("name", ["old_bev", "old_queries", "old_spots", "motion", "can_bus", "command"])
def test_what_is_known_matters(net: UniadNet, name: str) -> None:
    given = inputs(net, 2)
    given["known"][:] = 1.0
    first = net(**given)["waypoints"]
    given[name] = given[name] % 6 + 1 if name == "command" else given[name] + 1.5 * torch.randn_like(given[name])
    assert not torch.equal(first, net(**given)["waypoints"])


def test_what_is_remembered_does_not_depend_on_the_memory_but_for_the_map_it_was_read_from(net: UniadNet) -> None:
    given = inputs(net, 2)
    given["known"][:] = 0.0
    told, recalled = net(**given), net.recall(given["images"], given["can_bus"])
    assert recalled.keys() == {"bev", "queries", "spots"}
    for name, value in recalled.items():
        torch.testing.assert_close(told[name], value, atol=1e-5, rtol=1e-4)


def test_the_plan_teaches_the_ego_motion_but_not_its_track_query() -> None:
    torch.manual_seed(0)
    head = PlannerHead(64, 4, steps=6)
    modes, ego = torch.randn(2, 3, 64, requires_grad=True), torch.randn(2, 1, 64, requires_grad=True)
    view = MapView(torch.randn(2, 160, 64, requires_grad=True), torch.randn(1, 160, 64), torch.nn.Identity())
    plan = head(modes, ego, torch.tensor([1, 4]), view)
    plan.sum().backward()
    assert ego.grad is None
    assert modes.grad is not None
    assert modes.grad.abs().sum() > 0.0
    assert not torch.equal(head(modes, ego + 1.0, torch.tensor([1, 4]), view), plan)


def test_agents_begin_at_the_hottest_cells_and_peaks_go_before_their_neighbours(net: UniadNet) -> None:
    heat = torch.full((1, 40, 16), -6.0)
    heat[0, 10, 4], heat[0, 10, 5], heat[0, 30, 12] = 3.0, 2.5, 0.0
    picks = net._hottest(heat.flatten(1))[0].tolist()
    assert picks[:2] == [10 * 16 + 4, 30 * 16 + 12]
    assert 10 * 16 + 5 in picks


def test_points_and_maps_move_alike() -> None:
    spec, motion = BevSpec(), torch.tensor([[3.0, -1.5, 0.25]])
    spot = torch.tensor([[[14.0, 2.0]]])
    centres = torch.from_numpy(spec.centres())
    field = torch.exp(-((centres - spot[0, 0]) ** 2).sum(-1) / 18.0)[None, None]
    moved = warp(field, motion, centres, spec)[0, 0]
    middle = (centres * moved[..., None]).flatten(0, 1).sum(0) / moved.sum()
    weighed = (centres * field[0, 0, ..., None]).flatten(0, 1).sum(0) / field.sum()
    away = move(spot, motion)[0, 0] - spot[0, 0]
    np.testing.assert_allclose(middle - weighed, away, atol=0.5)


def test_propagated_queries_are_looked_at_only_where_they_are_known(net: UniadNet) -> None:
    now, front = net.look(**{name: value for name, value in inputs(net, 2).items() if name in ("images", "can_bus")})
    fused = net.encoder.fusion(now, torch.zeros_like(now), torch.zeros(2, 3))
    kept = torch.randn(2, 24, 64)

    def told(queries: torch.Tensor) -> torch.Tensor:
        return net.perceive(
            fused, front, PriorAgents(queries, torch.zeros(2, 24, 2), torch.tensor([1.0, 0.0]))
        ).tracks.boxes[1]

    before, after = told(kept), told(kept + 1.0)
    assert not torch.equal(before[0], after[0])
    assert torch.equal(before[1], after[1])
