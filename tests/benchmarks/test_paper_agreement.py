"""`benchmarks/paper.py`: how well the cells agree with the paper's, all together and of one agent alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from _paper import agreement, differences, joining, results
from _paper.published import AGENTS, CLEAN, PUBLISHED, SETTINGS
from _paper.readings import READINGS, Drives
from made_up_drives import as_published, paper_reading, saved


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        ([1.0, 2.0, 3.0, 4.0], 1.0),
        ([9.0, 7.0, 1.0, 0.0], -1.0),
        ([1.0, 3.0, 2.0, 4.0], 0.8),
        ([1.0, 1.0, 2.0, 3.0], 0.9486833),  # ranks 1.5, 1.5, 3, 4
        ([5.0, 5.0, 5.0, 5.0], np.nan),
    ],
)
def test_rank_correlation_is_spearmans(row: list[float], expected: float) -> None:
    found = agreement.rank_correlations(np.array([row, row[::-1]]), np.array([1.0, 2.0, 3.0, 4.0]))
    assert list(found) == pytest.approx([expected, -expected], nan_ok=True)


@pytest.mark.parametrize("reading", READINGS)
def test_the_papers_own_figures_agree_with_the_paper(tmp_path: Path, reading: str) -> None:
    found = agreement.agreement(Drives(joining.read(saved(tmp_path, *map(as_published, AGENTS))), reading), SETTINGS)
    assert (found.driven, found.cells) == (44, 44)
    assert found.correlation is not None
    assert found.difference is not None
    assert found.correlation.value > 0.99  # printed with two digits there
    assert found.difference < 0.005


def test_agents_agree_with_the_paper_each_for_itself(tmp_path: Path) -> None:
    tcp, vad = as_published("tcp"), as_published("vad")
    for episode in vad["episodes"]:
        if episode["setting"].startswith("GPS noise 15 m"):
            episode["driving_score"] = 100.0
    drives = Drives(joining.read(saved(tmp_path, tcp, vad)), "paper")
    one, other = (agreement.agreement(drives, SETTINGS, [agent]) for agent in ("tcp", "vad"))
    assert (one.driven, one.cells, other.driven, other.cells) == (11, 11, 11, 11)
    assert one.difference is not None
    assert other.difference is not None
    assert one.difference < 0.005 < 0.1 < other.difference
    assert one.correlation is not None
    assert other.correlation is not None
    assert other.correlation.value < 0.8 < 0.99 < one.correlation.value


def test_cells_that_differ_from_the_papers_are_listed_the_largest_difference_first(tmp_path: Path) -> None:
    shares = {CLEAN: 1.0, **{row: 1.0 - PUBLISHED["tcp"][row].rd for row in SETTINGS}}
    drives = paper_reading(
        tmp_path, {"tcp": {**shares, "GPS noise 5 m": 0.8, "occlusion 0.8": 1.0, "speed noise 0.5": 0.87}}
    )
    assert [(cell.agent, cell.row, cell.off_by) for cell in differences.differences(drives)] == [
        ("tcp", "occlusion 0.8", 0.24),
        ("tcp", "GPS noise 5 m", 0.1),
    ]


def test_pages_on_a_cell_are_those_of_the_agent_under_the_same_failure() -> None:
    assert differences.pages_on("tcp", "occlusion 0.5") == ["black/tcp"]  # occlusion 1 there
    assert "filter/simlingo" in differences.pages_on("simlingo", "100 ms latency")
    assert "black/uniad" not in differences.pages_on("uniad", "occlusion 0.8")  # nothing of the agent is changed there
    assert differences.pages_on("simlingo", "GPS noise 5 m") == []


@pytest.fixture(scope="module")
def noisy(tmp_path_factory: pytest.TempPathFactory) -> Drives:
    """The paper's own figures of two agents with chance on every route."""
    generator = np.random.Generator(np.random.Philox(4))
    documents = [as_published(agent) for agent in ("tcp", "simlingo")]
    for episode in (episode for document in documents for episode in document["episodes"]):
        episode["driving_score"] *= generator.uniform(0.5, 1.0)
    return Drives(joining.read(saved(tmp_path_factory.mktemp("noisy"), *documents)), "released")


def test_the_correlation_has_an_interval_around_it_and_the_same_one_again(noisy: Drives) -> None:
    found = agreement.agreement(noisy, SETTINGS)
    assert (found.driven, found.cells) == (22, 44)
    assert found.correlation is not None
    assert -1.0 <= found.correlation.low < found.correlation.value < found.correlation.high <= 1.0
    assert agreement.agreement(noisy, SETTINGS) == found


def test_too_few_cells_have_no_correlation(noisy: Drives) -> None:
    assert agreement.agreement(noisy, SETTINGS[:2]).correlation is None
    assert agreement.agreement(noisy, SETTINGS[:3]).correlation is not None
    alone = Drives(results.Results(noisy.results.world, (0,), noisy.results.routes, {}), "paper")
    assert agreement.agreement(alone, SETTINGS) == agreement.Agreement(44, 0, None, None)
