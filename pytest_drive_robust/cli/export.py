"""`drive-robust export`: write a run for other tools."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from pytest_drive_robust.bench2drive.results.export import CARLA_FOLDER, export_run
from pytest_drive_robust.cli.references import add_run
from pytest_drive_robust.cli.tables import say
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.regression.references import project_store, read_run_document
from pytest_drive_robust.report.numbers import counted
from pytest_drive_robust.results.mcap_file import write_mcap
from pytest_drive_robust.results.rrd_file import write_rrd
from pytest_drive_robust.results.run import Run, read_run
from pytest_drive_robust.results.table_files import write_csv_tables, write_parquet_tables
from pytest_drive_robust.simulators.routes import resolve_routes
from pytest_drive_robust.store.lookup import stored_episodes

_OFFICIAL = "bench2drive"
_WRITERS: Mapping[str, Callable[[Run, Path], Iterable[Path]]] = {
    "csv": write_csv_tables,
    "parquet": write_parquet_tables,
    "mcap": write_mcap,
    "rrd": write_rrd,
}
_FORMATS = (_OFFICIAL, *_WRITERS)
_DESCRIPTION = """Writes a run for other tools. csv, parquet: the tables episodes, ticks, infractions and requirements.
mcap (Foxglove), rrd (Rerun): one file for each episode with its clean twin; choose few. bench2drive: the files of the
official evaluator. parquet, mcap and rrd need libraries: pip install 'pytest-drive-robust[parquet]'."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `export`."""
    parser.description = _DESCRIPTION
    add_run(parser)
    parser.add_argument(
        "folder",
        metavar="DIR",
        nargs="?",
        help="the folder to write to; default: drive-export, but bench2drive needs the name of a new one",
    )
    parser.add_argument(
        "--format", default=_OFFICIAL, metavar="NAME", help=f"{', '.join(_FORMATS)}; default: {_OFFICIAL}"
    )
    for name, of in (("agent", "of this agent"), ("setting", "under this setting"), ("route", "on this route")):
        parser.add_argument(f"--{name}", metavar=name.upper(), help=f"only episodes {of}")
    parser.add_argument("--seed", type=int, help="only episodes with this seed")
    parser.add_argument(
        "--episodes",
        action="append",
        default=[],
        metavar="FOLDER",
        help="read stored episodes from FOLDER; default: the project's store; repeatable for bench2drive",
    )
    parser.set_defaults(command=_export)


def _export(options: argparse.Namespace) -> int:
    if options.format not in _FORMATS:
        raise UnknownNameError.of("export format", options.format, _FORMATS)
    chosen = {"agent": options.agent, "setting": options.setting, "route_id": options.route, "seed": options.seed}
    if options.format != _OFFICIAL:
        return _write(options, chosen)
    if options.folder is None or any(value is not None for value in chosen.values()):
        raise UsageError(
            f"--format is {_OFFICIAL} (the default), which writes the whole run to a new folder. Give DIR without "
            f"--agent, --setting, --route and --seed, or another --format: {', '.join(_WRITERS)}."
        )
    return _write_official(options)


def _write(options: argparse.Namespace, chosen: Mapping[str, Any]) -> int:
    if len(options.episodes) > 1:
        raise UsageError(f"--episodes is given {len(options.episodes)} times, expected one store.")
    _require_folders(options.episodes)
    folder = Path(options.folder or "drive-export")
    run = read_run(options.run, store=options.episodes[0] if options.episodes else None).select(**chosen)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for path in _WRITERS[options.format](run, folder):
            say(f"{path}: {path.stat().st_size / 1e6:.2f} MB")
    except OSError as error:
        raise UsageError(f"cannot write to {str(folder)!r}: {error.strerror}.") from None
    unread = sum(result.ticks > 0 and not len(result.trace.rows) for result in run.episodes)
    if unread:
        say(
            f"{unread} of {len(run.episodes)} episodes are not in the store, so their ticks are missing. Name the "
            "store that holds them with --episodes."
        )
    return 0


def _write_official(options: argparse.Namespace) -> int:
    _require_folders(options.episodes)
    document = read_run_document(options.run)
    find = stored_episodes(*map(Path, options.episodes or [project_store()]))
    towns, specs = _towns(document)
    written = export_run(document, Path(options.folder), find=find, towns=towns)
    for item in written:
        say(f"{item.folder}: {item.agent} under {item.setting}, seed {item.seed}: {counted(item.records, 'record')}")
        if item.broken:
            say(f"  {item.broken} ended as infra_error: official tools read a crashed simulation and count it as 0")
        if item.logs < item.records:
            say(
                f"  {item.records - item.logs} without metric_info.json, because their ticks were not found: the "
                "official smoothness tool stops there. Name the folder of their episodes with --episodes."
            )
    say(f"for the official ability tool: CARLA_ROOT={Path(options.folder) / CARLA_FOLDER}, and the set's routes.xml")
    if specs:
        say(f"the towns of {', '.join(specs)} are not known; they are written as 'Unknown'")
    return 0


def _towns(document: Mapping[str, Any]) -> tuple[dict[str, str], list[str]]:
    """Return the town of each route, and the route specifications whose routes are not found any more."""

    def routes(spec: str) -> tuple[Route, ...]:
        try:
            return resolve_routes(spec)
        except UsageError:
            return ()

    specs = [row.get("routes_spec") for row in document["summaries"] if isinstance(row, dict)]
    found = {spec: routes(spec) for spec in specs if isinstance(spec, str)}
    towns = {route.id: route.town for of_spec in found.values() for route in of_spec}
    return towns, [spec for spec, of_spec in found.items() if not of_spec]


def _require_folders(folders: Iterable[str]) -> None:
    for folder in folders:
        if not Path(folder).is_dir():
            raise UsageError(f"--episodes is {folder!r}, expected a folder of stored episodes.")
