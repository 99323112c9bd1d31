"""The step summary as Markdown: nothing that people write breaks its tables."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.report.github import VARIABLE, append_step_summary, step_summary
from pytest_drive_robust.report.run_result import RunResult, SettingRow
from pytest_drive_robust.store.events import Judged

WILD = Judged(
    nodeid="test_x.py::test",
    requirement="RD under wild | failure <b>",
    agent="star*",
    routes_spec="r.xml",
    seeds=(0,),
    metric="RD",
    setting="wild",
    comparison="<=",
    limit=0.3,
    verdict="inconclusive",
    value=0.34,
    low=0.2,
    high=0.5,
    routes=14,
    planned=220,
    rule="evidence",
    message="neither\nthe one | nor the other",
)


def run_of(*judged: Judged) -> RunResult:
    return RunResult(RunOptions(), (), judged, {})


def test_pipes_tags_stars_and_line_breaks_stay_within_their_cell() -> None:
    lines = step_summary(run_of(WILD)).splitlines()
    assert lines[0] == "## drive-robust: 0 of 1 requirements hold, 1 inconclusive"
    row = r"| RD under wild \| failure &lt;b&gt; | star\* | 0.34 | 0.20 to 0.50 (90 %) | 14 of 220 | inconclusive |"
    assert row in lines
    assert r"- RD under wild \| failure &lt;b&gt;: neither the one \| nor the other" in lines


def test_what_looks_like_markup_is_shown_as_it_was_said() -> None:
    said = r'Infraction.__init__() got `x` \\| [y](z) of "say \"hi\""'
    lines = step_summary(run_of(replace(WILD, message=said))).splitlines()
    shown = next(line for line in lines if line.startswith("- "))
    assert r'Infraction.\_\_init\_\_() got \`x\` \\\\\| \[y](z) of "say \\"hi\\""' in shown


def test_a_value_is_not_rounded_to_the_limit_of_its_requirement() -> None:
    close = replace(WILD, requirement="RD under wild <= 0.30", value=0.3003)
    assert "| RD under wild &lt;= 0.30 | star\\* | 0.3003 |" in step_summary(run_of(close))


def test_an_interval_is_not_rounded_to_the_limit_or_the_limit_with_its_margin() -> None:
    close = replace(WILD, low=0.2996, high=0.4003, margin=0.1)
    assert "| 0.34 | 0.2996 to 0.4003 (90 %) |" in step_summary(run_of(close))


def test_an_interval_tells_its_level_which_is_that_of_its_rule() -> None:
    run = run_of(WILD, replace(WILD, rule="list"))
    run = replace(run, options=RunOptions(verdict_rule=VerdictRule("auto", alpha=0.01)))
    ends = [line.split(" | ")[3] for line in step_summary(run).splitlines() if line.startswith("| RD under wild")]
    assert ends == ["0.20 to 0.50 (98 %)", "0.20 to 0.50 (95 %)"]


def test_a_run_whose_tests_were_cut_off_says_so_in_its_headline() -> None:
    told = "## drive-robust: 0 of 1 requirements hold, 1 inconclusive, but not all tests came to their verdicts"
    assert step_summary(replace(run_of(WILD), ended_early=True)).splitlines()[0] == told


def test_a_run_that_is_red_for_a_reason_of_its_test_says_so_in_its_headline() -> None:
    told = "## drive-robust: 0 of 1 requirements hold, 1 inconclusive, but 1 test failed for another reason"
    assert step_summary(replace(run_of(WILD), own_verdicts=("test_it",))).splitlines()[0] == told


def test_a_row_that_lacks_episodes_does_not_say_that_the_run_ended_early() -> None:
    row = SettingRow("star", "full", "clean", (0,), needed=4, results=(), summary=None, rd=None, verdict="error")
    told = "## drive-robust: 0 of 1 requirements hold, 1 inconclusive, but not all episodes were driven"
    assert step_summary(replace(run_of(WILD), rows=(row,))).splitlines()[0] == told


def test_a_run_that_asked_for_nothing_writes_nothing(tmp_path: Path) -> None:
    append_step_summary(run_of(), {VARIABLE: str(tmp_path / "summary.md")})
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_written_where_nobody_asks(tmp_path: Path) -> None:
    append_step_summary(run_of(WILD), {})
    append_step_summary(run_of(WILD), {VARIABLE: ""})
    assert list(tmp_path.iterdir()) == []
