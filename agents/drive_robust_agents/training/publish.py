"""`publish`: copy the best weights into the package (or another folder), with their driving score."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from drive_robust_agents._nets.weights import SHIPPED
from drive_robust_agents.training.loop.export import publish
from drive_robust_agents.training.recipes.recipe import RECIPES, recipe_of
from pytest_drive_robust.errors import UsageError

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `publish`."""
    parser.add_argument("--agent", required=True, choices=sorted(RECIPES), help="whose weights")
    parser.add_argument("--run", type=Path, required=True, help="folder of the training, evaluated before")
    parser.add_argument("--version", required=True, help="new weights, same network: 1.1; another network or rig: 2.0")
    parser.add_argument("--to", type=Path, default=SHIPPED, help="folder (that of the package)")
    parser.add_argument("--note", default="", help="where it was trained, for the manifest")


def run(given: argparse.Namespace) -> int:
    """Publish the best candidate of the last evaluation."""
    file = given.run / "evaluation.json"
    if not file.is_file():
        raise UsageError(f"there is no {file}: candidates are chosen by how they drive, so evaluate the run first.")
    found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    best = found["candidates"][found["best"]]
    entry = publish(
        given.run / best["file"],
        given.to,
        recipe=recipe_of(given.agent),
        version=given.version,
        score={name: value for name, value in best.items() if name != "file"} | {"routes": found["routes"]},
        note=given.note,
    )
    print(f"{entry.label} is in {given.to}")
    return 0
