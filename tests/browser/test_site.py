"""The documentation site in Chromium, from its folder: it searches without a network and fits any screen."""

from __future__ import annotations

from pathlib import Path

import pytest
from built_site import built_site

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    return built_site(tmp_path_factory, worker_id)


@pytest.fixture
def page(browser):
    """A page; at the end it may have asked for nothing outside the folder of the site."""
    opened = browser.new_page()
    asked: list[str] = []
    opened.on("request", lambda request: asked.append(request.url))
    yield opened
    opened.close()
    assert [url for url in asked if not url.startswith(("file:", "data:"))] == []


def test_the_search_finds_without_a_network(page, site: Path) -> None:
    page.goto(f"{(site / 'search.html').as_uri()}?q=occlusion")
    page.wait_for_selector("#search-results li a")
    found = page.locator("#search-results li a").all_inner_texts()
    assert any("Failures" in title for title in found), found


@pytest.mark.parametrize("width", [1280, 390])
@pytest.mark.parametrize(
    "name", ["index", "tutorial", "reference/results", "gallery/failures", "explanation/other-tools"]
)
def test_a_page_fits_the_screen(page, site: Path, name: str, width: int) -> None:
    page.set_viewport_size({"width": width, "height": 900})
    page.goto((site / f"{name}.html").as_uri())
    root = "document.documentElement"
    assert page.evaluate(f"{root}.scrollWidth <= {root}.clientWidth")
