"""Episodes in Chromium: playing, the scene, films, the command that drives one again."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from urllib.parse import quote

import numpy as np
import pytest
from made_up_pages import LATENCY, clean_run, report_of, text, tick
from report_pages import EPISODE, data_of
from result_factory import infraction, make_result, trace_of

from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind
from pytest_drive_robust.domain.result import Given, Reception, Touch
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.report.film.file_name import film_name
from pytest_drive_robust.report.json_file import run_as_json
from pytest_drive_robust.report.pages.folder import write_pages
from pytest_drive_robust.report.run_records import RunRecords
from pytest_drive_robust.report.run_result import RunResult
from pytest_drive_robust.store.events import EpisodesNeeded, Used
from pytest_drive_robust.verdict.explain import seconds_text

pytestmark = pytest.mark.slow
SAMPLE = Path(__file__).parents[2] / "docs" / "extra" / "sample-report"


def drawn(page):
    """Return the lines that the player draws, as (colour, whether it is broken), and the words."""
    return page.evaluate("""() => {
      const pen = CanvasRenderingContext2D.prototype;
      const { stroke, fillText } = pen;
      const [lines, words] = [[], []];
      pen.stroke = function (...of) {
        lines.push([this.strokeStyle, this.getLineDash().length > 0]);
        stroke.apply(this, of);
      };
      pen.fillText = function (...of) {
        words.push(of[0]);
        fillText.apply(this, of);
      };
      driveRobust.player.fit();
      Object.assign(pen, { stroke, fillText });
      return { lines, words };
    }""")


def colour(page, name):
    return page.evaluate(f"getComputedStyle(document.documentElement).getPropertyValue('--{name}').trim()")


def test_an_episode_plays_steps_and_keeps_its_second_in_the_link(opened):
    report = opened()
    page = report.go(EPISODE)
    page.wait_for_selector("canvas")
    assert tick(page) == 80
    page.locator(".player").focus()
    page.keyboard.press("ArrowRight")
    assert tick(page) == 81
    page.keyboard.press("Shift+ArrowLeft")
    assert tick(page) == 61
    assert "t=3.0" in page.evaluate("location.hash") or "t=3.1" in page.evaluate("location.hash")
    page.keyboard.press("Home")
    page.keyboard.press("k")
    report.until("driveRobust.player.tick > 3")
    page.keyboard.press("Escape")
    assert page.evaluate("driveRobust.player.playing") is False
    page.keyboard.press("End")
    assert tick(page) == page.evaluate("driveRobust.player.length")
    page.keyboard.press("p")
    assert tick(page) < page.evaluate("driveRobust.player.length")
    page.get_by_role("button", name="Play").click()
    report.until("driveRobust.player.playing || driveRobust.player.tick >= driveRobust.player.length")


def test_keys_are_explained_in_an_enlarged_page_too(opened):
    page = opened(width=640, height=450).go(EPISODE)  # 1280 x 900 at 200 %
    page.wait_for_selector("canvas")
    assert page.locator(".keys").is_visible()
    assert page.evaluate("document.documentElement.scrollWidth") <= 640


def test_what_happened_leads_to_what_was_before_and_says_so(opened):
    page = opened(SAMPLE).go("#/episode/classical/200%20ms%20latency/3301/0?t=0")
    page.wait_for_selector("canvas")
    page.get_by_role("button", name="hit van").click()
    assert tick(page) == 330
    assert text(page, "#told") == "16.5 s, before: hit van at 23 km/h"
    page.get_by_role("button", name="Next event").click()
    assert text(page, "#told") == "18.5 s: hit van at 23 km/h"
    page.get_by_role("button", name="Previous event").click()
    assert tick(page) < 330
    assert "next and previous event" in text(page, ".keys")


def test_keys_act_only_while_the_player_has_the_focus(opened):
    page = opened().go(EPISODE)
    page.wait_for_selector("canvas")
    for key in ("j", "l", "n", "p", "k", "+", "-", "End", "ArrowRight", " "):
        page.keyboard.press(key)
    assert tick(page) == 80
    assert page.evaluate("[driveRobust.player.playing, driveRobust.player.speed]") == [False, 1]
    page.locator(".pane canvas").first.click()
    page.keyboard.press("l")
    assert tick(page) == 180
    assert "act while the player has the focus" in text(page, ".keys")


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
    page.locator(".player").focus()
    page.keyboard.press("ArrowRight")
    assert page.evaluate(look)["sum"] != seen["sum"]
    page.keyboard.press("ArrowLeft")
    assert page.evaluate(look) == seen


def test_what_was_hit_and_when_the_two_diverged_stand_where_they_are_read_first(opened, tmp_path):
    hit = Infraction(InfractionKind.COLLISION_VEHICLE, 40, "hit van at 6.4 m/s")
    clean = make_result("101", trace=trace_of(60))
    late = make_result("101", setting=LATENCY, infractions=[hit], trace=trace_of(60, speed_mps=3.0))
    report = opened(report_of(tmp_path, clean, late))
    page = report.go("#/episodes?q=van")
    told = "completed, hit van (23 km/h) at 2.0 s"
    assert page.locator("table.episodes .story").all_inner_texts() == [told]
    report.follow(page.locator("table.episodes th a"))
    diverged = "diverged from its clean twin at 0.1 s in speed"
    assert text(page, ".lead") == f"driver under {LATENCY}: {told}; {diverged}"


def test_an_episode_leads_back_to_the_requirements_that_read_it(opened):
    report = opened(SAMPLE)
    page = report.go("#/episode/classical/200%20ms%20latency/3301/0")
    page.wait_for_selector("canvas")
    ways = ["RD under 200 ms latency <= 0.20", LATENCY, "SignalizedJunctionLeftTurnEnterFlow"]
    assert page.locator(".crumbs a").all_inner_texts() == ways
    report.follow(page.locator(".crumbs a").first)
    assert text(page).endswith("pass RD under 200 ms latency <= 0.20")
    page = opened().go(EPISODE)
    page.wait_for_selector("canvas")
    both = "RD under GPS noise 15 m <= 0.01, SR under GPS noise 15 m >= 0.99 / GPS noise 15 m / "
    assert text(page, ".crumbs").startswith(both)


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


@pytest.mark.parametrize("ticks", [40, 41])
def test_a_replay_runs_to_the_last_tick_and_tells_how_the_episode_ended(opened, tmp_path, ticks):
    report = opened(report_of(tmp_path, make_result("101", trace=trace_of(ticks), end_detail="arrived")))
    page = report.go("#/episode/driver/clean/101/0")
    page.wait_for_selector("canvas")
    page.locator(".player").focus()
    page.keyboard.press("End")
    assert tick(page) == ticks
    assert text(page, ".state") == f"ended at {seconds_text(ticks * 0.05)}: arrived"


def test_the_second_of_the_end_is_shown_once_and_rounded_as_the_others(opened, tmp_path):
    result = make_result("101", trace=trace_of(187), end_detail=f"reached the end at {187 * 0.05:.1f} s")
    page = opened(report_of(tmp_path, replace(result, ticks=187))).go("#/episode/driver/clean/101/0")
    page.wait_for_selector("canvas")
    assert "9.3 s" in result.end_detail
    assert "9.3 s" not in text(page, "main")
    assert text(page, ".events li") == "9.4 s reached the end"
    page.locator(".player").focus()
    page.keyboard.press("End")
    assert text(page, ".state") == "ended at 9.4 s: reached the end"


def test_what_official_results_do_not_tell_is_not_shown_as_0(opened, tmp_path):
    event = infraction(InfractionKind.COLLISION_VEHICLE, second=0.0)
    result = make_result("101", infractions=[event], trace=trace_of(40))
    for simulator, meters in (("results", 0), ("embedded", 3)):
        page = opened(report_of(tmp_path / simulator, result, simulator=simulator)).go("#/episode/driver/clean/101/0")
        page.wait_for_selector("canvas")
        assert page.locator(".meter").count() == meters
        assert page.locator(".events .when").all_inner_texts() == ["?", "2.0 s"]
        assert text(page, ".state") == ""
        assert " at " not in text(page, "p.lead")


def test_the_legend_of_a_replay_names_all_that_is_drawn(opened):
    page = opened().go(EPISODE)
    page.wait_for_selector("canvas")
    names = {name for item in page.locator(".player .swatch").all() for name in item.get_attribute("class").split()}
    assert {"clean", "perturbed", "twin", "route", "plan", "wrong", "parted", "told"} <= names
    assert colour(page, "wrong") != colour(page, "plan")
    below = """() => {
      const strips = document.querySelector("canvas.strips");
      const high = Math.round(13 * strips.height / strips.clientHeight);
      const axis = strips.getContext("2d").getImageData(0, strips.height - high, strips.width, high).data;
      return axis.filter((value, at) => at % 4 === 3 && value > 0).length;
    }"""
    assert page.evaluate(below) > 100


def test_the_place_of_what_goes_wrong_is_ringed_before_it_happens(opened, tmp_path):
    hit = Infraction(InfractionKind.COLLISION_VEHICLE, 40, "hit van at 6.4 m/s", x_m=12.0)
    report = opened(report_of(tmp_path, make_result("101", infractions=[hit], trace=trace_of(60))))
    for second, broken in ((0.0, True), (2.5, False)):
        page = report.go(f"#/episode/driver/clean/101/0?t={second}")
        page.wait_for_selector("canvas")
        assert [colour(page, "wrong"), broken] in drawn(page)["lines"]
        assert [colour(page, "wrong"), True] not in drawn(page)["lines"] or broken


def test_a_perturbed_gps_tells_by_how_much_it_is_off(opened):
    page = opened().go(EPISODE)
    page.wait_for_selector("canvas")
    assert re.fullmatch(r"GPS off by \d+ m", text(page, ".pane.perturbed .told"))
    assert text(page, ".pane.clean .told") == ""


def test_how_wrong_a_signal_is_counts_for_the_tick_in_which_it_was_given(opened, tmp_path):
    ticks = np.arange(60)
    speed = 20.0 - 0.2 * np.arange(61)  # brakes, at the beginning of each tick and at the end
    x = np.cumsum(speed) * 0.05
    given = np.column_stack((ticks, x[:60], 0.0 * ticks, 0.0 * ticks, speed[:60]))
    given[40:, 1] += 4.0
    touched = tuple(Touch(signal, 60, 0) for signal in ("gps", "speed"))
    result = replace(
        make_result(
            "101", setting="GPS noise 15 m and speed noise 0.2", trace=trace_of(60, x_m=x[1:], speed_mps=speed[1:])
        ),
        reception=Reception((), ("gps", "speed"), 60, touched),
        given=Given(given.astype(np.float32)),
    )
    report = opened(report_of(tmp_path, result))
    for second, told in ((1.95, ""), (2.15, "GPS off by 4 m")):
        page = report.go(f"#/episode/driver/GPS%20noise%2015%20m%20and%20speed%20noise%200.2/101/0?t={second}")
        page.wait_for_selector("canvas")
        assert text(page, ".told") == told


def test_lights_are_told_apart_without_their_colours(opened):
    page = opened(SAMPLE).go("#/episode/classical/200%20ms%20latency/3301/0?t=15.5")
    page.wait_for_selector("canvas")
    lines = drawn(page)["lines"]
    assert [colour(page, "green"), True] in lines
    assert [colour(page, "red"), False] in lines
    assert [colour(page, "red"), True] not in lines
    assert page.locator(".legend .swatch.light").count() == 1


def test_an_episode_without_a_fault_ends_without_the_colour_of_one(opened):
    page = opened(SAMPLE).go("#/episode/classical/GPS%20noise%2015%20m/1301/0")
    page.wait_for_selector("canvas")
    assert colour(page, "wrong") not in [line for line, _ in drawn(page)["lines"]]


def test_the_numbers_of_a_replay_say_what_they_are(opened):
    page = opened(SAMPLE).go("#/episode/classical/200%20ms%20latency/3301/0?t=15.5")
    page.wait_for_selector("canvas")
    names = {"speed, 0 to 31 km/h", "throttle, 0 to 1", "brake, 0 to 1", "steer, left is up"}
    assert names <= set(drawn(page)["words"])
    assert "200 ms latency DS 60 \u2717" in page.locator(".chips a").all_inner_texts()
    assert text(page, "table.facts tbody th") == "driving score (DS)"


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


def test_an_episode_that_ended_before_its_first_tick_does_not_play_its_twin(opened, tmp_path):
    setting = LATENCY
    broken = make_result("101", setting=setting, end=End.AGENT_CRASHED, end_detail="ValueError: no", trace=trace_of(0))
    found = {"clean": make_result("101"), setting: replace(broken, ticks=0)}
    needed = [EpisodesNeeded("driver", "one-per-scenario", name, (0,), (name,)) for name in found]
    run = RunResult.of(RunOptions(simulator="embedded"), [*needed, Used(tuple(found))], found.get, versions={})
    records = RunRecords.of(run_as_json(run), found.get, default_registry(), label="broken")
    page = opened(write_pages(tmp_path, records).parent).go(f"#/episode/driver/{quote(setting)}/101/0")
    assert "It ended before its first tick, so there is nothing to replay: ValueError: no" in text(page, "main")
    assert page.locator("canvas").count() == 0
