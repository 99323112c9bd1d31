"""Requirements in Chromium: evidence, intervals, limits, what each verdict is called."""

from __future__ import annotations

from dataclasses import replace

import pytest
from made_up_pages import HIT, LATENCY, clean_run, judged_as, report_of, text
from report_pages import REQUIREMENT
from result_factory import crashed_simulation, make_result, scored

from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.report.json_file import run_as_json
from pytest_drive_robust.report.pages.folder import write_pages
from pytest_drive_robust.report.run_records import RunRecords
from pytest_drive_robust.report.run_result import RunResult
from pytest_drive_robust.store.events import EpisodesNeeded, Judged, Used

pytestmark = pytest.mark.slow


def test_a_requirement_shows_its_evidence_and_its_routes(opened):
    report = opened()
    page = report.go(REQUIREMENT)
    assert page.locator("svg.chart circle.point").count() == 4
    assert page.locator("svg.chart a circle.pair").count() == 4
    axes = ["routes read", "RD", "clean driving score", "perturbed driving score"]
    assert page.locator("svg.chart text.label").all_text_contents() == axes
    assert page.locator("table.episodes tbody tr").count() == 4
    report.follow(page.locator("svg.chart a").first)
    page.wait_for_selector("canvas")


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


def test_tests_that_state_the_same_of_the_same_routes_are_told_apart(opened, tmp_path):
    judged = [
        replace(judged_as("pass", 55.0), nodeid="a/test_it.py::TestIt::test_paper[ds-clean-ge-50]"),
        replace(judged_as("pass", 55.0), nodeid="a/test_it.py::test_released[ds-clean-ge-50]"),
        judged_as("pass", 1.0, metric="SR", limit=0.5),
    ]
    page = opened(report_of(tmp_path, make_result("101"), judged=judged)).go()
    assert page.locator("table.requirements th a").all_inner_texts() == [
        "DS under clean >= 50, in test_paper",
        "DS under clean >= 50, in test_released",
        "SR under clean >= 0.5",
    ]


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


@pytest.mark.parametrize(
    ("ended", "told"),
    [
        ({"ended_early": True}, "but not all tests came to their verdicts"),
        ({"stopped_tests": ("test_it",)}, "but 1 test stopped before the end"),
        ({"own_verdicts": ("test_it", "test_that")}, "but 2 tests failed for another reason"),
    ],
)
def test_a_run_that_is_red_in_another_way_does_not_look_green(opened, tmp_path, ended, told):
    page = opened(report_of(tmp_path, make_result("101"), judged=[judged_as("pass", 60.0)], **ended)).go()
    assert text(page) == f"The requirement holds, {told}"


def test_an_interval_of_rd_ends_as_in_the_terminal(opened, tmp_path):
    judged = judged_as("pass", 0.1, metric="RD", limit=0.3, comparison="<=", setting=LATENCY, low=-2.54, high=0.2)
    report = opened(report_of(tmp_path, make_result("101"), judged=[judged]))
    page = report.go()
    report.follow(page.locator("table.requirements th a"))
    assert "< \u22121 to 0.20" in text(page, ".lead")


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
