"""Writes the pages of a run as a folder: the page, its scripts and styles, and the data as scripts beside them."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from pytest_drive_robust import __version__
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import UsageError, first_few
from pytest_drive_robust.regression.comparison_result import Comparison
from pytest_drive_robust.report.film.file_name import film_name
from pytest_drive_robust.report.numbers import legible, shown_beside
from pytest_drive_robust.report.pages.episodes import EpisodeTable
from pytest_drive_robust.report.pages.motion import motion_text, tracks_text
from pytest_drive_robust.report.pages.run_data import run_data
from pytest_drive_robust.report.road_map import RoadMaps, map_data
from pytest_drive_robust.report.run_records import RunRecords
from pytest_drive_robust.store.whole_file import write_whole

MARK = "drive-robust-report.txt"
"""The file that marks a folder as a report; only a marked folder is replaced."""
_PARTS = ("data", "static", "films", "index.html")
_SAYS = "A report of pytest-drive-robust: open index.html. The next report that is written here replaces this one.\n"
_MOST_NAMED = 3


def check_folder(folder: Path, *, source: str, has_begun: bool = False) -> None:
    """Raise `UsageError`, naming `source`, for a file, or for a folder that holds other things than a report.

    Once the run `has_begun`, its other outputs (`--junitxml`, `--drive-json`) may lie there, and only what the report
    would replace counts.
    """
    if os.path.lexists(folder) and not folder.is_dir():
        what = "a file" if folder.exists() else "a link that leads nowhere"
        raise UsageError(f"{source} is {str(folder)!r}, which is {what}; expected a folder, as in {source} report.")
    others = [item.name for item in folder.iterdir()] if folder.is_dir() else []
    if MARK not in others and (set(others) & set(_PARTS) if has_begun else others):
        raise UsageError(
            f"{source} is {str(folder)!r}, which holds other things. Expected a new folder, an empty one, or an "
            f"earlier report, as in {source} {str(folder / 'report')!r}."
        )


def write_pages(
    folder: Path,
    records: RunRecords,
    *,
    comparison: Comparison | None = None,
    before: RunRecords | None = None,
    films: Iterable[Path] = (),
) -> Path:
    """Write the report to `folder` and return the path of its page; an earlier report is replaced.

    The earlier report is replaced after the whole new report is written, so that a full disk leaves the earlier report,
    and two runs that write at the same time leave the report of one of them.

    `films` are videos of `drive-robust replay`, matched to episodes by their names (`film_name`). Raises `UsageError`
    for an unusable folder or a film inside `folder`, `OSError` when writing fails.
    """
    check_folder(folder, source="the folder of the report", has_begun=True)
    films = tuple(films)
    inside = [film for film in films if film.resolve().is_relative_to(folder.resolve())]
    if inside:
        raise UsageError(f"{str(inside[0])!r} lies in {str(folder)!r}, which is replaced. Move the films elsewhere.")
    table = EpisodeTable()
    maps = RoadMaps(records.simulator)
    try:
        data = _spelled_out(run_data(records, table, maps=maps, comparison=comparison, before=before))
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(folder / MARK, _SAYS)
        with TemporaryDirectory(prefix=".new-", dir=folder) as name:
            made = Path(name)
            data["films"] = _copy_films(made, films, table.results)
            data["notes"] += _strangers(films, data["films"].values())
            (made / "data").mkdir()
            _write_routes(made / "data", records, table, maps)
            write_whole(made / "data" / "run.js", _script("run", data))
            _copy_static(made / "static")
            write_whole(made / "index.html", _page(data))
            for part in _PARTS:
                _put_in_place(made, folder, part)
    finally:
        maps.close()
    return folder / "index.html"


def _write_routes(folder: Path, records: RunRecords, table: EpisodeTable, maps: RoadMaps) -> None:
    """Write one file per route, in the order of the episodes: its world, and the motion of its episodes."""
    of_route: dict[str, list[int]] = {}
    for number, result in enumerate(table.results):
        of_route.setdefault(result.episode.route_id, []).append(number)
    for place, (route_id, numbers) in enumerate(of_route.items()):
        seeds = sorted({table.results[number].episode.seed for number in numbers})
        truths = {seed: maps.truth(records.route(route_id), seed) for seed in seeds}
        maps_of = {str(seed): map_data(truth) for seed, truth in truths.items() if truth is not None}
        if maps_of and len({id(truth) for truth in truths.values()}) == 1:  # one world for all seeds
            maps_of = {"any": next(iter(maps_of.values()))}
        motions = {str(n): [motion_text(table.results[n]), tracks_text(table.results[n])] for n in numbers}
        write_whole(folder / f"route-{place}.js", _script(f"route-{place}", {"maps": maps_of, "episodes": motions}))


def _spelled_out(data: Any) -> Any:
    """Return plain data with lone surrogates spelled out (see `legible`), because browsers cannot link to them."""
    if isinstance(data, str):
        return legible(data, controls=True)
    if isinstance(data, Mapping):
        return {_spelled_out(name): _spelled_out(item) for name, item in data.items()}
    return [_spelled_out(item) for item in data] if isinstance(data, (list, tuple)) else data


def _script(name: str, data: Mapping[str, Any]) -> str:
    """Return a script that passes plain data to the page: a page on a disk may load scripts, and nothing else."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)  # ASCII, so without unusual line separators
    return f"driveRobust.give({json.dumps(name)}, {text.replace('<', chr(92) + 'u003c')});\n"


def _page(data: Mapping[str, Any]) -> str:
    """Return the HTML of the page. jinja2 escapes the data in it; the scripts insert all other data."""
    import jinja2

    template = resources.files(__package__).joinpath("templates").joinpath("index.html.j2").read_text(encoding="utf-8")
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True)
    page = environment.from_string(template).render(run=data, version=__version__, shown_beside=shown_beside)
    return page + "\n"


def _copy_static(folder: Path) -> None:
    folder.mkdir()
    for item in resources.files(__package__).joinpath("static").iterdir():
        if item.is_file():
            write_whole(folder / item.name, item.read_bytes())


def _copy_films(folder: Path, films: Iterable[Path], results: Sequence[EpisodeResult]) -> dict[int, str]:
    """Copy the videos of these episodes; return the file names by the number of the episode."""
    numbers: dict[str, int] = {}
    for number, result in enumerate(results):
        numbers.setdefault(film_name(result.episode), number)  # the run wins over the run that it is compared with
    found = {numbers[film.name]: film for film in films if film.name in numbers}
    for film in found.values():
        (folder / "films").mkdir(exist_ok=True)
        shutil.copyfile(film, folder / "films" / film.name)
    return {number: film.name for number, film in found.items()}


def _strangers(films: Iterable[Path], shown: Iterable[str]) -> list[str]:
    """Return a note that names the films of no shown episode; an empty list when there is none."""
    names = sorted({film.name for film in films}.difference(shown))
    if not names:
        return []
    return [f"films of no episode here, which are not shown: {first_few(names, _MOST_NAMED)}"]


def _put_in_place(made: Path, folder: Path, part: str) -> None:
    """Move a part of the new report, if present, from `made` to `folder`, and the earlier part to `made`."""
    if os.path.lexists(folder / part):
        os.replace(folder / part, made / f"former-{part}")
    if (made / part).exists():
        os.replace(made / part, folder / part)
