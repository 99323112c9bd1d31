"""What people read about a comparison."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st
from snapshot_factory import PRINT, cell, snapshot, with_versions

from pytest_drive_robust.regression.allowance import parse_allowances
from pytest_drive_robust.regression.comparison import compare
from pytest_drive_robust.regression.comparison_result import Terms
from pytest_drive_robust.regression.snapshot import Snapshot
from pytest_drive_robust.report.comparison import comparison_text, conclusion

GOOD = [100.0] * 40


def test_an_unchanged_run_on_few_routes_is_one_row_and_no_story() -> None:
    few = snapshot(cell([100.0, 50.0]), label="few")
    lines = comparison_text(compare(few, few), colour=False).splitlines()
    assert lines[0] == "few -> few"
    assert lines[2].split()[-1] == "pass"
    assert lines[3:] == ["no regression: not one score changed in 1 setting against few"]


def test_an_open_verdict_on_changed_scores_says_what_was_seen() -> None:
    before, after = snapshot(cell([100.0, 50.0])), snapshot(cell([80.0, 50.0], seed=1))
    text = comparison_text(compare(before, after), colour=False)
    assert "driver under clean: 1 of 2 routes changed" in text
    assert "neither shown nor ruled out: DS drops by 5 % at most; 75.00 -> 65.00 (-13.3 %) on 2 routes" in text


def test_a_drop_is_not_rounded_to_what_is_allowed() -> None:
    before, after = snapshot(cell([80.0] * 40)), snapshot(cell([75.99] * 40))
    allowed = Terms(parse_allowances(["ds:-5%", "ds:-4.005"], source="--fail-on"), rule="point")
    text = comparison_text(compare(before, after, allowed), colour=False)
    assert "broken: DS drops by 5 % at most; 80.00 -> 75.99 (-5.01 %) on 40 routes" in text
    assert "broken: DS drops by 4.005 at most; 80.00 -> 75.99 (-4.01) on 40 routes" in text


@given(
    st.lists(st.tuples(st.integers(1, 6), st.integers(0, 3), st.integers(0, 3)), min_size=1, max_size=3),
    st.integers(0, 2),
    st.integers(0, 2),
)
def test_the_conclusion_claims_no_more_than_was_compared(
    cells: list[tuple[int, int, int]], only_old: int, only_new: int
) -> None:
    """Each cell: how many routes both runs hold, the old one only, the new one only."""

    def run_of(own: int, others: int, label: str) -> Snapshot:
        of_settings = [
            {str(n): 50.0 for n in range(common)} | {f"{label} {n}": 50.0 for n in range(counts[own])}
            for common, *counts in cells
        ]
        lone = [cell([50.0], setting=f"{label} setting {n}") for n in range(others)]
        return snapshot(*(cell(scores, setting=f"s{n}") for n, scores in enumerate(of_settings)), *lone, label=label)

    told = conclusion(compare(run_of(0, only_old, "old"), run_of(1, only_new, "new"), Terms(policy="warn")))
    settings = len(cells) + only_old + only_new
    compared, held = sum(common for common, *_ in cells), sum(map(sum, cells))
    assert (" of " in told) == (compared < held or len(cells) < settings)
    assert told.startswith("no regression")
    assert "not one score changed" in told
    if compared < held:
        both = {(common, common + old + new) for common, old, new in cells}
        share = "{} of {} routes".format(*both.pop()) if len(both) == 1 else f"{compared} of {held} scores"
        assert f" on {share} in " in told
    if len(cells) < settings:
        assert f" in {len(cells)} of {settings} settings" in told


def test_many_flips_are_cut_and_the_others_named() -> None:
    text = comparison_text(compare(snapshot(cell(GOOD)), snapshot(cell([10.0] * 40))), colour=False)
    assert text.count("newly failing: ") == 6
    assert text.count("replay:  ") == 5
    assert "  and 35 more newly failing: " in text
    assert text.splitlines()[-1] == "REGRESSION: 1 of 1 setting against run: driver under clean"


def test_no_replay_is_offered_where_others_drive() -> None:
    evaluated = replace(PRINT, simulator="bench2drive")
    before, after = (snapshot(cell([ds] * 40, fingerprint=evaluated)) for ds in (100.0, 10.0))
    text = comparison_text(compare(before, after), colour=False)
    assert "newly failing: " in text
    assert "replay" not in text


def test_every_line_but_a_replay_fits_into_100_columns() -> None:
    setting = "occlusion 0.5 and 3 s burst frame drop and GPS noise 15 m and speed noise 0.2 and 200 ms latency"
    before = snapshot(cell(GOOD, agent="an_agent_with_a_long_name", setting=setting))
    after = snapshot(cell([10.0] * 40, agent="an_agent_with_a_long_name", setting=setting))
    table = comparison_text(compare(before, after), colour=False).split("an_agent_with_a_long_name under")[0]
    assert all(len(line) <= 100 for line in table.splitlines())


def test_a_refused_comparison_shows_no_verdict() -> None:
    after = snapshot(cell(GOOD, fingerprint=with_versions(fake="2", numpy="3.0")), label="new")
    comparison = compare(snapshot(cell(GOOD), label="old"), after)
    assert comparison_text(comparison, colour=False).splitlines() == [
        "old -> new",
        "refused: the simulator was fake (1) and is fake (2)",
        "warning: numpy was 2.0 and is 3.0",
        conclusion(comparison),
    ]
    assert conclusion(comparison).startswith("NOT COMPARED with old: the simulator was fake (1) and is fake (2). ")


def test_colours_come_on_request_only() -> None:
    comparison = compare(snapshot(cell(GOOD)), snapshot(cell(GOOD)))
    assert "\x1b[" in comparison_text(comparison, colour=True)
    assert "\x1b[" not in comparison_text(comparison, colour=False)
