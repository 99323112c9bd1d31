"""`drive-robust score`: the totals of official Bench2Drive results."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from pytest_drive_robust.bench2drive.results.carla_junctions import junction_shares
from pytest_drive_robust.bench2drive.results.motion_log import Comforts
from pytest_drive_robust.bench2drive.results.official_totals import score_results, undecided_routes
from pytest_drive_robust.bench2drive.results.quirks import foreign_records, notes_on
from pytest_drive_robust.bench2drive.results.results_file import read_results
from pytest_drive_robust.cli.pytest_options import add_pytest_option
from pytest_drive_robust.cli.tables import say
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.metrics.episodes import require_mode
from pytest_drive_robust.report.official_score import score_as_json, score_text
from pytest_drive_robust.simulators.embedded.route_xml import load_routes


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `score`."""
    parser.add_argument(
        "results", metavar="FILE_OR_DIR", help="a result JSON, a merged one, or the folder of its parts"
    )
    add_pytest_option(parser, "--metrics")
    parser.add_argument(
        "--routes", metavar="FILE.xml", help="read this route file, to show abilities and missing routes"
    )
    parser.add_argument(
        "--metric-dir",
        metavar="FOLDER",
        help="look for metric_info.json files, which comfort needs, below FOLDER; default: beside the results",
    )
    parser.add_argument(
        "--carla-root",
        metavar="FOLDER",
        help="with --routes, read the maps of CARLA in FOLDER: the official ability Traffic_Signs needs them, but no "
        "server",
    )
    parser.add_argument("--json", action="store_true", help="print JSON in place of text")
    parser.set_defaults(command=_score)


def _score(options: argparse.Namespace) -> int:
    require_mode(options.metrics)
    if options.carla_root and not options.routes:
        raise UsageError("--carla-root needs --routes FILE.xml: the maps tell nothing without the routes on them.")
    if options.metric_dir and not Path(options.metric_dir).is_dir():
        raise UsageError(f"--metric-dir is {options.metric_dir!r}, expected a folder above metric_info.json files.")
    results = read_results(Path(options.results))
    routes = load_routes(Path(options.routes)) if options.routes else ()
    scenarios = {route.id: route.scenario.type for route in routes} if options.routes else None
    if scenarios is not None:
        foreign = foreign_records(results.records, scenarios, mode=options.metrics)
        if len(foreign) == len(results.records):
            raise UsageError(
                f"--routes {options.routes} has none of the routes of the results (first: {foreign[0].route!a}). "
                "Give the route file that the results were driven on."
            )
    junctions = None
    if options.carla_root and scenarios is not None:
        wanted = undecided_routes(results.records, scenarios)
        junctions = junction_shares([route for route in routes if route.id in wanted], Path(options.carla_root))
    comforts = Comforts((Path(options.metric_dir),) if options.metric_dir else (results.folder,))
    score = score_results(results, comforts, mode=options.metrics, scenarios=scenarios, junctions=junctions)
    notes = notes_on(score, results, comforts, scenarios=scenarios)
    if options.json:
        say(json.dumps(score_as_json(score, notes), indent=2, allow_nan=False))
    else:
        say(score_text(score, notes, source=options.results))
    return 0
