"""Lockstep of torch networks, where torch is installed: one thread, batches of four and more."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from lockstep_agents import Floats, Net, bits, drive_together, task

from pytest_drive_robust.runner.lockstep.check import check_lockstep, record
from pytest_drive_robust.testing import FakeSimulator

torch = pytest.importorskip("torch")


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def agent(network: Callable[[Any], Any]) -> type[Net]:
    def forward(inputs: Floats) -> Floats:
        with torch.no_grad():
            outputs: Floats = network(torch.as_tensor(inputs, dtype=torch.float32)).numpy().astype(np.float64)
        return outputs

    return type("TorchNet", (Net,), {"forward": staticmethod(forward)})


def networks() -> dict[str, Callable[[Any], Any]]:
    nn = torch.nn
    torch.manual_seed(5)
    return {
        "mlp": nn.Sequential(nn.Linear(8, 256), nn.ReLU(), nn.Linear(256, 3), nn.Tanh()),
        "odd": nn.Sequential(nn.Linear(8, 777), nn.Tanh(), nn.Linear(777, 331), nn.Linear(331, 3), nn.Tanh()),
        "padded": nn.Sequential(nn.Linear(8, 780), nn.Tanh(), nn.Linear(780, 332), nn.Linear(332, 3), nn.Tanh()),
        "evaluated norm": nn.Sequential(nn.Linear(8, 64), nn.BatchNorm1d(64), nn.Linear(64, 3), nn.Tanh()).eval(),
        "training norm": nn.Sequential(nn.Linear(8, 64), nn.BatchNorm1d(64), nn.Linear(64, 3), nn.Tanh()).train(),
        "dropout": nn.Sequential(nn.Linear(8, 64), nn.Dropout(0.5), nn.Linear(64, 3), nn.Tanh()).train(),
    }


def in_any_company(made: type[Net]) -> None:
    together = [task(metres=metres, seed=seed) for metres in (3.0, 8.0, 15.0) for seed in range(3)]
    forwards = drive_together(FakeSimulator, made, together)
    backwards = drive_together(FakeSimulator, made, together[::-1], width=4)[::-1]
    assert [bits(result) for result in forwards] == [bits(result) for result in backwards]


def row_by_row(network: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Evaluate a network for one row at a time: whatever the processor, no row depends on its neighbours."""
    return lambda rows: torch.cat([network(row[None].clone()) for row in rows])


@pytest.mark.parametrize("name", ["mlp", "evaluated norm", "padded", "odd"])
def test_a_network_that_is_evaluated_row_by_row_drives_the_same_in_any_company(name: str) -> None:
    made = agent(row_by_row(networks()[name].eval()))  # type: ignore[attr-defined]
    recording = record(FakeSimulator(), made(), task())
    assert recording is not None
    assert check_lockstep(made, [recording], widths=(4, 8, 12, 16, 32)) is None
    in_any_company(made)


@pytest.mark.parametrize("name", ["mlp", "evaluated norm", "padded", "odd"])
def test_a_network_is_accepted_only_where_its_matrix_products_keep_rows_apart(name: str) -> None:
    """Whether they do is up to the processor: one and the same network is accepted on one and refused on another."""
    made = agent(networks()[name])
    recording = record(FakeSimulator(), made(), task())
    assert recording is not None
    problem = check_lockstep(made, [recording], widths=(4, 8, 12, 16, 32))
    if problem is None:
        in_any_company(made)
    else:
        assert "in other company" in problem


@pytest.mark.parametrize("name", ["training norm", "dropout"])
def test_a_network_left_in_training_mode_is_refused(name: str) -> None:
    made = agent(networks()[name])
    recording = record(FakeSimulator(), Net(), task())
    assert recording is not None
    problem = check_lockstep(made, [recording])
    assert problem is not None
    assert "in other company" in problem
