"""`benchmarks/paper.py`: from reports to the committed results, table, patterns and pictures, in both readings."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import paper_table
import pytest
from _paper import estimates, figures, joining, published, reports, table_page
from _paper.estimates import IntervalEstimate
from _paper.published import AGENTS, AVERAGES, CLEAN, PUBLISHED, SETTINGS
from _paper.readings import DRIVEN, NO_LATENCY, READINGS, Drives, called_in
from hypothesis import given
from hypothesis import strategies as st
from made_up_drives import ALIKE, CLEAN_DS, as_published, of_shares, report, saved
from matplotlib.figure import Figure

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.errors import ComparisonError, UsageError
from pytest_drive_robust.metrics.efficiency import efficiency
from pytest_drive_robust.stats.intervals import ratio_interval

ROOT = Path(__file__).parents[2]
WARM = called_in("released", NO_LATENCY)
PICTURES = ("rd_heatmap.svg", "retention_radar.svg", "latency_curves.svg")


def drawn(files: list[Path], folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(ROOT / "benchmarks" / "paper.py"), *map(str, files), "--write", str(folder)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


# ---- the front door


@pytest.fixture(scope="module")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two of the four agents; one with options, in one reading and without one setting; a pattern is explained."""
    folder = tmp_path_factory.mktemp("rendered")
    (folder / "explanations.md").write_text("# Why\n\n## gps\n\nThe planner pops early.\n", encoding="utf-8")
    lacking = {setting: share for setting, share in ALIKE.items() if setting != "occlusion 0.8"}
    files = saved(folder, report("simlingo:tuning=published", lacking), as_published("tcp"))
    done = drawn([*files], folder)
    assert done.returncode == 0, done.stderr
    assert "8 routes, tcp, simlingo:tuning=published" in done.stdout
    return folder


def test_everything_is_drawn_again_from_the_committed_file_to_the_last_byte(rendered: Path, tmp_path: Path) -> None:
    (tmp_path / "explanations.md").write_bytes((rendered / "explanations.md").read_bytes())
    done = drawn([rendered / "results.json"], tmp_path)
    assert done.returncode == 0, done.stderr
    for name in ("results.json", "table.md", "patterns.md", "parts.md", *PICTURES):
        assert (tmp_path / name).read_bytes() == (rendered / name).read_bytes(), name


def test_what_was_not_driven_is_missing_and_not_zero(rendered: Path) -> None:
    table = (rendered / "table.md").read_text(encoding="utf-8")
    assert "Not driven in the reading `paper`: uniad, vad, simlingo in 1 of 12 rows." in table
    assert "Not driven in the reading `released`: uniad, vad, simlingo in 6 of 12 rows." in table
    assert re.search(r"^\| uniad \| - \| - \| - \| - \| 45\.8 \|", table, re.MULTILINE)
    assert re.search(r"^\| occlusion 0\.8 \|( - \|){6} 14\.8 \|", table, re.MULTILINE)
    simlingo = table.partition("## simlingo")[2].partition("Reading `released`:")[2]
    assert re.search(r"^\| clean, warmed up \|( - \|){11}$", simlingo, re.MULTILINE)
    assert re.search(r"^\| avg\. all \|( - \|){6} 53\.7 \|", simlingo, re.MULTILINE)
    assert "| `released`, latency | 3 of 12 |" in table
    assert "## uniad" not in table
    assert list(json.loads((rendered / "results.json").read_text(encoding="utf-8"))["agents"]) == ["tcp", "simlingo"]


def test_the_table_holds_our_figures_beside_the_papers(rendered: Path) -> None:
    table = (rendered / "table.md").read_text(encoding="utf-8")
    row = "| GPS 15 m | 18.4 | 0.0 | 0.65 | 0.65 to 0.65 | 58 | 29 | 21.1 | 0.5 | 0.65 | 58 | 29 |"
    assert table.count(row) == len(READINGS)
    assert table.count("| GPS noise 15 m | 0.65 (0.65) | - (0.55) | - (0.62) | 0.00 (-0.02) |") == len(READINGS)
    assert "| avg. latency | 36.8 | 0.0 | 0.30 | 0.30 to 0.30 | 78 | 6 | 42.2 | 10.8 | 0.30 | 78 | 6 |" in table
    assert "| avg. perturbed | 0.19 (0.19) |" in table
    assert "`simlingo` is `simlingo:tuning=published`" in table
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


def two_choices_of_options(document: dict[str, Any]) -> None:
    for episode in document["episodes"][::2]:
        episode["agent"] = "tcp:tuning=published"


def without_comfort(document: dict[str, Any]) -> None:
    document["summaries"].clear()


def without_its_clean_drive(document: dict[str, Any]) -> None:
    for part in ("episodes", "summaries"):
        for one in document[part]:
            if one["setting"] == "100 ms latency":
                one["setting"] = "100 ms latency (reading=released)"


def on_two_machines(document: dict[str, Any]) -> None:
    document["episodes"][5]["versions"] = {"machine torch": "4567"}


@pytest.mark.parametrize(
    ("spoil", "error", "said"),
    [
        (dropped_route, ComparisonError, "7 episodes for 8 routes, lacking 101"),
        (renamed_agent, UsageError, "'classical'. The paper's are tcp, uniad, vad, simlingo"),
        (two_seeds, UsageError, "one seed"),
        (without_episodes, ComparisonError, "0 clean routes"),
        (standing_agent, ComparisonError, "clean driving score is 0"),
        (two_choices_of_options, UsageError, "holds 'tcp' and 'tcp:tuning=published'"),
        (without_comfort, ComparisonError, "tcp under clean: no summary over 8 routes"),
        (on_two_machines, ComparisonError, "tcp was driven on machines whose torch computes otherwise"),
        (without_its_clean_drive, ComparisonError, "under 0 ms latency (reading=released): 0 episodes for 8 routes"),
    ],
)
def test_a_report_that_is_no_table_is_refused(
    tmp_path: Path, spoil: Callable[[dict[str, Any]], None], error: type[Exception], said: str
) -> None:
    document = report("tcp", ALIKE)
    spoil(document)
    with pytest.raises(error, match=re.escape(said)):
        joining.read(saved(tmp_path, document))


def test_a_file_of_the_former_format_is_refused(tmp_path: Path) -> None:
    (former,) = saved(tmp_path, {"format": "drive-robust paper table 3", "agents": {}})
    with pytest.raises(UsageError, match=r"Expected 'drive-robust paper table 4', .* drive its agents again"):
        joining.read([former])


def test_no_line_leads_through_what_was_not_driven() -> None:
    axes = Figure().subplots()
    figures._curve(axes, "vad", [IntervalEstimate(60.0, 55.0, 65.0), None, None, IntervalEstimate(50.0, 45.0, 55.0)])
    (line,) = axes.get_lines()
    assert np.isnan(line.get_ydata()).tolist() == [False, True, True, False]


def test_bars_say_the_mean_rd_or_that_nothing_was_driven() -> None:
    axes = Figure().subplots()
    cell = IntervalEstimate(60.0, 55.0, 65.0)
    figures._bars(axes, AGENTS, [cell] * 4, [cell, None, cell, None], [IntervalEstimate(0.25, 0.2, 0.3), None] * 2)
    assert len(axes.patches) == 6
    assert [text.get_text() for text in axes.texts] == ["RD 0.25", "not driven", "RD 0.25", "not driven"]


def test_the_table_says_who_was_driven_in_lockstep(tmp_path: Path) -> None:
    together = report("vad", ALIKE)
    together["versions"]["lockstep"] = "8"
    found = joining.read(saved(tmp_path, report("tcp", ALIKE), together))
    assert "none 1.0, weights bb, 8 episodes in lockstep." in table_page.table_text(found)
    assert "none 1.0, weights bb." in table_page.table_text(found)


@pytest.mark.parametrize(
    ("stop_s", "said"),
    [
        (30.0, "its car had stood still for 30 s, by `drive_stuck_stop`"),
        (None, "Every episode was driven to its end"),
    ],
)
def test_the_table_says_whether_standing_cars_were_stopped(tmp_path: Path, stop_s: float | None, said: str) -> None:
    document = report("tcp", ALIKE)
    document["settings"]["stuck_stop_s"] = stop_s
    assert said in table_page.table_text(joining.read(saved(tmp_path, document)))


def test_agents_may_be_stopped_after_different_times_and_one_agent_may_not(tmp_path: Path) -> None:
    longer = report("simlingo", ALIKE)
    longer["settings"]["stuck_stop_s"] = 45.0
    found = joining.read(saved(tmp_path, report("tcp", ALIKE), report("vad", ALIKE), longer))
    assert "for 30 s (of `tcp`, `vad`) or 45 s (of `simlingo`)," in " ".join(table_page.table_text(found).split())
    other = report("tcp", ALIKE)
    other["settings"] |= {"seeds": [1], "stuck_stop_s": None}
    with pytest.raises(ComparisonError, match=r"tcp was driven with other .* or --drive-stuck-stop"):
        joining.read(saved(tmp_path, report("tcp", ALIKE), other))


@given(ratios=st.lists(st.floats(0.0, 3000.0)))
def test_efficiency_is_the_packages_own(ratios: list[float]) -> None:
    episode: Any = SimpleNamespace(outcome=Outcome.COMPLETED, speed_ratios_pct=ratios)
    assert reports._efficiency(ratios) == pytest.approx(efficiency(episode), abs=5.001e-4)  # rounded to 3 digits


def test_the_published_table_agrees_with_itself_and_with_the_other_copy() -> None:
    for agent, (_, rows) in zip(AGENTS, paper_table.PAPER.values(), strict=True):
        mine = PUBLISHED[agent]
        assert sorted(rows) == sorted((row.ds, row.sr_pct) for row in mine.values())
        for row in mine.values():
            assert row.rd == pytest.approx(1.0 - row.ds / mine[CLEAN].ds, abs=0.00501)


@pytest.mark.parametrize(
    ("agent", "row", "printed"),
    [
        ("tcp", "avg. perturbed", (0.19, 48.47, 20.74, 81.53, 24.98)),
        ("tcp", "avg. latency", (0.30, 42.19, 10.76, 78.40, 6.29)),
        ("tcp", "avg. all", (0.22, 46.76, 18.02, 80.67, 19.88)),
        ("uniad", "avg. perturbed", (0.23, 35.14, 9.32, 148.55, 45.82)),
        ("uniad", "avg. latency", (0.25, 34.23, 10.76, 132.75, 20.18)),
        ("uniad", "avg. all", (0.24, 34.89, 9.71, 144.24, 38.83)),
        ("vad", "avg. perturbed", (0.16, 35.59, 11.25, 175.99, 48.12)),
        ("vad", "avg. latency", (0.31, 29.07, 5.76, 213.09, 24.85)),
        ("vad", "avg. all", (0.20, 33.81, 9.75, 186.11, 41.78)),
        ("simlingo", "avg. perturbed", (0.23, 65.84, 42.56, 241.66, 37.19)),
        ("simlingo", "avg. latency", (0.75, 21.21, 0.76, 195.60, 62.65)),
        ("simlingo", "avg. all", (0.38, 53.67, 31.16, 229.10, 44.14)),
    ],
)
def test_averages_are_those_that_the_paper_prints(agent: str, row: str, printed: tuple[float, ...]) -> None:
    assert published.published_average(agent, AVERAGES[row]) == pytest.approx(printed, abs=0.00501)


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


def test_each_reading_of_latency_has_its_own_clean_drive(tmp_path: Path) -> None:
    shares = {**dict.fromkeys(DRIVEN, 0.5), CLEAN: 1.0, WARM: 0.8}
    found = of_shares(tmp_path, {"tcp": shares})
    cells = {
        reading: [estimates.degradation(Drives(found, reading), "tcp", rows) for rows in AVERAGES.values()]
        for reading in READINGS
    }
    # perturbed, latency, all: without noise, so the intervals are points
    assert [cell and round(cell.value, 4) for cell in cells["paper"]] == [0.5, 0.5, 0.5]
    assert [cell and round(cell.value, 4) for cell in cells["released"]] == [0.5, 0.375, round(5.125 / 11.0, 4)]
    assert all(cell and cell.low == pytest.approx(cell.high, abs=1e-6) for cell in cells["released"])


def test_the_jackknife_of_several_rows_has_nearly_fiellers_interval(tmp_path: Path) -> None:
    generator = np.random.Generator(np.random.Philox(3))
    whole = report("tcp", dict.fromkeys(DRIVEN, 1.0))
    for episode in whole["episodes"]:
        if episode["setting"] not in (CLEAN, WARM):
            episode["driving_score"] *= generator.uniform(0.4, 0.8)
    found = Drives(joining.read(saved(tmp_path, whole)), "released")  # the clean drives are alike: Fieller's
    fieller = estimates.degradation(found, "tcp", SETTINGS)
    jackknife = estimates.gap(estimates.rd_means(found, "tcp", SETTINGS), np.zeros(1 + len(CLEAN_DS)))
    assert fieller is not None
    assert jackknife is not None
    assert jackknife.value == pytest.approx(fieller.value)
    assert (jackknife.low, jackknife.high) == pytest.approx((fieller.low, fieller.high), abs=0.02)
