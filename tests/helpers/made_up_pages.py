"""Writes the pages of made-up runs, and reads what a page of them shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pytest_drive_robust.domain.outcome import InfractionKind
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.report.json_file import run_as_json
from pytest_drive_robust.report.pages.folder import write_pages
from pytest_drive_robust.report.run_records import RunRecords
from pytest_drive_robust.report.run_result import RunResult
from pytest_drive_robust.store.events import EpisodesNeeded, Judged, Used

LATENCY = "200 ms latency"
HIT = (InfractionKind.COLLISION_VEHICLE,)


def tick(page):
    return page.evaluate("driveRobust.player.tick")


def text(page, selector="h1"):
    return page.locator(selector).first.inner_text()


def clean_run(*results: EpisodeResult, judged: Sequence[Judged] = ()) -> RunRecords:
    """Return a run of clean episodes."""
    found = {str(result.episode): result for result in results}
    keys: dict[str, list[str]] = {}
    for key, result in found.items():
        keys.setdefault(result.episode.agent, []).append(key)
    needed = [
        EpisodesNeeded(agent, "one-per-scenario", "clean", (0,), tuple(of_agent)) for agent, of_agent in keys.items()
    ]
    run = RunResult.of(RunOptions(simulator="embedded"), [*needed, *judged, Used(tuple(found))], found.get, versions={})
    return RunRecords.of(run_as_json(run), found.get, default_registry(), label=", ".join(keys))


def judged_as(verdict, value, *, metric="DS", limit=50.0, comparison=">=", setting="clean", **given):
    sentence = f"{metric} under {setting} {comparison} {limit:g}"
    told = {"routes": 2, "planned": 2, "rule": "list", **given}
    scope = ("t", sentence, "driver", "one-per-scenario", (0,), metric, setting, comparison, limit)
    return Judged(*scope, verdict, value, **told)


def report_of(folder, *results, judged=(), simulator="embedded", **ended):
    """Write the pages of a run of any settings and agents; `ended` has `ended_early` and `stopped_tests`."""
    found = {str(result.episode): result for result in results}
    keys: dict[tuple[str, str], list[str]] = {}
    for key, result in found.items():
        keys.setdefault((result.episode.agent, result.episode.setting), []).append(key)
    needed = [EpisodesNeeded(agent, "one-per-scenario", name, (0,), tuple(of)) for (agent, name), of in keys.items()]
    run = RunResult.of(RunOptions(simulator=simulator), [*needed, *judged, Used(tuple(found))], found.get, versions={})
    document = run_as_json(replace(run, **ended))
    records = RunRecords.of(document, found.get, default_registry(), label="made up")
    return write_pages(folder, records).parent
