"""What a page tells of a requirement: its limit and margin, its worst routes, what its verdict promises."""

from __future__ import annotations

import pytest
from report_pages import SETTING, data_of, records
from result_factory import crashed_simulation, make_result, scored

from pytest_drive_robust.domain.outcome import End
from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.report.pages.folder import write_pages
from pytest_drive_robust.store.events import Judged
from pytest_drive_robust.verdict.sentences import requirements


def test_the_limit_and_the_margin_are_those_of_the_rule(tmp_path):
    judged = Judged("t", "efficiency under clean >= 60", "driver", "one-per-scenario", (0,), "efficiency", "clean",
                    ">=", 60.0, "pass", 80.0, 55.0, 90.0, 1, planned=44, rule="evidence")  # fmt: skip
    given = records(make_result("101"), judged=[judged])
    write_pages(tmp_path, given)
    rule = VerdictRule("evidence", margin=given.document["settings"]["margin"])
    (item,) = data_of(tmp_path)["requirements"]
    assert 60.0 - item["lenient"] == pytest.approx(requirements(judged.requirement)[0].margin(rule))


@pytest.mark.parametrize(
    ("metric", "comparison", "limit", "lenient"),
    [("DS", ">=", 5.0, 2.5), ("SR", ">=", 0.05, 0.025), ("RD", "<=", 0.9, 0.95), ("RD", "<=", 0.3, 0.4)],
)
def test_the_margin_of_a_page_ends_within_the_range(tmp_path, metric, comparison, limit, lenient):
    judged = Judged("t", "a sentence", "driver", "one-per-scenario", (0,), metric, SETTING, comparison, limit,
                    "inconclusive", limit, routes=1, planned=44, rule="evidence")  # fmt: skip
    write_pages(tmp_path, records(make_result("101"), make_result("101", setting=SETTING), judged=[judged]))
    (item,) = data_of(tmp_path)["requirements"]
    assert item["lenient"] == lenient


def requirement_of(tmp_path, *results, **given):
    judged = Judged("t", "a sentence", "driver", "one-per-scenario", (0,), **given)
    write_pages(tmp_path, records(*results, judged=[judged]))
    return data_of(tmp_path)


def routes_of(data, numbers):
    words, columns = data["episodes"]["words"], data["episodes"]
    return [(words[columns["setting"][number]], words[columns["route"][number]]) for number in numbers]


@pytest.mark.parametrize(
    ("metric", "comparison", "worst"),
    [("RD", "<=", ["101"]), ("DS", ">=", ["301", "101"]), ("SR", ">=", ["301", "101"])],
)
def test_the_worst_routes_are_those_that_the_terminal_names(tmp_path, metric, comparison, worst):
    clean = [scored("101", 100.0), scored("301", 20.0)]
    perturbed = [scored("101", 60.0, setting=SETTING), scored("301", 20.0, setting=SETTING)]
    data = requirement_of(tmp_path, *clean, *perturbed, metric=metric, setting=SETTING, comparison=comparison,
                          limit=0.1, verdict="fail", value=0.0, routes=2, planned=2, rule="point")  # fmt: skip
    (item,) = data["requirements"]
    assert routes_of(data, [number for number, *_ in item["worst"]]) == [(SETTING, name) for name in worst]
    assert [values for _, *values in item["worst"]] == [[None, None]] * len(worst)


def test_a_metric_of_its_own_ranks_the_routes_and_tells_its_values(tmp_path):
    slow = make_result("101", speed_ratios_pct=(40.0,))
    data = requirement_of(tmp_path, slow, make_result("301"), metric="efficiency", setting="clean", comparison=">=",
                          limit=80.0, verdict="fail", value=70.0, routes=2, planned=2, rule="point")  # fmt: skip
    (item,) = data["requirements"]
    assert routes_of(data, [number for number, *_ in item["worst"]]) == [("clean", "101")]
    assert item["worst"][0][1:] == [None, 40.0]


@pytest.mark.parametrize(
    ("rule", "verdict", "routes", "level", "told"),
    [
        ("evidence", "pass", 2, "90 %", "Shown: DS > 65 on routes like these, wrong at most 5% of the time."),
        ("evidence", "fail", 2, "90 %", "Shown: DS < 70 on routes like these, wrong at most 5% of the time."),
        ("evidence", "inconclusive", 2, "90 %", ""),
        ("list", "pass", 2, "95 %", "Decided for exactly these 2 routes and their seeds, not for others."),
        ("point", "fail", 2, "95 %", "Compared with the limit for exactly these 2 routes and their seeds, not for "
                                     "others."),
    ],
)  # fmt: skip
def test_a_requirement_tells_what_its_verdict_promises_and_the_level_of_its_interval(
    tmp_path, rule, verdict, routes, level, told
):
    data = requirement_of(tmp_path, make_result("101"), make_result("301"), metric="DS", setting="clean",
                          comparison=">=", limit=70.0, verdict=verdict, value=70.0, routes=routes, planned=2,
                          rule=rule, margin=5.0 if rule == "evidence" else 0.0)  # fmt: skip
    (item,) = data["requirements"]
    assert (item["level"], item["promise"]) == (level, told)


def test_an_error_names_the_episodes_that_broke_and_those_of_its_clean_twins(tmp_path):
    other = "500 ms latency"
    results = [
        crashed_simulation("101"), make_result("301"), make_result("101", setting=SETTING),
        make_result("301", setting=SETTING, end=End.AGENT_CRASHED), crashed_simulation("101", setting=other),
    ]  # fmt: skip
    given = {"metric": "RD", "setting": SETTING, "comparison": "<=", "limit": 0.3, "verdict": "error"}
    data = requirement_of(tmp_path / "rd", *results, **given)
    assert routes_of(data, data["requirements"][0]["broken"]) == [("clean", "101"), (SETTING, "301")]
    data = requirement_of(tmp_path / "ds", *results, **{**given, "metric": "DS"})
    assert routes_of(data, data["requirements"][0]["broken"]) == [(SETTING, "301")]
