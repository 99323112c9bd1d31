"""The pages of a real run in Chromium: views, filters, links, keyboard, playing, sizes, accessibility."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from urllib.parse import quote

import pytest
from report_pages import AGENT, EPISODE, REQUIREMENT, VIEWS, data_of
from result_factory import crashed_simulation, infraction, make_result, scored, trace_of

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import End, InfractionKind
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.regression.allowance import Allowance
from pytest_drive_robust.regression.comparison import compare
from pytest_drive_robust.regression.comparison_result import Terms
from pytest_drive_robust.regression.document import snapshot_of
from pytest_drive_robust.report.comparison import conclusion
from pytest_drive_robust.report.failure import replay_command
from pytest_drive_robust.report.film.file_name import film_name
from pytest_drive_robust.report.json_file import run_as_json
from pytest_drive_robust.report.numbers import shown_beside
from pytest_drive_robust.report.pages.folder import write_pages
from pytest_drive_robust.report.run_records import RunRecords
from pytest_drive_robust.report.run_result import RunResult
from pytest_drive_robust.simulators.routes import resolve_routes
from pytest_drive_robust.store.events import EpisodesNeeded, Judged, Used
from pytest_drive_robust.verdict.explain import seconds_text

pytestmark = pytest.mark.slow


def tick(page):
    return page.evaluate("driveRobust.player.tick")


def text(page, selector="h1"):
    return page.locator(selector).first.inner_text()


def test_any_red_requirement_leads_to_its_moment_in_two_clicks(opened):
    report = opened()
    page = report.go()
    assert "broken" in text(page)
    report.follow(page.locator("tr", has=page.locator(".badge.fail")).first.locator("th a"))
    assert "fail" in text(page)
    report.follow(page.locator(".cards a").first)
    page.wait_for_selector("canvas")
    assert page.evaluate("location.hash").startswith(f"#/episode/{AGENT}/")
    assert page.locator(".pane").count() == 2


def test_the_overview_shows_every_setting_and_what_was_chosen(opened):
    report = opened()
    page = report.go()
    assert page.locator(".matrix tbody tr").count() == len(data_of(report.folder)["rows"])
    report.follow(page.get_by_role("link", name="RD", exact=True))
    assert page.locator(".matrix thead th").all_inner_texts() == ["setting", "follower:Follower"]
    report.follow(page.locator(".matrix tbody td a").first)
    assert text(page) == "Episodes"
    assert "agent=" in page.evaluate("location.hash")


def test_a_requirement_shows_its_evidence_and_its_routes(opened):
    report = opened()
    page = report.go(REQUIREMENT)
    assert page.locator("svg.chart circle.point").count() == 4
    assert page.locator("svg.chart a circle.pair").count() == 4
    assert page.locator("table.episodes tbody tr").count() == 4
    report.follow(page.locator("svg.chart a").first)
    page.wait_for_selector("canvas")


def test_failures_are_counted_by_setting_and_open_their_episodes(opened):
    report = opened()
    page = report.go("#/failures")
    run = data_of(report.folder)
    broken = sum(len(cluster["episodes"]) for cluster in run["clusters"])
    assert text(page).startswith(f"{broken} failures")
    cell = page.locator("td.heat a").first
    count = int(cell.inner_text())
    report.follow(cell)
    assert page.locator("table.episodes tbody tr").count() == count
    page.go_back()
    page.wait_for_selector("table.tall")
    report.follow(page.locator("table.tall tbody th a").first)
    assert page.locator("table.episodes tbody tr").count() == len(run["clusters"][0]["episodes"])


def test_searching_and_filtering_keep_their_place_in_the_link(opened):
    report = opened()
    page = report.go("#/episodes")
    assert page.locator("table.episodes tbody tr").count() == 8
    page.get_by_label("Search").fill("opposite gps")
    page.locator("select[name=setting]").select_option("GPS noise 15 m")
    rows = page.locator("table.episodes tbody tr")
    found = rows.count()
    assert 0 < found < 8
    assert all("GPS noise 15 m" in row for row in rows.all_inner_texts())
    report.go(page.evaluate("location.hash"))
    assert page.locator("table.episodes tbody tr").count() == found
    assert page.get_by_label("Search").input_value() == "opposite gps"
    page.locator("button.sort", has_text="DS").last.click()
    scores = [float(word) for word in page.locator("tbody td.number:not(.twin):not(.driven)").all_inner_texts()]
    assert scores == sorted(scores)


def test_an_episode_plays_steps_and_keeps_its_second_in_the_link(opened):
    report = opened()
    page = report.go(EPISODE)
    page.wait_for_selector("canvas")
    assert tick(page) == 80
    page.keyboard.press("ArrowRight")
    assert tick(page) == 81
    page.keyboard.press("Shift+ArrowLeft")
    assert tick(page) == 61
    assert "t=3.0" in page.evaluate("location.hash") or "t=3.1" in page.evaluate("location.hash")
    page.keyboard.press("Home")
    page.keyboard.press("k")
    report.until("driveRobust.player.tick > 3")
    page.keyboard.press("k")
    assert page.evaluate("driveRobust.player.playing") is False
    page.keyboard.press("End")
    assert tick(page) == page.evaluate("driveRobust.player.length")
    page.keyboard.press("p")
    assert tick(page) < page.evaluate("driveRobust.player.length")
    page.get_by_role("button", name="Play").click()
    report.until("driveRobust.player.playing || driveRobust.player.tick >= driveRobust.player.length")


def test_the_scene_has_a_road_the_ego_and_a_plan_and_is_the_same_again(opened):
    page = opened().go(EPISODE)
    page.wait_for_selector("canvas")
    look = """() => {
      const canvas = document.querySelector(".pane.perturbed canvas");
      const context = canvas.getContext("2d");
      const ego = [...context.getImageData(canvas.width / 2 - 3, canvas.height * 0.7 + 6, 1, 1).data];
      const all = context.getImageData(0, 0, canvas.width, canvas.height).data;
      const colours = new Map();
      for (let at = 0; at < all.length; at += 40) {
        const name = `${all[at]},${all[at + 1]},${all[at + 2]}`;
        colours.set(name, (colours.get(name) || 0) + 1);
      }
      return { ego, colours: colours.size, sum: all.reduce((sum, value) => sum + value, 0) };
    }"""
    seen = page.evaluate(look)
    orange = page.evaluate("getComputedStyle(document.documentElement).getPropertyValue('--perturbed').trim()")
    near = [int(orange[at : at + 2], 16) for at in (1, 3, 5)]
    assert all(abs(one - other) <= 12 for one, other in zip(seen["ego"], near, strict=False)), (seen["ego"], near)
    assert seen["colours"] > 20
    page.keyboard.press("ArrowRight")
    assert page.evaluate(look)["sum"] != seen["sum"]
    page.keyboard.press("ArrowLeft")
    assert page.evaluate(look) == seen


def test_an_episode_names_the_command_that_drives_it_again(opened):
    page = opened().go(EPISODE)
    told = page.locator("main code").inner_text()
    assert told == (
        'drive-robust replay 2301 --agent follower:Follower --setting "GPS noise 15 m" --seed 0 --stuck-stop 10'
    )


@pytest.mark.parametrize("simulator", ["bench2drive", "results"])
def test_no_command_is_offered_where_others_drive(opened, tmp_path, reports, simulator):
    folder = shutil.copytree(reports / "now", tmp_path / "report")
    data = folder / "data" / "run.js"
    own = json.dumps(data_of(folder)["options"]["simulator"])
    text, told = re.subn(rf'("simulator": ?){own}', rf'\g<1>"{simulator}"', data.read_text(encoding="utf-8"))
    assert told
    data.write_text(text, encoding="utf-8")
    page = opened(folder).go(EPISODE)
    assert page.locator("table.facts").count() == 1
    assert page.locator("main code").count() == 0


def test_two_runs_are_compared_and_a_flip_opens_both(opened):
    report = opened()
    page = report.go("#/compare")
    rows = data_of(report.folder)["comparison"]["settings"]
    assert page.locator("section").first.locator("tbody tr").count() == len(rows)
    assert sum(len(cell["flips"]) for cell in rows) > 0
    report.follow(page.locator("section", has=page.locator("h2", has_text="Newly")).first.locator("tbody th a").first)
    page.wait_for_selector("canvas")
    assert page.locator("figcaption strong").all_inner_texts()[0].startswith("before:")


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


@pytest.mark.parametrize(("before", "now", "second"), [(100.0, 20.0, "0.0"), (20.0, 100.0, "7.0")])
def test_a_flip_of_an_agent_with_a_new_name_opens_both_at_the_moment_of_the_failing_one(
    opened, tmp_path, before, now, second
):
    ids = [route.id for route in resolve_routes("one-per-scenario")]
    hit = infraction(InfractionKind.RED_LIGHT, second=10.0)
    old = clean_run(*(scored(name, before, agent="old", infractions=[hit] if before < now else []) for name in ids))
    new = clean_run(*(scored(name, now, agent="new") for name in ids))
    snapshots = [snapshot_of(run.document, label=run.label) for run in (old, new)]
    comparison = compare(*snapshots, Terms(kind="list"))
    report = opened(write_pages(tmp_path, new, comparison=comparison, before=old).parent)
    page = report.go("#/compare")
    report.follow(page.locator("section", has=page.locator("h2", has_text="Newly")).locator("tbody th a").first)
    page.wait_for_selector("canvas")
    assert page.evaluate("location.hash").endswith(f"?t={second}&with=before")
    assert page.locator("figcaption strong").all_inner_texts() == ["before: clean", "clean"]


@pytest.mark.parametrize(
    ("driven", "terms", "head"),
    [
        (44, Terms(kind="list"), "It got worse"),
        (43, Terms(kind="list"), "Not compared"),
        (44, Terms(kind="evidence", allowances=(Allowance("SR", 0.0),), open_fails=True), "Inconclusive"),
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


def test_every_episode_shows_its_own_film(opened, tmp_path):
    agents = ("tcp?engine=torch", "my_agent:MyAgent", "агент", "водитель")
    results = [make_result("101", agent=agent, seed=seed) for agent in agents for seed in (0, 1)]
    films = [tmp_path / film_name(result.episode) for result in results[1:]]
    for film in films:
        film.write_bytes(b"film")
    report = opened(write_pages(tmp_path / "report", clean_run(*results), films=films).parent)
    shown = []
    for result in results:
        page = report.go(f"#/episode/{quote(result.episode.agent, safe='')}/clean/101/{result.episode.seed}")
        page.wait_for_selector("canvas")
        shown += [video.get_attribute("src") for video in page.locator("video").all()]
    assert shown == [f"films/{film.name}" for film in films]  # the first episode has none


def judged_as(verdict, value, *, metric="DS", limit=50.0, comparison=">=", agent="driver", setting="clean", **given):
    sentence = f"{metric} under {setting} {comparison} {limit:g}"
    told = {"routes": 2, "planned": 2, "rule": "list", **given}
    scope = ("t", sentence, agent, "one-per-scenario", (0,), metric, setting, comparison, limit)
    return Judged(*scope, verdict, value, **told)


def report_of(folder, *results, judged=(), simulator="embedded", ended_early=False):
    """Write the pages of a run of any settings and agents."""
    found = {str(result.episode): result for result in results}
    keys: dict[tuple[str, str], list[str]] = {}
    for key, result in found.items():
        keys.setdefault((result.episode.agent, result.episode.setting), []).append(key)
    needed = [EpisodesNeeded(agent, "one-per-scenario", name, (0,), tuple(of)) for (agent, name), of in keys.items()]
    run = RunResult.of(RunOptions(simulator=simulator), [*needed, *judged, Used(tuple(found))], found.get, versions={})
    document = run_as_json(replace(run, ended_early=ended_early))
    records = RunRecords.of(document, found.get, default_registry(), label="made up")
    return write_pages(folder, records).parent


LATENCY = "200 ms latency"
HIT = (InfractionKind.COLLISION_VEHICLE,)


def test_failures_are_told_as_shares_of_what_each_agent_drove_under_each_setting(opened, tmp_path):
    clean = [make_result(name, infractions=HIT if name == "101" else ()) for name in ("101", "301", "501", "701")]
    broken = make_result("101", setting=LATENCY, infractions=HIT)
    other = make_result("101", agent="other", infractions=HIT)
    page = opened(report_of(tmp_path, *clean, broken, other)).go("#/failures")
    assert page.locator("tr.driven td.number").all_text_contents() == ["3 of 6", "1 of 4", "1 of 1", "1 of 1"]
    assert page.locator("th.group").all_inner_texts() == ["driver", "other"]
    assert [head.get_attribute("title") for head in page.locator("th.turned").all()] == ["clean", LATENCY, "clean"]
    shades = [cell.evaluate("cell => cell.style.getPropertyValue('--share')") for cell in page.locator("td.heat").all()]
    assert shades == ["20%", "80%", "80%"]
    assert "driver" in page.locator("table.tall tbody tr:nth-child(2) td").nth(1).inner_text()


def test_failures_stand_under_the_agent_that_was_driven_later_and_comes_first_by_name(opened, tmp_path):
    driven = [make_result("101", agent="zoe"), make_result("101", agent="amy", infractions=HIT)]
    page = opened(report_of(tmp_path, *driven)).go("#/failures")
    assert page.locator("th.group").all_inner_texts() == ["amy", "zoe"]
    assert page.locator("tr.driven td.number").all_text_contents() == ["1 of 2", "1 of 1", "0 of 1"]


@pytest.mark.parametrize("ticks", [40, 41])
def test_a_replay_runs_to_the_last_tick_and_tells_how_the_episode_ended(opened, tmp_path, ticks):
    report = opened(report_of(tmp_path, make_result("101", trace=trace_of(ticks), end_detail="arrived")))
    page = report.go("#/episode/driver/clean/101/0")
    page.wait_for_selector("canvas")
    page.keyboard.press("End")
    assert tick(page) == ticks
    assert text(page, ".state") == f"ended at {seconds_text(ticks * 0.05)}: arrived"


def test_what_official_results_do_not_tell_is_not_shown_as_0(opened, tmp_path):
    event = infraction(InfractionKind.COLLISION_VEHICLE, second=0.0)
    result = make_result("101", infractions=[event], trace=trace_of(40))
    for simulator, meters in (("results", 0), ("embedded", 3)):
        page = opened(report_of(tmp_path / simulator, result, simulator=simulator)).go("#/episode/driver/clean/101/0")
        page.wait_for_selector("canvas")
        assert page.locator(".meter").count() == meters
        assert page.locator(".marks .when").all_inner_texts() == ["?", "2.0 s"]
        assert text(page, ".state") == ""
        assert " at " not in text(page, "p.lead")


def test_episodes_of_several_agents_name_theirs(opened, tmp_path):
    results = [make_result("101", agent=name, infractions=HIT) for name in ("driver", "other")]
    report = opened(report_of(tmp_path, *results))
    page = report.go("#/failures")
    report.follow(page.locator("table.tall tbody th a").first)
    assert page.locator("table.episodes td.agent").all_inner_texts() == ["driver", "other"]


@pytest.mark.parametrize(
    ("metric", "comparison", "limit", "told"),
    [
        ("DS", ">=", 50.0, ["DS 20.0", "DS 60.0"]),
        ("efficiency", ">=", 80.0, ["efficiency 40.00, DS 60.0"]),
    ],
)
def test_a_broken_requirement_names_its_worst_routes_and_what_their_numbers_are(
    opened, tmp_path, metric, comparison, limit, told
):
    results = [scored("101", 20.0), make_result("301", infractions=HIT, speed_ratios_pct=(40.0,))]
    judged = judged_as("fail", 40.0, metric=metric, limit=limit, comparison=comparison)
    report = opened(report_of(tmp_path, *results, judged=[judged]))
    page = report.go()
    report.follow(page.locator("table.requirements th a"))
    assert page.locator(".cards p:first-of-type").all_inner_texts() == told


def test_equal_limits_stand_at_equal_places(opened, tmp_path):
    judged = [
        judged_as("pass", 0.1, metric="RD", comparison="<=", limit=0.3, setting=setting, low=low, high=0.2)
        for setting, low in ((LATENCY, -0.9), ("GPS noise 5 m", 0.05))
    ]
    page = opened(report_of(tmp_path, make_result("101"), judged=judged)).go()
    assert len({line.get_attribute("x1") for line in page.locator(".bullet .limit").all()}) == 1
    assert page.locator(".bullet text").all_text_contents() == ["\u22121", "1"], "the ends stand once for each metric"


@pytest.mark.parametrize(
    ("comparison", "limit", "ends"),
    [(">=", 50.0, [(4.0, 100.0), (4.0, 80.8)]), ("<=", 20.0, [(42.4, 196.0), (61.6, 196.0)])],
)
def test_what_a_pass_from_evidence_stays_out_of_is_shaded_more(opened, tmp_path, comparison, limit, ends):
    judged = judged_as(
        "pass", 45.0, limit=limit, comparison=comparison, low=41.0, high=49.0, rule="evidence", margin=10.0
    )
    page = opened(report_of(tmp_path, make_result("101"), judged=[judged])).go()
    drawn = [
        [float(part.get_attribute(name)) for name in ("x", "width")]
        for part in page.locator(".bullet .forbidden").all()
    ]
    assert [(round(x, 3), round(x + width, 3)) for x, width in drawn] == ends, "from the limit and from its margin on"
    assert "more strongly beyond its margin" in text(page, "main .legend")


def test_rules_without_a_margin_have_one_shade(opened, tmp_path):
    page = opened(report_of(tmp_path, make_result("101"), judged=[judged_as("pass", 55.0, rule="point")])).go()
    assert page.locator(".bullet .forbidden").count() == 1
    assert "strong" not in text(page, "main .legend")


@pytest.mark.parametrize(
    ("rule", "level", "interval"),
    [("evidence", "90 %", "90 % interval on routes like these"), ("list", "95 %", "95 % interval 40")],
)
def test_only_evidence_speaks_of_routes_like_these(opened, tmp_path, rule, level, interval):
    judged = judged_as("fail", 45.0, low=40.0, high=49.0, rule=rule, margin=10.0)
    report = opened(report_of(tmp_path, make_result("101"), make_result("301"), judged=[judged]))
    page = report.go()
    assert f"Bar: {level} interval" in text(page, "main")
    report.follow(page.locator("table.requirements th a"))
    assert interval in text(page, ".lead")
    assert ("on routes like these" in text(page, "main")) is (rule == "evidence")
    assert ("not for others" if rule == "list" else "wrong at most 5% of the time") in text(page, ".promise")


def test_an_error_says_why_and_lists_what_broke(opened, tmp_path):
    results = [crashed_simulation("101"), make_result("301")]
    report = opened(report_of(tmp_path, *results, judged=[judged_as("error", None, message="1 of 2 broke")]))
    page = report.go()
    assert text(page) == "0 of 1 requirement holds, 1 error"
    assert text(page, "table.requirements .why") == "1 of 2 broke"
    report.follow(page.locator("table.requirements th a"))
    assert page.locator("table.episodes .story").all_inner_texts() == [
        "simulation crashed at 2.0 s (the server went away)"
    ]
    report.follow(page.locator("table.episodes th a"))
    assert page.locator("table.facts tr", has_text="route completed").inner_text().split() == [
        "route",
        "completed",
        "\u2013",
    ]


def test_an_inconclusive_verdict_is_called_so(opened, tmp_path):
    page = opened(report_of(tmp_path, make_result("101"), judged=[judged_as("inconclusive", 50.0)])).go()
    assert text(page) == "0 of 1 requirement holds, 1 inconclusive"
    assert text(page, ".badge.inconclusive") == "~ inconclusive"


def test_a_run_with_tests_left_does_not_look_like_a_whole_one(opened, tmp_path):
    page = opened(report_of(tmp_path, make_result("101"), judged=[judged_as("pass", 60.0)], ended_early=True)).go()
    assert text(page) == "The requirement holds, but not all tests came to their verdicts"


def test_an_interval_of_rd_ends_as_in_the_terminal(opened, tmp_path):
    judged = judged_as("pass", 0.1, metric="RD", limit=0.3, comparison="<=", setting=LATENCY, low=-2.54, high=0.2)
    report = opened(report_of(tmp_path, make_result("101"), judged=[judged]))
    page = report.go()
    report.follow(page.locator("table.requirements th a"))
    assert "< \u22121 to 0.20" in text(page, ".lead")


def test_a_second_is_rounded_as_in_the_terminal(opened):
    page = opened().go()
    times = [round(tick * 0.05, 2) for tick in range(2000)]
    assert page.evaluate("times => times.map(driveRobust.seconds)", times) == [seconds_text(time) for time in times]


def test_a_number_is_rounded_as_in_the_terminal(opened):
    page = opened().go()
    numbers = [place / 16 for place in range(1601)] + [place / 1000 for place in range(1001)]
    for decimals in range(4):
        shown = page.evaluate(
            "([all, places]) => all.map((one) => driveRobust.fixed(one, places))", [numbers, decimals]
        )
        assert shown == [f"{number:.{decimals}f}" for number in numbers]
    share = "[0.125, -0.125].map((value) => driveRobust.shownBeside(value, 0.12))"
    assert page.evaluate(share) == [shown_beside("SR", 0.125, 0.12), "\u22120.12"]


def test_a_driving_score_is_rounded_once(opened, tmp_path):
    page = opened(report_of(tmp_path, scored("101", 36.2459))).go("#/episodes")
    assert text(page, "td[data-label=DS]") == "36.2"


def test_a_narrow_table_of_episodes_keeps_its_heads_and_is_sorted_by_them(opened):
    report = opened(width=400)
    page = report.go("#/episodes")
    page.locator("button.sort", has_text="DS").last.click()
    scores = [float(word) for word in page.locator("tbody td.number:not(.twin):not(.driven)").all_inner_texts()]
    assert scores == sorted(scores)
    label = "cell => getComputedStyle(cell, '::before').content"
    assert page.locator("tbody td.number:not(.twin):not(.driven)").first.evaluate(label) == '"DS "'
    assert page.locator("tbody td.route").first.evaluate(label) == '"route "'


@pytest.mark.parametrize("width", [400, 600, 800, 1280])
def test_no_word_of_a_plot_is_cut(opened, width):
    page = opened(width=width).go(REQUIREMENT)
    cut = """() => [...document.querySelectorAll("svg.chart")].flatMap((plot) => {
      const frame = plot.getBoundingClientRect();
      return [...plot.querySelectorAll("text")].filter((word) => {
        const box = word.getBoundingClientRect();
        return box.left < frame.left - 0.5 || box.right > frame.right + 0.5 || box.bottom > frame.bottom + 0.5;
      }).map((word) => word.textContent);
    })"""
    assert page.evaluate(cut) == []
    columns = page.evaluate(
        "getComputedStyle(document.querySelector('.columns')).gridTemplateColumns.split(' ').length"
    )
    assert columns == (2 if width > 1000 else 1)


def test_the_legend_of_a_replay_names_all_that_is_drawn(opened):
    page = opened().go(EPISODE)
    page.wait_for_selector("canvas")
    names = {name for item in page.locator(".player .swatch").all() for name in item.get_attribute("class").split()}
    assert {"clean", "perturbed", "twin", "route", "plan", "wrong", "parted", "told"} <= names
    colour = "name => getComputedStyle(document.documentElement).getPropertyValue(name)"
    assert page.evaluate(colour, "--wrong") != page.evaluate(colour, "--plan")
    below = """() => {
      const strips = document.querySelector("canvas.strips");
      const high = Math.round(13 * strips.height / strips.clientHeight);
      const axis = strips.getContext("2d").getImageData(0, strips.height - high, strips.width, high).data;
      return axis.filter((value, at) => at % 4 === 3 && value > 0).length;
    }"""
    assert page.evaluate(below) > 100


def test_a_replay_is_quiet_and_leaves_the_keys_of_a_film_alone(opened, tmp_path):
    result = make_result("101")
    film = tmp_path / film_name(result.episode)
    film.write_bytes(b"film")
    report = opened(write_pages(tmp_path / "report", clean_run(result), films=[film]).parent)
    page = report.go("#/episode/driver/clean/101/0")
    page.wait_for_selector("canvas")
    assert page.locator("output.clock").get_attribute("aria-live") == "off"
    assert page.locator("video").get_attribute("aria-label") == "What driver saw under clean on route 101"
    page.locator("video").focus()
    page.keyboard.press(" ")
    assert page.evaluate("driveRobust.player.playing") is False


def test_the_same_sentence_on_other_routes_has_its_own_row_and_page(opened, tmp_path):
    found = {name: scored(name, score) for name, score in (("101", 100.0), ("301", 20.0))}
    needed = [EpisodesNeeded("driver", name, "clean", (0,), (name,)) for name in found]
    judged = [
        Judged("t", "DS under clean >= 50", "driver", name, (0,), "DS", "clean", ">=", 50.0, word, value, routes=1)
        for name, word, value in (("101", "pass", 100.0), ("301", "fail", 20.0))
    ]
    run = RunResult.of(RunOptions(simulator="embedded"), [*needed, *judged, Used(tuple(found))], found.get, versions={})
    records = RunRecords.of(run_as_json(run), found.get, default_registry(), label="two sets")
    report = opened(write_pages(tmp_path, records).parent)
    page = report.go("#/?metric=DS")
    assert page.locator(".matrix tbody th").all_inner_texts() == ["clean on 101", "clean on 301"]
    assert page.locator(".matrix tbody td").all_inner_texts() == ["100.00", "20.00"]
    report.follow(page.locator("tr", has=page.locator(".badge.fail")).first.locator("th a"))
    assert text(page).endswith("fail DS under clean >= 50 on 301")
    assert "DS is 20.00" in page.locator("main").inner_text()


def test_a_metric_of_a_user_is_shown_as_precisely_as_in_the_table(opened, tmp_path):
    judged = Judged("t", "late under clean <= 0.03", "driver", "one-per-scenario", (0,), "late", "clean", "<=", 0.03,
                    "fail", 0.04, routes=1)  # fmt: skip
    page = opened(write_pages(tmp_path, clean_run(make_result("101"), judged=[judged])).parent).go()
    assert "0.04" in page.locator("table.requirements td.number").first.inner_text()


def test_a_value_is_not_rounded_to_its_limit(opened, tmp_path):
    judged = [
        Judged("t", sentence, "driver", "one-per-scenario", (0,), metric, "clean", ">=", limit, "fail", value, routes=1)
        for sentence, metric, limit, value in (
            ("DS under clean >= 70", "DS", 70.0, 69.97),
            ("SR under clean >= 0.50", "SR", 0.5, 0.4996),
        )
    ]
    report = opened(write_pages(tmp_path, clean_run(make_result("101"), judged=judged)).parent)
    page = report.go()
    assert page.locator("table.requirements tbody tr td:nth-child(4)").all_inner_texts() == ["69.97", "0.4996"]
    told = [title.text_content() for title in page.locator("svg.bullet title").all()]
    assert told[0].startswith("DS 69.97, ")
    assert told[0].endswith("limit >= 70")
    assert told[1].endswith("limit >= 0.50")
    report.follow(page.locator("table.requirements th a").first)
    assert "DS is 69.97; the limit is >= 70." in page.locator("main").inner_text()
    plain = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert "<td>DS under clean &gt;= 70</td><td>driver</td><td>69.97</td>" in plain


def test_an_episode_that_ended_before_its_first_tick_does_not_play_its_twin(opened, tmp_path):
    setting = "200 ms latency"
    broken = make_result("101", setting=setting, end=End.AGENT_CRASHED, end_detail="ValueError: no", trace=trace_of(0))
    found = {"clean": make_result("101"), setting: replace(broken, ticks=0)}
    needed = [EpisodesNeeded("driver", "one-per-scenario", name, (0,), (name,)) for name in found]
    run = RunResult.of(RunOptions(simulator="embedded"), [*needed, Used(tuple(found))], found.get, versions={})
    records = RunRecords.of(run_as_json(run), found.get, default_registry(), label="broken")
    page = opened(write_pages(tmp_path, records).parent).go(f"#/episode/driver/{quote(setting)}/101/0")
    assert "It ended before its first tick, so there is nothing to replay: ValueError: no" in text(page, "main")
    assert page.locator("canvas").count() == 0


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 768, 1280])
def test_every_view_fits_every_width(opened, width, scheme):
    report = opened(width=width, scheme=scheme)
    for view in VIEWS:
        page = report.go(view)
        assert page.evaluate("document.documentElement.scrollWidth") <= width, view
        shade = page.evaluate("getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)")
        assert (sum(shade) > 600) is (scheme == "light")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_no_fault(opened, scheme):
    axe = resources.files("axe_playwright_python").joinpath("axe.min.js").read_text(encoding="utf-8")
    report = opened(scheme=scheme)
    for view in VIEWS:
        page = report.go(view)
        page.evaluate(f"{axe}\n;0")
        found = page.evaluate("axe.run(document, { preload: false }).then(result => result.violations)")
        assert [(item["id"], [node["html"] for node in item["nodes"]][:3]) for item in found] == [], view


def test_the_keyboard_reaches_the_content_first_and_the_theme_is_switched(opened):
    page = opened().go()
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.className") == "skip"
    before = page.evaluate("getComputedStyle(document.body).backgroundColor")
    page.locator("#theme").click()
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") != before


def test_it_prints_without_what_only_a_screen_needs(opened):
    page = opened().go(EPISODE)
    page.emulate_media(media="print")
    assert not page.locator("nav").is_visible()
    assert not page.locator(".controls").is_visible()
    assert page.locator(".pane canvas").first.is_visible()


def test_what_is_not_there_says_so(opened):
    report = opened()
    assert text(report.go("#/nowhere")) == "There is no such view"
    assert text(report.go(f"#/episode/{AGENT}/clean/0/0")) == "No such episode"
    assert text(report.go("#/requirement/a/b")) == "No such requirement"


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


def test_a_folder_without_its_data_says_what_is_missing(browser, reports, tmp_path):
    (tmp_path / "index.html").write_bytes((reports / "now" / "index.html").read_bytes())
    (tmp_path / "static").symlink_to(reports / "now" / "static")
    page = browser.new_page()
    page.goto((tmp_path / "index.html").as_uri())
    page.wait_for_selector("h1")
    assert text(page) == "The data is not there"
    page.close()


def test_the_verdicts_are_there_without_scripts(reports):
    page = (reports / "now" / "index.html").read_text(encoding="utf-8")
    for item in json.loads((reports / ".drive-robust" / "runs" / "now.json").read_text())["requirements"]:
        assert (
            f"<td>{item['verdict']}</td><td>{item['requirement'].replace('<', '&lt;').replace('>', '&gt;')}</td>"
            in page
        )
