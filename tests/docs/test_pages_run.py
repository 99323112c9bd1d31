"""Every block of code and every command of the documentation runs as written, from an empty folder."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from documented_pages import blocks_of, is_slow, run_page

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def pages() -> Iterator[object]:
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        if any(blocks_of(text)):
            marks = [pytest.mark.slow] if is_slow(text) else []
            yield pytest.param(page, id=str(page.relative_to(ROOT)), marks=marks)


@pytest.mark.parametrize("page", list(pages()))
def test_a_page_runs_from_an_empty_folder(page: Path, tmp_path: Path) -> None:
    run_page(page, tmp_path)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_the_file_that_a_block_goes_to_is_named_to_the_reader(page: Path) -> None:
    lines = page.read_text(encoding="utf-8").splitlines()
    nameless = [
        named[1]
        for number, line in enumerate(lines)
        if (named := re.fullmatch("<!-- file: (.+) -->", line)) is not None
        and f"`{named[1]}`" not in "\n".join(lines[max(0, number - 4) : number])
    ]
    assert nameless == []
