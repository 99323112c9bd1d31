"""What ships is loaded; whatever is not exactly what the manifest lists is refused before anything is made of it."""

# ruff: noqa: E402 - without torch, which is an extra, these tests are skipped before the imports that need it

from __future__ import annotations

import hashlib
import json
import os
import pickle
from pathlib import Path
from typing import Any

import pytest

torch = pytest.importorskip("torch")

from tiny_tcp import SPEC, published, tiny_net

from drive_robust_agents._nets import require
from drive_robust_agents._nets.inference import LoadedNetwork
from drive_robust_agents._nets.manifest import plain_spec, read_manifest, spec_from
from drive_robust_agents._nets.tcp import TcpNet
from drive_robust_agents._nets.torch_weights import encode, load
from pytest_drive_robust.errors import UsageError

NETWORK = "tcp:TcpNet"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return published(tmp_path)


def relist(file: Path, content: bytes | None = None, /, **changes: Any) -> None:
    """Change the file and let the manifest agree, as somebody would who can write both."""
    manifest = file.parent / "manifest.json"
    entries = json.loads(manifest.read_text())
    if content is not None:
        file.write_bytes(content)
        changes |= {"sha256": hashlib.sha256(content).hexdigest(), "size_bytes": len(content)}
    entries["tcp"] |= changes
    manifest.write_text(json.dumps(entries))


def refused(file: Path, match: str) -> None:
    with pytest.raises(UsageError, match=match):
        LoadedNetwork.check("tcp", NETWORK, weights=file)
    for engine in ("onnx", "torch"):
        with pytest.raises(UsageError, match=match):
            LoadedNetwork.of("tcp", NETWORK, weights=file, engine=engine)


def test_equal_weights_are_equal_bytes() -> None:
    net = tiny_net()
    assert len({encode(net, SPEC) for _ in range(12)}) == 1


def test_loaded_weights_drive_as_the_trained_network_did_up_to_half_precision(file: Path) -> None:
    net, entry = load("tcp", TcpNet.build, weights=file)
    assert not net.training
    assert not any(parameter.requires_grad for parameter in net.parameters())
    assert not any(isinstance(module, torch.nn.BatchNorm2d) for module in net.modules())
    assert entry.label == f"tcp@0.0:{entry.sha256[:8]}"
    assert entry.parameters == sum(parameter.numel() for parameter in tiny_net().parameters())
    reference = tiny_net().train()
    example = reference.example(4)
    torch.manual_seed(0)  # as `published` found it: what it drew after the network was made
    tiny_net()
    example["image"] = torch.randint(0, 256, example["image"].shape, dtype=torch.uint8)
    reference(**example)
    with torch.inference_mode():
        expected, given = reference.eval()(**example), net(**example)
    for name, value in expected.items():
        assert (value - given[name]).abs().max() < 5e-3, name
        assert not torch.equal(value, given[name]), "half precision must leave a trace, or this compares nothing"


def test_one_changed_byte_is_refused(file: Path) -> None:
    content = bytearray(file.read_bytes())
    content[-7] ^= 1
    file.write_bytes(content)
    refused(file, "SHA-256 .* it was changed")


def test_a_truncated_file_is_refused(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-100])
    refused(file, "truncated")


def test_a_truncated_file_is_refused_even_when_the_manifest_agrees(file: Path) -> None:
    relist(file, file.read_bytes()[:-100])
    refused(file, "no safetensors file")


def test_a_file_of_more_than_six_megabytes_is_not_even_read(file: Path) -> None:
    with file.open("r+b") as opened:
        opened.truncate(7_000_000)
    relist(file, size_bytes=7_000_000)
    refused(file, "7000000 bytes")


@pytest.mark.parametrize("protocol", [0, 2, 5])
def test_a_pickle_is_refused_and_never_opened(file: Path, protocol: int) -> None:
    trace = file.parent / "executed"

    class Trap:
        def __reduce__(self) -> tuple[Any, ...]:
            return os.mkdir, (str(trace),)

    relist(file, pickle.dumps({"encoder": Trap()}, protocol=protocol))
    refused(file, "no safetensors file")
    assert not trace.exists()


def test_what_torch_saves_is_refused_as_a_pickle(file: Path) -> None:
    saved = file.parent / "net.pt"
    torch.save(tiny_net().state_dict(), saved)
    relist(file, saved.read_bytes())
    refused(file, "looks like a pickle, which we never open")


def test_weights_of_another_architecture_are_refused(file: Path) -> None:
    class VadNet(TcpNet):
        pass

    relist(file, encode(VadNet(SPEC), SPEC), architecture="VadNet")
    refused(file, "holds weights of VadNet, expected those of TcpNet")


def test_a_header_that_does_not_say_what_the_manifest_says_is_refused(file: Path) -> None:
    relist(file, spec={**plain_spec(SPEC), "hidden": 32})
    refused(file, r"header of .* does not fit the manifest: spec is")


def test_tensors_of_another_shape_are_refused_by_name(file: Path) -> None:
    wider = spec_from(type(SPEC), {**plain_spec(SPEC), "hidden": 32})
    relist(file, encode(TcpNet(wider), SPEC))
    with pytest.raises(UsageError, match=r"does not hold the tensors of TcpNet: \d+ differ \(controller"):
        load("tcp", TcpNet.build, weights=file)
    with pytest.raises(UsageError, match=r"tcp\.onnx is no graph that fits tcp\.safetensors: .*do not match"):
        LoadedNetwork.of("tcp", NETWORK, weights=file)


def test_a_specification_that_the_agent_does_not_know_is_refused(file: Path) -> None:
    spec = {**plain_spec(SPEC), "queries": 24}
    content = file.read_bytes().replace(b'\\"hidden\\": 16', b'\\"hidden\\": 16, \\"queries\\": 24')
    grown = len(content) - len(file.read_bytes())
    length = int.from_bytes(content[:8], "little") + grown
    relist(file, length.to_bytes(8, "little") + content[8:], spec=spec)
    with pytest.raises(UsageError, match=r"no TcpNet can be built as .*queries"):
        load("tcp", TcpNet.build, weights=file)


def test_missing_weights_and_names_are_told(file: Path) -> None:
    with pytest.raises(UsageError, match=r"no entry in .* named 'vad'.*Known: tcp"):
        read_manifest(file.parent, "vad")
    with pytest.raises(UsageError, match=r"manifest.json: train 'tcp' and publish it"):
        read_manifest(file.parent / "nowhere", "tcp")
    file.unlink()
    refused(file, "cannot be read: No such file")


def test_a_manifest_may_name_files_of_its_own_folder_only(file: Path) -> None:
    relist(file, file="../tcp.safetensors")
    refused(file, "expected a file of that folder")


def test_another_file_beside_the_manifest_is_refused(file: Path) -> None:
    other = file.with_name("other.safetensors")
    other.write_bytes(file.read_bytes())
    refused(other, "lists 'tcp.safetensors' for 'tcp', not 'other.safetensors'")


def graph_of(file: Path, content: bytes | None) -> None:
    """Change the graph and let the manifest agree; None lists none."""
    graphs = {}
    if content is not None:
        file.with_suffix(".onnx").write_bytes(content)
        digest = hashlib.sha256(content).hexdigest()
        graphs = {"forward": {"file": "tcp.onnx", "sha256": digest, "size_bytes": len(content)}}
    relist(file, graphs=graphs)


def test_one_changed_byte_of_a_graph_is_refused(file: Path) -> None:
    graph = file.with_suffix(".onnx")
    content = bytearray(graph.read_bytes())
    content[-7] ^= 1
    graph.write_bytes(content)
    with pytest.raises(UsageError, match=r"tcp\.onnx has SHA-256 .* it was changed"):
        LoadedNetwork.check("tcp", NETWORK, weights=file)
    with pytest.raises(UsageError, match=r"tcp\.onnx has SHA-256 .* it was changed"):
        LoadedNetwork.of("tcp", NETWORK, weights=file)


@pytest.mark.parametrize("agrees", [False, True])
def test_a_truncated_graph_is_refused(file: Path, agrees: bool) -> None:
    graph = file.with_suffix(".onnx")
    cut = graph.read_bytes()[:-100]
    graph.write_bytes(cut)
    if agrees:
        graph_of(file, cut)
    with pytest.raises(UsageError, match="no graph that fits" if agrees else "truncated"):
        LoadedNetwork.of("tcp", NETWORK, weights=file)


def test_weights_without_a_graph_are_told_the_command_that_writes_one(file: Path) -> None:
    graph_of(file, None)
    with pytest.raises(UsageError, match=r"lists no graph of tcp@.*training graphs .*tcp\.safetensors.*engine='torch'"):
        LoadedNetwork.of("tcp", NETWORK, weights=file)
    assert LoadedNetwork.of("tcp", NETWORK, weights=file, engine="torch").entry.label.startswith("tcp@0.0:")


def test_a_manifest_may_name_graphs_of_its_own_folder_only(file: Path) -> None:
    relist(file, graphs={"forward": {"file": "../tcp.onnx", "sha256": "", "size_bytes": 0}})
    refused(file, r"names '\.\./tcp\.onnx' .* expected a file of that folder")


def test_weights_that_are_no_numbers_are_not_written() -> None:
    net = tiny_net()
    with torch.no_grad():
        net.pooled.bias[0] = 1e6
    with pytest.raises(UsageError, match=r"no finite half-precision numbers: pooled\.bias"):
        encode(net, SPEC)


def test_a_missing_library_is_named_with_the_command_that_installs_it() -> None:
    with pytest.raises(UsageError, match=r"need surely_missing .* pip install 'drive-robust-agents\[train\]'"):
        require("json", "surely_missing", extra="train")
