"""Nothing that a run is called becomes markup or script, and all of it has its links."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from result_factory import make_result

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.report.failure import replay_command
from pytest_drive_robust.report.json_file import run_as_json
from pytest_drive_robust.report.pages.folder import write_pages
from pytest_drive_robust.report.run_records import RunRecords
from pytest_drive_robust.report.run_result import RunResult
from pytest_drive_robust.store.events import EpisodesNeeded, Used

pytestmark = pytest.mark.slow


def odd_report(folder: Path, name: str) -> Path:
    """Write the pages of a run whose every name is `name`."""
    result = replace(make_result("101", agent=name, scenario=name), end_detail=name)
    events = [EpisodesNeeded(name, name, "clean", (0,), ("k",)), Used(("k",))]
    run = RunResult.of(
        RunOptions(simulator="embedded"), events, {"k": result}.get, versions={name: name}, notes=(name,)
    )
    records = RunRecords.of(run_as_json(run), {"k": result}.get, default_registry(), label=name)
    return write_pages(folder, records).parent


def test_nothing_of_a_run_becomes_markup_or_script(opened, tmp_path):
    evil = '</script><img src=x onerror="window.broken=1"><b>&amp;\'`${1}'
    report = opened(odd_report(tmp_path, evil))
    for view in ("#/", "#/episodes", "#/failures"):
        page = report.go(view)
        assert page.locator("main img, main b").count() == 0
        assert page.evaluate("window.broken") is None
    assert evil in page.title()
    report.go("#/episodes")
    report.follow(page.locator("table.episodes th a").first)
    page.wait_for_selector("canvas")
    assert evil in page.locator("main").inner_text()


def test_a_name_that_is_no_unicode_has_its_links_too(opened, tmp_path):
    report = opened(odd_report(tmp_path, "\ud83d half"))
    page = report.go("#/episodes")
    report.follow(page.locator("table.episodes th a").first)
    page.wait_for_selector("canvas")
    assert r"\ud83d half" in page.locator("main").inner_text()


def test_the_command_of_an_odd_name_is_that_of_the_terminal(opened, tmp_path):
    odd = "it's \"$odd`\\!x"
    report = opened(odd_report(tmp_path, odd))
    page = report.follow(report.go("#/episodes").locator("table.episodes th a").first)
    episode = Episode(odd, "101", "clean", 0)
    assert page.locator("main code").inner_text() == replay_command(episode, RunOptions(), routes_spec=odd)


def test_the_policy_lets_no_other_script_in(browser, reports):
    page = browser.new_page()
    page.goto((reports / "now" / "index.html").as_uri())
    page.wait_for_selector("html[data-ready]")
    page.evaluate("""() => {
      const inline = document.createElement("script");
      inline.textContent = "window.broken = 1";
      document.head.append(inline);
      const button = document.createElement("button");
      button.setAttribute("onclick", "window.broken = 2");
      document.body.append(button);
      button.click();
    }""")
    assert page.evaluate("window.broken") is None
    refused = page.evaluate("fetch('https://example.invalid/').then(() => 'sent', () => 'refused')")
    assert refused == "refused"
    page.close()
