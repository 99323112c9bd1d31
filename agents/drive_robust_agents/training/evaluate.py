"""`evaluate`: drive candidates of a training in closed loop on validation routes."""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from drive_robust_agents.training.candidates import candidate_name
from drive_robust_agents.training.data.routes import VALIDATION_SEED, validation_routes
from drive_robust_agents.training.drives import degradation, drive, summary
from drive_robust_agents.training.prerequisites import require_positive
from drive_robust_agents.training.recipes.recipe import RECIPES
from pytest_drive_robust import Setting
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.run import DEFAULT_SIMULATOR
from pytest_drive_robust.simulators.routes import resolve_routes
from pytest_drive_robust.store.whole_file import write_whole

__all__ = ["add_arguments", "evaluate", "evaluation_routes", "run"]

_CLEAN = "clean"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `evaluate`."""
    parser.add_argument("--agent", required=True, choices=sorted(RECIPES), help="whose weights")
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--run", type=Path, help="all candidates of a training; the result goes into its folder")
    what.add_argument("--weights", type=Path, nargs="+", help="weight files, each with its manifest.json beside it")
    parser.add_argument(
        "--routes",
        default="1",
        help="N held-out routes of each of the 44 scenario types (default: 1), or what --drive-routes understands",
    )
    parser.add_argument("--settings", nargs="*", default=[], help='also under these, such as "occlusion 0.5"')
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes (all cores)")
    parser.add_argument("--store", type=Path, default=Path(".drive-robust"), help="where episodes are kept")
    parser.add_argument("--json", type=Path, help="write the result here as well")


def run(given: argparse.Namespace) -> int:
    """Evaluate as the options say, print tables, write `evaluation.json`. Raises `UsageError`."""
    require_positive(given, "workers")
    if given.json is not None:  # fail before hours of driving
        given.json.parent.mkdir(parents=True, exist_ok=True)
    found = evaluate(
        given.agent, _files(given), routes_spec=given.routes, settings=given.settings, workers=given.workers,
        store=given.store,
    )  # fmt: skip
    _print(found, Console(width=120))
    if given.run is not None:
        for one in found["candidates"]:
            one["file"] = str(Path(one["file"]).relative_to(given.run.absolute()))
    for file in [given.json] if given.run is None else [given.json, given.run / "evaluation.json"]:
        if file is not None:
            write_whole(file, json.dumps(found, indent=1) + "\n")
    return 0


def evaluate(
    agent: str,
    files: Sequence[Path],
    *,
    routes_spec: str,
    settings: Sequence[str],
    workers: int,
    store: Path,
    simulator: str = DEFAULT_SIMULATOR,
) -> dict[str, Any]:
    """Drive the agents of weight files; `best` in the result is the index of the highest clean driving score.

    A setting with a warm-up is compared with a clean drive with that warm-up.
    """
    described, routes = evaluation_routes(routes_spec)
    names = [candidate_name(agent, file) for file in files]
    baselines = {setting: str(Setting.parse(setting).baseline) for setting in settings if setting != _CLEAN}
    wanted = list(dict.fromkeys([_CLEAN, *baselines.values(), *baselines]))
    driven = drive(names, wanted, routes, workers=workers, store=store, simulator=simulator)
    candidates: list[dict[str, Any]] = []
    for name, file in zip(names, files, strict=True):
        under = {
            setting: summary(driven[name, setting]) | degradation(driven[name, baseline], driven[name, setting])
            for setting, baseline in baselines.items()
        }
        candidates.append({"file": str(file.absolute()), **summary(driven[name, _CLEAN]), "settings": under})
    scores = [one["driving_score"] for one in candidates]
    return {"agent": agent, "routes": described, "best": scores.index(max(scores)), "candidates": candidates}


def evaluation_routes(spec: str) -> tuple[str, Sequence[Route]]:
    """Return (name for a manifest, routes) of `--routes`. Raises `UsageError` for unknown routes."""
    if spec.isdecimal() and int(spec) < 100:  # a number of three digits is the id of a route
        return f"held-out (generator seed {VALIDATION_SEED}), {spec} of each type", validation_routes(
            per_type=int(spec)
        )
    return spec, resolve_routes(spec)


def _files(given: argparse.Namespace) -> list[Path]:
    if given.weights is not None:
        return list(given.weights)
    files = sorted(given.run.glob(f"weights/*/{given.agent}.safetensors"))
    if not files:
        raise UsageError(f"{given.run} holds no weights of {given.agent!r}: train, with the same --run.")
    return [file.absolute() for file in files]


def _print(found: dict[str, Any], console: Console) -> None:
    """Print one line for each candidate and setting, then the scenario types of the best candidate."""
    table = Table(title=f"{found['agent']}: {found['routes']}", box=SIMPLE_HEAD, pad_edge=False)
    for column in ("weights", "setting", "DS", "95 %", "SR", "95 %", "RD", "95 %"):
        table.add_column(column, justify="left" if column in ("weights", "setting") else "right")
    for number, one in enumerate(found["candidates"]):
        mark = " *" if number == found["best"] else ""
        for setting, values in {_CLEAN: one, **one["settings"]}.items():
            table.add_row(Path(one["file"]).parent.name + mark, setting, *_cells(values))
    console.print(table)
    types = Table(title="by scenario type, best weights, clean", box=SIMPLE_HEAD, pad_edge=False)
    for column in ("scenario", "successes", "DS"):
        types.add_column(column, justify="left" if column == "scenario" else "right")
    for name, values in found["candidates"][found["best"]]["by_type"].items():
        types.add_row(name, f"{values['successes']}/{values['episodes']}", f"{values['driving_score']:.1f}")
    console.print(types)


def _cells(values: dict[str, Any]) -> list[str]:
    low, high = values["driving_score_interval"]
    low_share, high_share = values["success_rate_interval"]
    cells = [
        f"{values['driving_score']:.1f}", f"{low:.1f}..{high:.1f}",
        f"{values['success_rate']:.1%}", f"{100 * low_share:.0f}..{100 * high_share:.0f}",
    ]  # fmt: skip
    if values.get("rd") is None:
        return [*cells, "", ""]
    bounds = ["?" if bound is None else f"{bound:.3f}" for bound in values["rd_interval"]]
    return [*cells, f"{values['rd']:.3f}", "..".join(bounds)]
