"""`benchmarks/paper.py`: which of the paper's seven patterns appear, which do not, and which cannot be told."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from _paper import estimates, joining, patterns, patterns_page, results
from _paper.estimates import IntervalEstimate
from _paper.published import AGENTS, CLEAN, FAMILIES
from _paper.readings import DRIVEN, NO_LATENCY, READINGS, SAME, Drives, called_in
from hypothesis import given
from hypothesis import strategies as st
from made_up_drives import ALIKE, as_published, of_shares, paper_reading, report, saved

from pytest_drive_robust.errors import UsageError

WARM = called_in("released", NO_LATENCY)


def verdicts(found: results.Results) -> dict[str, str]:
    return {pattern.key: pattern.verdict for pattern in patterns.patterns_of(Drives(found, READINGS[0]))}


def test_without_a_difference_one_comparison_in_forty_appears() -> None:
    generator = np.random.Generator(np.random.Philox(2))
    studies = 600
    appeared = 0
    for scores in generator.uniform(0.0, 100.0, (studies, 3, 44)):
        clean, first, second = (estimates._means(list(row)) for row in scores)
        appeared += patterns.judge(estimates.gap(1.0 - first / clean, 1.0 - second / clean)) == "appears"
    assert 0.01 < appeared / studies < 0.05


@pytest.mark.parametrize("reading", READINGS)
def test_the_papers_own_table_shows_all_but_the_first_which_simlingo_breaks(tmp_path: Path, reading: str) -> None:
    found = patterns.patterns_of(Drives(joining.read(saved(tmp_path, *map(as_published, AGENTS))), reading))
    assert [pattern.key for pattern in found if pattern.verdict != "appears"] == ["severity"]
    (broken,) = (part for part in found[0].parts if part.verdict != "appears")
    assert broken.what == "simlingo: burst 3 s - burst 1 s"
    for part in (part for pattern in found for part in pattern.parts):
        assert part.estimate is not None
        assert part.estimate.value == pytest.approx(part.paper, abs=1e-3), part.what


def test_more_speed_under_a_failure_is_a_rise_in_efficiency(tmp_path: Path) -> None:
    faster = {setting: 120.0 if setting.startswith("speed") else 100.0 for setting in ALIKE}
    files = saved(tmp_path, report("tcp", ALIKE, efficiency_of=faster), report("uniad", ALIKE))
    found = {pattern.key: pattern for pattern in patterns.patterns_of(Drives(joining.read(files), READINGS[0]))}[
        "speed"
    ]
    assert [found.verdict_of(agent) for agent in ("tcp", "uniad", "vad")] == ["appears", "does not appear", None]
    assert found.parts[0].estimate == IntervalEstimate(20.0, 20.0, 20.0)


def test_rankings_differ_when_the_better_driver_loses_more(tmp_path: Path) -> None:
    fragile = {setting: 1.0 if setting == CLEAN else 0.3 for setting in ALIKE}
    weaker = dict.fromkeys(ALIKE, 0.6)
    assert verdicts(of_shares(tmp_path, {"tcp": fragile, "vad": weaker}))["ranking"] == "appears"
    both = {"tcp": ALIKE, "vad": {setting: 0.6 * share for setting, share in fragile.items()}}
    parts = patterns.patterns_of(paper_reading(tmp_path, both))[-1].parts
    assert {part.what[:9]: part.verdict for part in parts}["tcp - vad"] == "does not appear"


def test_what_both_readings_share_stands_once_among_the_patterns(tmp_path: Path) -> None:
    shares = {agent: dict.fromkeys(DRIVEN, 1.0) for agent in AGENTS}
    for place, setting in enumerate(setting for setting in DRIVEN if setting not in (WARM, *ALIKE)):
        shares["tcp"][setting] = 0.5 + 0.05 * place
    found = of_shares(tmp_path, shares)
    by_reading = {reading: patterns.patterns_of(Drives(found, reading)) for reading in READINGS}
    text = patterns_page.patterns_text(found, by_reading, {})
    assert set(SAME) == {row for family in ("occlusion", "GPS", "speed") for row in FAMILIES[family]}
    for key, times in {"3": 1, "4": 1, "6": 1, "1": 2, "2": 2, "5": 2, "7": 2}.items():
        assert len(re.findall(rf"^\| {key} \|", text, re.MULTILINE)) == times, key
    assert "In both readings: **does not appear**" in text
    assert "In the reading `released`: **" in text


def test_agents_that_drive_alike_have_no_ranking(tmp_path: Path) -> None:
    fragile = {setting: 1.0 if setting == CLEAN else 0.3 for setting in ALIKE}
    parts = patterns.patterns_of(paper_reading(tmp_path, {"tcp": ALIKE, "vad": fragile}))[-1].parts
    assert {part.verdict for part in parts} == {"cannot be told", "not driven"}


@given(bounds=st.tuples(st.floats(-1, 1), st.floats(-1, 1)).map(sorted), needs=st.floats(-0.5, 0.5))
def test_a_verdict_and_its_opposite_exclude_each_other(bounds: list[float], needs: float) -> None:
    low, high = bounds
    verdict = patterns.judge(IntervalEstimate((low + high) / 2.0, low, high), needs)
    mirrored = patterns.judge(IntervalEstimate(-(low + high) / 2.0, -high, -low), -needs)
    assert (verdict == "cannot be told") == (low <= needs < high)
    assert not (verdict == mirrored == "appears")
    assert verdict != "appears" or low > needs


_SAID = st.sampled_from(["appears", "does not appear", "cannot be told", "not driven"])


@given(said=st.lists(_SAID, min_size=1))
def test_all_and_any_are_mirror_images_and_need_every_part(said: list[patterns.Verdict]) -> None:
    turned: dict[str, Any] = {"appears": "does not appear", "does not appear": "appears"}
    mirrored = [turned.get(verdict, verdict) for verdict in said]
    together = patterns.all_of(said)
    assert patterns.any_of(mirrored) == turned.get(together, together)
    assert (together == "appears") == all(verdict == "appears" for verdict in said)
    assert (together == "does not appear") == ("does not appear" in said)


def test_an_explanation_of_no_pattern_is_refused(tmp_path: Path) -> None:
    (tmp_path / "explanations.md").write_text("## gsp\n\ntypo\n", encoding="utf-8")
    known = patterns.patterns_of(paper_reading(tmp_path, {"tcp": ALIKE}))
    with pytest.raises(UsageError, match=r"'gsp'\. The patterns are severity, latency, gps"):
        patterns_page.explanations(tmp_path / "explanations.md", known)
