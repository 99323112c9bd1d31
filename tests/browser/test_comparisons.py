"""Two runs compared in Chromium: what got worse, and flips that open both."""

from __future__ import annotations

from dataclasses import replace

import pytest
from made_up_pages import clean_run, text
from report_pages import data_of
from result_factory import infraction, make_result, scored

from pytest_drive_robust.domain.outcome import Infraction, InfractionKind
from pytest_drive_robust.regression.allowance import Allowance
from pytest_drive_robust.regression.comparison import compare
from pytest_drive_robust.regression.comparison_result import Terms
from pytest_drive_robust.regression.document import snapshot_of
from pytest_drive_robust.report.comparison import conclusion
from pytest_drive_robust.report.pages.folder import write_pages
from pytest_drive_robust.simulators.routes import resolve_routes

pytestmark = pytest.mark.slow


def test_two_runs_are_compared_and_a_flip_opens_both(opened):
    report = opened()
    page = report.go("#/compare")
    rows = data_of(report.folder)["comparison"]["settings"]
    assert page.locator("section").first.locator("tbody tr").count() == len(rows)
    assert sum(len(cell["flips"]) for cell in rows) > 0
    newly = page.locator("section", has=page.locator("h2", has_text="Newly")).first
    assert newly.locator("td strong").all_inner_texts()[:2] == ["DS 100.0", "DS 50.0"]
    report.follow(newly.locator("tbody th a").first)
    page.wait_for_selector("canvas")
    assert page.locator("figcaption strong").all_inner_texts()[0].startswith("before:")


@pytest.mark.parametrize(("before", "now", "second"), [(100.0, 20.0, "0.0"), (20.0, 100.0, "7.0")])
def test_a_flip_of_an_agent_with_a_new_name_opens_both_at_the_moment_of_the_failing_one(
    opened, tmp_path, before, now, second
):
    ids = [route.id for route in resolve_routes("one-per-scenario")]
    hit = infraction(InfractionKind.RED_LIGHT, second=10.0)
    old = clean_run(*(scored(name, before, agent="old", infractions=[hit] if before < now else []) for name in ids))
    new = clean_run(*(scored(name, now, agent="new") for name in ids))
    snapshots = [snapshot_of(run.document, label=run.label) for run in (old, new)]
    comparison = compare(*snapshots, Terms(rule="list"))
    report = opened(write_pages(tmp_path, new, comparison=comparison, before=old).parent)
    page = report.go("#/compare")
    report.follow(page.locator("section", has=page.locator("h2", has_text="Newly")).locator("tbody th a").first)
    page.wait_for_selector("canvas")
    assert page.evaluate("location.hash").endswith(f"?t={second}&with=before")
    assert page.locator("figcaption strong").all_inner_texts() == ["before: clean", "clean"]


def test_a_flip_says_what_was_hit_and_how_fast_and_when_the_run_before_was_stored(opened, tmp_path):
    ids = [route.id for route in resolve_routes("one-per-scenario")]
    hit = Infraction(InfractionKind.COLLISION_VEHICLE, 40, "hit van at 6.4 m/s")
    told = "completed, hit van (23 km/h) at 2.0 s"
    runs = [clean_run(*(make_result(name, infractions=found) for name in ids)) for found in ([], [hit])]
    stored = {"name": "main", "date": "2026-11-30T01:03:50+01:00", "commit": "1a2b3c4"}
    documents = [{**run.document, "stored": stored} for run in runs]
    snapshots = [snapshot_of(document, label="main") for document in documents]
    for place, (one, other) in enumerate([(0, 1), (1, 0)]):
        comparison = compare(snapshots[one], snapshots[other], Terms(rule="list"))
        now = replace(runs[other], document=documents[other])
        report = opened(write_pages(tmp_path / str(place), now, comparison=comparison, before=runs[one]).parent)
        cells = (
            report.go("#/compare").locator("section", has_text="Newly").locator("tbody tr").first.locator("td .soft")
        )
        assert cells.all_inner_texts() == [("completed", told)[one], ("completed", told)[other]]
        assert report.page.get_by_text("before: main (2026-11-30 00:03 UTC, 1a2b3c4); now: main").count() == 1
        assert "driver, 2026-11-30 00:03 UTC, 1a2b3c4" in text(report.go(), "dl.facts")


@pytest.mark.parametrize(
    ("driven", "terms", "head"),
    [
        (44, Terms(rule="list"), "It got worse"),
        (43, Terms(rule="list"), "Not compared"),
        (44, Terms(rule="evidence", allowances=(Allowance("SR", 0.0),), open_fails=True), "Inconclusive"),
    ],
    ids=["worse", "refused", "open"],
)
def test_a_comparison_is_called_what_its_conclusion_says(opened, tmp_path, driven, terms, head):
    ids = [route.id for route in resolve_routes("one-per-scenario")]
    old = clean_run(*(scored(name, 100.0) for name in ids))
    broken = 1 if head == "Inconclusive" else driven
    new = clean_run(*(scored(name, 20.0 if place < broken else 100.0) for place, name in enumerate(ids[:driven])))
    comparison = compare(*(snapshot_of(run.document, label=run.label) for run in (old, new)), terms)
    assert comparison.regressed
    page = opened(write_pages(tmp_path, new, comparison=comparison).parent).go("#/compare")
    assert text(page) == head
    assert text(page, ".lead") == conclusion(comparison)
