"""Graphs follow from a network's specification, not from what it learnt."""

# ruff: noqa: E402 - without torch, which is an extra, these tests are skipped before the imports that need it

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

torch = pytest.importorskip("torch")
onnx = pytest.importorskip("onnx")

from tiny_tcp import published

from drive_robust_agents._nets.manifest import read_manifest, write_entry
from drive_robust_agents._nets.weights import SHIPPED
from drive_robust_agents.training.__main__ import main


def test_two_trainings_of_one_network_have_equal_graphs(tmp_path: Path) -> None:
    files = [published(tmp_path / str(seed), seed=seed) for seed in (1, 2)]
    assert files[0].read_bytes() != files[1].read_bytes()
    assert files[0].with_suffix(".onnx").read_bytes() == files[1].with_suffix(".onnx").read_bytes()


def test_the_command_writes_what_lacks_and_lists_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = published(tmp_path)
    graph, listed = file.with_suffix(".onnx"), read_manifest(tmp_path, "tcp")
    content = graph.read_bytes()
    graph.unlink()
    (tmp_path / "manifest.json").unlink()
    write_entry(tmp_path, replace(listed, graphs={}))
    assert main(["graphs", str(file)]) == 0
    assert f"{graph}: forward of {listed.label}, {len(content)} bytes" in capsys.readouterr().out
    assert graph.read_bytes() == content
    assert read_manifest(tmp_path, "tcp") == listed


@pytest.mark.parametrize("graph", sorted(SHIPPED.glob("*.onnx")), ids=lambda path: path.stem)
def test_a_graph_that_ships_holds_no_weights_and_no_paths(graph: Path) -> None:
    model = onnx.load(graph, load_external_data=False)
    assert {tensor.data_location for tensor in model.graph.initializer} == {onnx.TensorProto.EXTERNAL}
    assert not any(node.doc_string for node in model.graph.node)
    assert b".py" not in graph.read_bytes()
