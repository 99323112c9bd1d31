"""What the pages say of the reference agents is what `benchmarks/calibration.md` counted."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROUTES = 220


def passed() -> dict[str, int]:
    """Return how many of the 220 routes each agent of the calibration passes: the sum of its column."""
    table = (ROOT / "benchmarks" / "calibration.md").read_text().partition("## Routes passed")[2].partition("\n## ")[0]
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines() if line.startswith("| ")]
    head = next(row for row in rows if row[0] == "scenario")
    counted = [row for row in rows if re.fullmatch(r"\d/5", row[1])]
    assert len(counted) == 44
    return {agent: sum(int(row[at][0]) for row in counted) for at, agent in enumerate(head) if at}


def test_the_blind_pass_what_is_said() -> None:
    four, six, eight, eleven, walking = (passed()[f"blind {speed}"] for speed in (4, 6, 8, 11, 1.4))
    said = f"{four} of 220 at 4 m/s, {six} at 6, {eight} at 8, {eleven} at 11; {walking} at 1.4"
    assert said in (ROOT / "docs" / "gallery" / "agents.md").read_text()
    assert max(four, six, eight, eleven) <= 0.1 * ROUTES


@pytest.mark.parametrize(
    ("page", "said"),
    [
        (
            "docs/gallery/agents.md",
            "marked `*` in every table) | {expert} of 220 routes |",
        ),
        ("docs/gallery/agents.md", "nothing else | {reactive} of 220 |"),
        ("docs/gallery/agents.md", "| {constant} of 220 (`constant`) |"),
        ("docs/explanation/world.md", "succeeds on {expert} of the 220 routes. `reactive`"),
        ("docs/explanation/world.md", "brakes for what is ahead, on {reactive}."),
        ("docs/explanation/world.md", "but on {blind 1.4} at a walking pace of 1.4 m/s"),
    ],
)
def test_a_page_says_what_was_counted(page: str, said: str) -> None:
    for agent, routes in passed().items():
        said = said.replace(f"{{{agent}}}", str(routes))
    assert said in (ROOT / page).read_text()
