"""`graphs`: write graphs for ONNX Runtime beside weight files, and list the graphs in the manifest."""

from __future__ import annotations

import argparse
from pathlib import Path

from drive_robust_agents._nets.manifest import write_entry
from drive_robust_agents._nets.weights import SHIPPED, locate, verified_bytes
from drive_robust_agents.training.loop.onnx_graphs import write_graphs
from drive_robust_agents.training.recipes.recipe import recipe_of

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `graphs`."""
    shipped = sorted(SHIPPED.glob("*.safetensors"))
    parser.add_argument(
        "files", nargs="*", type=Path, default=shipped, metavar="AGENT.safetensors", help="(those that ship)"
    )


def run(given: argparse.Namespace) -> int:
    """Write the graphs of each weight file. Raises `UsageError` for a file that differs from its manifest."""
    for file in given.files:
        path, entry = locate(file.stem, file)
        content = verified_bytes(path, entry)
        entry = write_graphs(recipe_of(file.stem).make(entry.spec), path, content, entry)
        write_entry(path.parent, entry)
        for method, graph in entry.graphs.items():
            print(f"{path.with_name(graph.file)}: {method} of {entry.label}, {graph.size_bytes} bytes")
    return 0
