"""Networks at run time: numpy in and out, one network for all agents, the same bits in any company, any engine."""

# ruff: noqa: E402 - without torch, which is an extra, these tests are skipped before the imports that need it

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

torch = pytest.importorskip("torch")
import numpy as np
from numpy.typing import NDArray
from tiny_tcp import SPEC, published

from drive_robust_agents._nets.inference import ROWS, LoadedNetwork
from pytest_drive_robust.errors import UsageError

NETWORK = "tcp:TcpNet"
Inputs = dict[str, NDArray[Any]]


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return published(tmp_path_factory.mktemp("weights"))


@pytest.fixture(scope="module", params=["onnx", "torch"])
def network(request: pytest.FixtureRequest, file: Path) -> LoadedNetwork:
    return LoadedNetwork.of("tcp", NETWORK, weights=file, engine=request.param)


@pytest.fixture(scope="module")
def eager(file: Path) -> LoadedNetwork:
    return LoadedNetwork.of("tcp", NETWORK, weights=file, engine="torch")


def inputs(rows: int, seed: int = 0) -> Inputs:
    rng = np.random.Generator(np.random.Philox(seed))
    return {
        "image": rng.integers(0, 256, (rows, SPEC.height_px, SPEC.width_px, 3), dtype=np.uint8),
        "speed": rng.uniform(0.0, 12.0, rows).astype(np.float32),
        "target": rng.normal(0.0, 20.0, (rows, 2)).astype(np.float32),
        "command": rng.integers(1, 7, rows),
    }


def test_it_says_what_the_network_says(eager: LoadedNetwork) -> None:
    given = inputs(1)
    with torch.inference_mode():
        expected = eager.engine.net(**{name: torch.from_numpy(value) for name, value in given.items()})
    found = eager.run(**given)
    assert set(found) == {"waypoints", "action"}
    for name, value in found.items():
        assert value.dtype == np.float32
        assert np.array_equal(value, expected[name].numpy())


@pytest.mark.parametrize("width", [2, 4, 7, 8, 16])
def test_the_bits_of_a_row_depend_on_nothing_but_the_row(network: LoadedNetwork, width: int) -> None:
    several, rng = inputs(16, seed=1), np.random.Generator(np.random.Philox(3))
    reference = network.run(**several)
    places = rng.permutation(16)[:width]
    found = network.run(**{name: value[places] for name, value in several.items()})
    for name, value in found.items():
        assert value.shape[0] == width
        assert value.tobytes() == reference[name][places].tobytes()


def test_a_row_alone_agrees_with_the_batch_up_to_rounding(network: LoadedNetwork) -> None:
    several = inputs(ROWS, seed=4)
    together = network.run(**several)["waypoints"]
    alone = network.run(**{name: value[2:3] for name, value in several.items()})["waypoints"]
    assert np.abs(together[2:3] - alone).max() < 1e-5


def test_agents_share_a_network_and_other_arguments_get_another(eager: LoadedNetwork, file: Path) -> None:
    assert LoadedNetwork.of("tcp", NETWORK, weights=str(file), engine="torch") is eager
    assert LoadedNetwork.of("tcp", NETWORK, weights=file) is not eager


def test_replaced_weights_are_another_policy(tmp_path: Path) -> None:
    first = LoadedNetwork.of("tcp", NETWORK, weights=published(tmp_path, seed=1))
    second = LoadedNetwork.of("tcp", NETWORK, weights=published(tmp_path, seed=2))
    assert first.entry.label != second.entry.label
    assert not np.array_equal(first.run(**inputs(1))["waypoints"], second.run(**inputs(1))["waypoints"])


def test_one_thread_computes_whatever_somebody_set(eager: LoadedNetwork) -> None:
    torch.set_num_threads(2)
    eager.run(**inputs(1))
    assert torch.get_num_threads() == 1


def test_inputs_are_not_touched_and_outputs_are_the_callers(network: LoadedNetwork) -> None:
    given, kept = inputs(2), inputs(2)
    found = network.run(**given)
    found["waypoints"][:] = 7.0
    assert all(np.array_equal(given[name], kept[name]) for name in given)
    assert not np.array_equal(network.run(**given)["waypoints"], found["waypoints"])


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"engine": "onxx"}, "no engine of a network named 'onxx'. Did you mean 'onnx'? Known: onnx, torch."),
        ({"dtype": "int8"}, "no dtype of a network named 'int8'"),
        ({"device": "gpu", "engine": "torch"}, "device='gpu' with engine='torch': expected 'cpu', 'auto'"),
        ({"device": "cuda:0"}, "device='cuda:0' with engine='onnx': expected 'cpu' or 'auto'; engine='torch' computes"),
        ({"threads": 0}, "threads=0"),
        ({"dtype": "bfloat16"}, "dtype='bfloat16': expected float32 and 1 or more; engine='torch' has mixed precision"),
    ],
)
def test_arguments_that_cannot_be_are_refused(file: Path, arguments: dict[str, Any], told: str) -> None:
    with pytest.raises(UsageError) as refused:
        LoadedNetwork.of("tcp", NETWORK, weights=file, **arguments)
    assert told in str(refused.value)


@pytest.mark.skipif(torch.cuda.is_available(), reason="needs a machine without CUDA")
def test_a_device_that_is_not_there_is_refused_and_auto_takes_the_processor(file: Path, eager: LoadedNetwork) -> None:
    with pytest.raises(UsageError, match="sees 0"):
        LoadedNetwork.of("tcp", NETWORK, weights=file, engine="torch", device="cuda")
    assert np.array_equal(
        LoadedNetwork.of("tcp", NETWORK, weights=file, engine="torch", device="auto").run(**inputs(2))["waypoints"],
        eager.run(**inputs(2))["waypoints"],
    )


def test_mixed_precision_stays_near(file: Path, eager: LoadedNetwork) -> None:
    mixed = LoadedNetwork.of("tcp", NETWORK, weights=file, engine="torch", dtype="bfloat16").run(**inputs(2))
    exact = eager.run(**inputs(2))
    assert mixed["waypoints"].dtype == np.float32
    assert 0.0 < np.abs(mixed["waypoints"] - exact["waypoints"]).max() < 0.05


def test_both_engines_agree_for_any_number_of_rows(file: Path, eager: LoadedNetwork) -> None:
    fast = LoadedNetwork.of("tcp", NETWORK, weights=file)
    for rows in (1, ROWS, 6):
        given = inputs(rows, seed=rows)
        expected, found = eager.run(**given), fast.run(**given)
        assert set(found) == set(expected)
        for name, value in expected.items():
            assert np.abs(found[name] - value).max() < 1e-4


def test_a_method_without_a_graph_is_told(file: Path) -> None:
    with pytest.raises(UsageError, match=r"no graph of 'say' beside .*tcp\.safetensors, only of forward"):
        LoadedNetwork.of("tcp", NETWORK, weights=file).run("say", **inputs(1))
