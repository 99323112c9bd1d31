"""`benchmarks/paper.py`: from reports to the committed results, table, patterns and pictures."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import paper_table
import pytest
from _paper import estimates, figures, patterns, published, reading, results, texts
from _paper.estimates import IntervalEstimate
from _paper.published import AGENTS, CLEAN, PUBLISHED, SETTINGS
from hypothesis import given
from hypothesis import strategies as st
from made_up_drives import CLEAN_DS, report, saved
from matplotlib.figure import Figure

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.errors import ComparisonError, UsageError
from pytest_drive_robust.metrics.efficiency import efficiency
from pytest_drive_robust.stats.intervals import ratio_interval

ROOT = Path(__file__).parents[2]
ALIKE = dict.fromkeys((CLEAN, *SETTINGS), 1.0)
PICTURES = ("rd_heatmap.svg", "retention_radar.svg", "latency_curves.svg")


def as_published(agent: str) -> dict[str, Any]:
    """A report that has the paper's own figures, without noise."""
    rows, best = PUBLISHED[agent], PUBLISHED["simlingo"][CLEAN].ds
    shares = {setting: row.ds / best for setting, row in rows.items()}
    return report(agent, shares, efficiency_of={setting: row.efficiency for setting, row in rows.items()})


def drawn(files: list[Path], folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(ROOT / "benchmarks" / "paper.py"), *map(str, files), "--write", str(folder)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def of_shares(tmp_path: Path, shares: Mapping[str, Mapping[str, float]]) -> results.Results:
    return reading.read(saved(tmp_path, *(report(agent, of) for agent, of in shares.items())))


# ---- the front door


@pytest.fixture(scope="module")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two of the four agents; one of them without one setting, and something is said about a pattern."""
    folder = tmp_path_factory.mktemp("rendered")
    (folder / "explanations.md").write_text("# Why\n\n## gps\n\nThe planner pops early.\n", encoding="utf-8")
    lacking = {setting: share for setting, share in ALIKE.items() if setting != "occlusion 0.8"}
    files = saved(folder, report("simlingo", lacking), as_published("tcp"))
    done = drawn([*files], folder)
    assert done.returncode == 0, done.stderr
    assert "8 routes, tcp, simlingo" in done.stdout
    return folder


def test_everything_is_drawn_again_from_the_committed_file_to_the_last_byte(rendered: Path, tmp_path: Path) -> None:
    (tmp_path / "explanations.md").write_bytes((rendered / "explanations.md").read_bytes())
    done = drawn([rendered / "results.json"], tmp_path)
    assert done.returncode == 0, done.stderr
    for name in ("results.json", "table.md", "patterns.md", *PICTURES):
        assert (tmp_path / name).read_bytes() == (rendered / name).read_bytes(), name


def test_what_was_not_driven_is_missing_and_not_zero(rendered: Path) -> None:
    table = (rendered / "table.md").read_text(encoding="utf-8")
    assert "Not driven: uniad, vad, simlingo under 1 of 11 settings." in table
    assert re.search(r"^\| uniad \| - \| - \| - \| 45\.8 \|", table, re.MULTILINE)
    assert re.search(r"^\| occlusion 0\.8 \| - \| - \| - \| - \| - \| 14\.8 \|", table, re.MULTILINE)
    assert "## uniad" not in table
    assert list(json.loads((rendered / "results.json").read_text(encoding="utf-8"))["agents"]) == ["tcp", "simlingo"]


def test_the_table_holds_our_figures_beside_the_papers(rendered: Path) -> None:
    table = (rendered / "table.md").read_text(encoding="utf-8")
    assert "| GPS noise 15 m | 18.4 | 0.0 | 0.65 | 0.65 to 0.65 | 58 | 21.1 | 0.5 | 0.65 | 58 |" in table
    assert "| GPS noise 15 m | 0.65 (0.65) | - (0.55) | - (0.62) | 0.00 (-0.02) |" in table
    assert max(map(len, table.splitlines())) <= 100


def test_an_explanation_stands_with_its_pattern(rendered: Path) -> None:
    text = (rendered / "patterns.md").read_text(encoding="utf-8")
    _, _, section = text.partition("## 3. GPS")
    assert "The planner pops early." in section.partition("## 4.")[0]


@pytest.mark.parametrize("name", PICTURES)
def test_pictures_are_small_and_undated(rendered: Path, name: str) -> None:
    text = (rendered / name).read_text(encoding="utf-8")
    assert text.rstrip().endswith("</svg>")
    assert "<dc:date>" not in text
    assert len(text) < 300_000


def test_refused_files_leave_nothing_behind(tmp_path: Path) -> None:
    broken = report("tcp", ALIKE)
    broken["episodes"][3]["driving_score"] = None
    done = drawn([*saved(tmp_path, broken)], tmp_path / "out")
    assert done.returncode == 1
    assert "tcp under clean: no score on 401" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()


# ---- reading


def dropped_route(document: dict[str, Any]) -> None:
    del document["episodes"][len(CLEAN_DS)]


def renamed_agent(document: dict[str, Any]) -> None:
    for episode in document["episodes"]:
        episode["agent"] = "classical"


def two_seeds(document: dict[str, Any]) -> None:
    document["settings"]["seeds"] = [0, 1]


def without_episodes(document: dict[str, Any]) -> None:
    document["episodes"] = []


def standing_agent(document: dict[str, Any]) -> None:
    for episode in document["episodes"]:
        episode["driving_score"] = 0.0


@pytest.mark.parametrize(
    ("spoil", "error", "said"),
    [
        (dropped_route, ComparisonError, "7 episodes for 8 routes, lacking 101"),
        (renamed_agent, UsageError, "'classical'. The paper's are tcp, uniad, vad, simlingo"),
        (two_seeds, UsageError, "one seed"),
        (without_episodes, ComparisonError, "0 clean routes"),
        (standing_agent, ComparisonError, "clean driving score is 0"),
    ],
)
def test_a_report_that_is_no_table_is_refused(
    tmp_path: Path, spoil: Callable[[dict[str, Any]], None], error: type[Exception], said: str
) -> None:
    document = report("tcp", ALIKE)
    spoil(document)
    with pytest.raises(error, match=re.escape(said)):
        reading.read(saved(tmp_path, document))


def test_agents_on_other_routes_are_not_compared(tmp_path: Path) -> None:
    files = saved(tmp_path, report("tcp", ALIKE), report("vad", ALIKE, routes=7))
    with pytest.raises(ComparisonError, match="holds 7 routes, the files before it 8; different: 801"):
        reading.read(files)


def test_a_new_report_replaces_its_agent_only(tmp_path: Path) -> None:
    old, vad, new = report("tcp", ALIKE), report("vad", ALIKE), as_published("tcp")
    found = reading.read(saved(tmp_path, old, vad, new))
    assert found.agents["tcp"] == reading.read(saved(tmp_path, new)).agents["tcp"]
    assert found.agents["vad"] == reading.read(saved(tmp_path, vad)).agents["vad"]


def test_an_agent_can_be_driven_setting_by_setting(tmp_path: Path) -> None:
    whole = as_published("uniad")
    parts = [
        {**whole, "episodes": [one for one in whole["episodes"] if one["setting"] in ("clean", setting)]}
        for setting in SETTINGS
    ]
    assert reading.read(saved(tmp_path, *parts[::-1])) == reading.read(saved(tmp_path, whole))


def test_no_line_leads_through_what_was_not_driven() -> None:
    axes = Figure().subplots()
    figures._curve(axes, "vad", [IntervalEstimate(60.0, 55.0, 65.0), None, None, IntervalEstimate(50.0, 45.0, 55.0)])
    (line,) = axes.get_lines()
    assert np.isnan(line.get_ydata()).tolist() == [False, True, True, False]


def test_the_table_says_who_was_driven_in_lockstep(tmp_path: Path) -> None:
    together = report("vad", ALIKE)
    together["versions"]["lockstep"] = "8"
    found = reading.read(saved(tmp_path, report("tcp", ALIKE), together))
    assert "none 1.0, weights bb, 8 episodes in lockstep." in texts.table_text(found)
    assert "none 1.0, weights bb." in texts.table_text(found)


def test_a_setting_keeps_its_own_clean_run(tmp_path: Path) -> None:
    other = report("tcp", {"clean": 0.9, "occlusion 0.5": 0.5})
    with pytest.raises(ComparisonError, match=r"1\.json: tcp lacks 1 s burst frame drop, .* of another clean run"):
        reading.read(saved(tmp_path, report("tcp", ALIKE), other))
    newer = report("tcp", {"clean": 1.0, "occlusion 0.5": 0.5})
    newer["versions"]["lockstep"] = "8"
    with pytest.raises(ComparisonError, match="of another clean run"):
        reading.read(saved(tmp_path, report("tcp", ALIKE), newer))


@given(ratios=st.lists(st.floats(0.0, 3000.0)))
def test_efficiency_is_the_packages_own(ratios: list[float]) -> None:
    episode: Any = SimpleNamespace(outcome=Outcome.COMPLETED, speed_ratios_pct=ratios)
    assert reading._efficiency(ratios) == pytest.approx(efficiency(episode), abs=5.001e-4)  # rounded to 3 digits


def test_the_published_table_agrees_with_itself_and_with_the_other_copy() -> None:
    for agent, (_, rows) in zip(AGENTS, paper_table.PAPER.values(), strict=True):
        mine = PUBLISHED[agent]
        assert sorted(rows) == sorted((row.ds, row.sr_pct) for row in mine.values())
        for row in mine.values():
            assert row.rd == pytest.approx(1.0 - row.ds / mine[CLEAN].ds, abs=0.00501)
    averages = [round(published.published_mean_rd(agent), 2) for agent in AGENTS]
    assert averages == [0.22, 0.24, 0.20, 0.38]  # the table's rows "Avg. all perturb."


# ---- estimates


def test_a_difference_to_nothing_has_nearly_fiellers_interval() -> None:
    generator = np.random.Generator(np.random.Philox(1))
    clean = list(generator.uniform(20.0, 100.0, 44))
    perturbed = [score * share for score, share in zip(clean, generator.uniform(0.2, 1.0, 44), strict=True)]
    lost = 1.0 - estimates._means(perturbed) / estimates._means(clean)
    found = estimates.gap(lost, np.zeros_like(lost))
    assert found is not None
    assert found.value == pytest.approx(1.0 - sum(perturbed) / sum(clean))
    assert (found.low, found.high) == pytest.approx(ratio_interval(clean, perturbed), abs=0.01)


def test_without_a_difference_one_comparison_in_forty_appears() -> None:
    generator = np.random.Generator(np.random.Philox(2))
    studies = 600
    appeared = 0
    for scores in generator.uniform(0.0, 100.0, (studies, 3, 44)):
        clean, first, second = (estimates._means(list(row)) for row in scores)
        appeared += patterns.judge(estimates.gap(1.0 - first / clean, 1.0 - second / clean)) == "appears"
    assert 0.01 < appeared / studies < 0.05


# ---- patterns


def verdicts(found: results.Results) -> dict[str, str]:
    return {pattern.key: pattern.verdict for pattern in patterns.patterns_of(found)}


def test_the_papers_own_table_shows_all_but_the_first_which_simlingo_breaks(tmp_path: Path) -> None:
    found = patterns.patterns_of(reading.read(saved(tmp_path, *map(as_published, AGENTS))))
    assert [pattern.key for pattern in found if pattern.verdict != "appears"] == ["severity"]
    (broken,) = (part for part in found[0].parts if part.verdict != "appears")
    assert broken.what == "simlingo: burst 3 s - burst 1 s"
    for part in (part for pattern in found for part in pattern.parts):
        assert part.estimate is not None
        assert part.estimate.value == pytest.approx(part.paper, abs=1e-3), part.what


def test_more_speed_under_a_failure_is_a_rise_in_efficiency(tmp_path: Path) -> None:
    faster = {setting: 120.0 if setting.startswith("speed") else 100.0 for setting in ALIKE}
    files = saved(tmp_path, report("tcp", ALIKE, efficiency_of=faster), report("uniad", ALIKE))
    found = {pattern.key: pattern for pattern in patterns.patterns_of(reading.read(files))}["speed"]
    assert [found.verdict_of(agent) for agent in ("tcp", "uniad", "vad")] == ["appears", "does not appear", None]
    assert found.parts[0].estimate == IntervalEstimate(20.0, 20.0, 20.0)


def test_rankings_differ_when_the_better_driver_loses_more(tmp_path: Path) -> None:
    fragile = {setting: 1.0 if setting == CLEAN else 0.3 for setting in ALIKE}
    weaker = dict.fromkeys(ALIKE, 0.6)
    assert verdicts(of_shares(tmp_path, {"tcp": fragile, "vad": weaker}))["ranking"] == "appears"
    both = {"tcp": ALIKE, "vad": {setting: 0.6 * share for setting, share in fragile.items()}}
    parts = patterns.patterns_of(of_shares(tmp_path, both))[-1].parts
    assert {part.what[:9]: part.verdict for part in parts}["tcp - vad"] == "does not appear"


def test_agents_that_drive_alike_have_no_ranking(tmp_path: Path) -> None:
    fragile = {setting: 1.0 if setting == CLEAN else 0.3 for setting in ALIKE}
    parts = patterns.patterns_of(of_shares(tmp_path, {"tcp": ALIKE, "vad": fragile}))[-1].parts
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
    known = patterns.patterns_of(of_shares(tmp_path, {"tcp": ALIKE}))
    with pytest.raises(UsageError, match=r"'gsp'\. The patterns are severity, latency, gps"):
        texts.explanations(tmp_path / "explanations.md", known)
