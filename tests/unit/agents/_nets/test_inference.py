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

from drive_robust_agents._nets import onnx_engine
from drive_robust_agents._nets.inference import ROWS, Policy
from drive_robust_agents._nets.tcp import TcpNet
from drive_robust_agents._nets.weights import locate
from pytest_drive_robust.errors import UsageError

Inputs = dict[str, NDArray[Any]]


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return published(tmp_path_factory.mktemp("weights"))


@pytest.fixture(scope="module")
def policy(file: Path) -> Policy:
    return Policy.of("tcp", TcpNet.build, weights=file)


def inputs(rows: int, seed: int = 0) -> Inputs:
    rng = np.random.Generator(np.random.Philox(seed))
    return {
        "image": rng.integers(0, 256, (rows, SPEC.height_px, SPEC.width_px, 3), dtype=np.uint8),
        "speed": rng.uniform(0.0, 12.0, rows).astype(np.float32),
        "target": rng.normal(0.0, 20.0, (rows, 2)).astype(np.float32),
        "command": rng.integers(1, 7, rows),
    }


def test_it_says_what_the_network_says(policy: Policy) -> None:
    given = inputs(1)
    with torch.inference_mode():
        expected = policy.net(**{name: torch.from_numpy(value) for name, value in given.items()})
    found = policy.run(**given)
    assert set(found) == {"waypoints", "action"}
    for name, value in found.items():
        assert value.dtype == np.float32
        assert np.array_equal(value, expected[name].numpy())


@pytest.mark.parametrize("width", [2, 4, 7, 8, 16])
def test_the_bits_of_a_row_depend_on_nothing_but_the_row(policy: Policy, width: int) -> None:
    several, rng = inputs(16, seed=1), np.random.Generator(np.random.Philox(3))
    reference = policy.run(**several)
    places = rng.permutation(16)[:width]
    found = policy.run(**{name: value[places] for name, value in several.items()})
    for name, value in found.items():
        assert value.shape[0] == width
        assert value.tobytes() == reference[name][places].tobytes()


def test_a_row_alone_agrees_with_the_batch_up_to_rounding(policy: Policy) -> None:
    several = inputs(ROWS, seed=4)
    together = policy.run(**several)["waypoints"]
    alone = policy.run(**{name: value[2:3] for name, value in several.items()})["waypoints"]
    assert np.abs(together[2:3] - alone).max() < 1e-5


def test_agents_share_a_network_and_other_arguments_get_another(policy: Policy, file: Path) -> None:
    assert Policy.of("tcp", TcpNet.build, weights=str(file)) is policy
    other = Policy.of("tcp", TcpNet.build, weights=file, control=False)
    assert other is not policy
    assert set(other.run(**inputs(1))) == {"waypoints"}


def test_replaced_weights_are_another_policy(tmp_path: Path) -> None:
    first = Policy.of("tcp", TcpNet.build, weights=published(tmp_path, seed=1))
    second = Policy.of("tcp", TcpNet.build, weights=published(tmp_path, seed=2))
    assert first.label != second.label
    assert not np.array_equal(first.run(**inputs(1))["waypoints"], second.run(**inputs(1))["waypoints"])


def test_one_thread_computes_whatever_somebody_set(policy: Policy) -> None:
    torch.set_num_threads(2)
    policy.run(**inputs(1))
    assert torch.get_num_threads() == 1


def test_inputs_are_not_touched_and_outputs_are_the_callers(policy: Policy) -> None:
    given, kept = inputs(2), inputs(2)
    found = policy.run(**given)
    found["waypoints"][:] = 7.0
    assert all(np.array_equal(given[name], kept[name]) for name in given)
    assert not np.array_equal(policy.run(**given)["waypoints"], found["waypoints"])


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"engine": "onxx"}, "engine='onxx': expected one of 'torch', 'onnx'. Did you mean 'onnx'"),
        ({"dtype": "int8"}, "dtype='int8'"),
        ({"device": "gpu"}, "device='gpu' with engine='torch': expected 'cpu', 'auto'"),
        ({"device": "cuda:0", "engine": "onnx"}, "device='cuda:0' with engine='onnx'"),
        ({"threads": 0}, "threads=0"),
        ({"engine": "onnx", "dtype": "bfloat16"}, "dtype='bfloat16': expected float32"),
    ],
)
def test_arguments_that_cannot_be_are_refused(file: Path, arguments: dict[str, Any], told: str) -> None:
    with pytest.raises(UsageError) as refused:
        Policy.of("tcp", TcpNet.build, weights=file, **arguments)
    assert told in str(refused.value)


@pytest.mark.skipif(torch.cuda.is_available(), reason="needs a machine without CUDA")
def test_a_device_that_is_not_there_is_refused_and_auto_takes_the_processor(file: Path, policy: Policy) -> None:
    with pytest.raises(UsageError, match="sees 0"):
        Policy.of("tcp", TcpNet.build, weights=file, device="cuda")
    assert np.array_equal(
        Policy.of("tcp", TcpNet.build, weights=file, device="auto").run(**inputs(2))["waypoints"],
        policy.run(**inputs(2))["waypoints"],
    )


def test_mixed_precision_stays_near(file: Path, policy: Policy) -> None:
    mixed = Policy.of("tcp", TcpNet.build, weights=file, dtype="bfloat16").run(**inputs(2))
    exact = policy.run(**inputs(2))
    assert mixed["waypoints"].dtype == np.float32
    assert 0.0 < np.abs(mixed["waypoints"] - exact["waypoints"]).max() < 0.05


class TestOnnx:
    @pytest.fixture(autouse=True)
    def _cache(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        pytest.importorskip("onnxruntime")
        pytest.importorskip("onnx")
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))

    def test_both_engines_agree_for_any_number_of_rows(self, file: Path, policy: Policy) -> None:
        fast = Policy.of("tcp", TcpNet.build, weights=file, engine="onnx")
        for rows in (1, ROWS, 6):
            given = inputs(rows, seed=rows)
            expected, found = policy.run(**given), fast.run(**given)
            assert set(found) == set(expected)
            for name, value in expected.items():
                assert np.abs(found[name] - value).max() < 1e-4

    def test_the_model_is_built_once_for_weights_and_options(self, file: Path, policy: Policy) -> None:
        entry = locate("tcp", file)[1]
        onnx_engine.OnnxEngine(policy.net, entry)
        (model,) = onnx_engine.cache_folder().iterdir()
        built = model.stat().st_mtime_ns
        onnx_engine.OnnxEngine(policy.net, entry)
        onnx_engine.OnnxEngine(policy.net, entry, options=(("control", True),))
        assert model.stat().st_mtime_ns == built
        assert sorted(path.suffix for path in onnx_engine.cache_folder().iterdir()) == [".onnx", ".onnx"]

    def test_it_knows_forward_only(self, file: Path) -> None:
        with pytest.raises(UsageError, match="cannot compute 'generate'"):
            Policy.of("tcp", TcpNet.build, weights=file, engine="onnx").run("generate", **inputs(1))
