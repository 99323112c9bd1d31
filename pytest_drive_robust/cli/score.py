"""`drive-robust score` and `export`: official Bench2Drive results in and out."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.domain.route import Route

__all__ = ["add_commands"]

_FORMATS = ("bench2drive",)


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `score` and `export` to the commands of a parser."""
    score = commands.add_parser("score", help="the totals of official Bench2Drive results")
    score.add_argument("results", metavar="FILE_OR_DIR", help="a result JSON, a merged one, or a folder of split ones")
    score.add_argument("--metrics", default="bench2drive", metavar="MODE", help="bench2drive (default) or fixed")
    score.add_argument("--routes", metavar="FILE.xml", help="the route file: names missing routes, tells their types")
    score.add_argument("--metric-dir", metavar="FOLDER", help="where metric_info.json are; default: beside the results")
    score.add_argument(
        "--carla-root",
        metavar="FOLDER",
        help="your CARLA, with --routes: its maps decide Traffic_Signs as in the official tool; no server needed",
    )
    score.add_argument("--json", action="store_true", help="print JSON")
    score.set_defaults(command=_score)

    export = commands.add_parser("export", help="write a run in the schema of an official evaluator")
    export.add_argument("run", metavar="RUN", help="a stored run, latest, or the JSON file of a run")
    export.add_argument("folder", metavar="DIR", help="a new folder")
    export.add_argument("--format", default="bench2drive", metavar="NAME", help="bench2drive (default)")
    export.add_argument(
        "--episodes",
        action="append",
        default=[],
        metavar="FOLDER",
        help="where the stored episodes are, whose ticks metric_info.json is made of; repeatable; default: the store",
    )
    export.set_defaults(command=_export)


def _score(options: argparse.Namespace) -> int:
    from pytest_drive_robust.bench2drive.results.ability_rates import undecided_routes
    from pytest_drive_robust.bench2drive.results.carla_junctions import junction_shares
    from pytest_drive_robust.bench2drive.results.comforts import Comforts
    from pytest_drive_robust.bench2drive.results.official_totals import score_results
    from pytest_drive_robust.bench2drive.results.quirks import notes_on
    from pytest_drive_robust.bench2drive.results.results_file import read_results
    from pytest_drive_robust.errors import UsageError
    from pytest_drive_robust.metrics.guards import require_mode
    from pytest_drive_robust.report.official_score import score_as_json, score_text
    from pytest_drive_robust.simulators.embedded.route_xml import load_routes

    require_mode(options.metrics)
    if options.carla_root and not options.routes:
        raise UsageError("--carla-root needs --routes FILE.xml: the maps tell nothing without the routes on them.")
    results = read_results(Path(options.results))
    routes = load_routes(Path(options.routes)) if options.routes else ()
    scenarios = {route.id: route.scenario.type for route in routes} if options.routes else None
    junctions = None
    if options.carla_root and scenarios is not None:
        wanted = undecided_routes(results.records, scenarios)
        junctions = junction_shares([route for route in routes if route.id in wanted], Path(options.carla_root))
    comforts = Comforts((Path(options.metric_dir),) if options.metric_dir else (results.folder,))
    score = score_results(results, comforts, mode=options.metrics, scenarios=scenarios, junctions=junctions)
    notes = notes_on(score, results, comforts, scenarios=scenarios)
    if options.json:
        import json

        _say(json.dumps(score_as_json(score, notes), indent=2, allow_nan=False))
    else:
        _say(score_text(score, notes, source=options.results))
    return 0


def _export(options: argparse.Namespace) -> int:
    from pytest_drive_robust.bench2drive.results.export import CARLA_FOLDER, export_run
    from pytest_drive_robust.errors import UnknownNameError
    from pytest_drive_robust.regression.document import read_document

    if options.format not in _FORMATS:
        raise UnknownNameError.of("export format", options.format, _FORMATS)
    document = read_document(_run_file(options.run))
    towns, specs = _towns(document)
    written = export_run(document, Path(options.folder), find=_finder(options.episodes), towns=towns)
    for item in written:
        _say(f"{item.folder}: {item.agent} under {item.setting}, seed {item.seed}: {item.records} records")
        if item.broken:
            _say(f"  {item.broken} ended as infra_error: a crashed simulation officially, which counts as 0")
        if item.logs < item.records:
            _say(
                f"  {item.records - item.logs} without metric_info.json: their ticks are not stored, so the official "
                "smoothness tool stops there; name the folder with --episodes"
            )
    _say(f"for the official ability tool: CARLA_ROOT={Path(options.folder) / CARLA_FOLDER}, and the set's routes.xml")
    if specs:
        _say(f"the towns of {', '.join(specs)} are not known; they are written as 'Unknown'")
    return 0


def _run_file(reference: str) -> Path:
    from pytest_drive_robust.regression.runs import RunFolder, home_of

    path = Path(reference)
    if path.suffix == ".json" or path.is_file() or len(path.parts) > 1:
        return path
    return RunFolder(home_of(Path.cwd())).find(reference)


def _towns(document: Mapping[str, Any]) -> tuple[dict[str, str], list[str]]:
    """The town of each route, and the route specifications that are no longer there to look it up."""
    from pytest_drive_robust.errors import UsageError
    from pytest_drive_robust.runner.routes import resolve_routes

    def routes(spec: str) -> tuple[Route, ...]:
        try:
            return resolve_routes(spec)
        except UsageError:
            return ()

    specs = [row.get("routes_spec") for row in document["summaries"] if isinstance(row, dict)]
    found = {spec: routes(spec) for spec in specs if isinstance(spec, str)}
    towns = {route.id: route.town for of_spec in found.values() for route in of_spec}
    return towns, [spec for spec, of_spec in found.items() if not of_spec]


def _finder(folders: list[str]) -> Callable[[str], EpisodeResult | None]:
    """Looks for `KEY.*` in the folders of stored episodes, or in the store of the project."""
    from pytest_drive_robust.errors import UsageError
    from pytest_drive_robust.regression.runs import home_of
    from pytest_drive_robust.store.record_files import read_episode

    given = [Path(folder) for folder in folders]
    for folder in given:
        if not folder.is_dir():
            raise UsageError(f"--episodes is {str(folder)!r}, expected a folder of stored episodes.")
    places = given or [home_of(Path.cwd()) / ".drive-robust" / "episodes"]
    paths = {path.stem: path for place in places for path in sorted(place.rglob("*.*")) if path.is_file()}

    def find(key: str) -> EpisodeResult | None:
        path = paths.get(key)
        if path is None:
            return None
        try:
            return read_episode(path)
        except (OSError, ValueError) as error:
            raise UsageError(f"the stored episode {str(path)!r} cannot be read: {error}.") from None

    return find


def _say(text: str) -> None:
    """Print what any terminal can show: results may hold any character. A reader that stops early is no error."""
    import os

    encoding = sys.stdout.encoding or "utf-8"
    try:
        print(text.encode(encoding, "backslashreplace").decode(encoding), flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
