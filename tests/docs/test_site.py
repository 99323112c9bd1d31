"""The documentation site builds without a warning, offline, and holds everything that the code has."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from built_site import DOCS, built_site

import pytest_drive_robust
from pytest_drive_robust import errors, testing
from pytest_drive_robust.bench2drive.evaluator.guard import MARK
from pytest_drive_robust.cli.main import COMMANDS
from pytest_drive_robust.metrics.table import METRICS
from pytest_drive_robust.options.table import OPTIONS
from pytest_drive_robust.perturbations import BUILTIN
from pytest_drive_robust.simulators.embedded.scenarios import SCENARIOS

ROOT = Path(__file__).parents[2]


class Page(HTMLParser):
    """The anchors, links, pictures and text of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.text = ""
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attributes}
        self.anchors |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        if tag in ("img", "script") and "src" in given:
            self.loaded.append(given["src"])
        if tag == "link" and given.get("rel") == "stylesheet":
            self.loaded.append(given["href"])

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    return built_site(tmp_path_factory, worker_id)


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Page]:
    return {path: Page(path) for path in sorted(site.rglob("*.html"))}


def text_of(pages: dict[Path, Page], name: str) -> str:
    return next(page.text for path, page in pages.items() if path.as_posix().endswith(f"/{name}.html"))


def test_every_link_inside_leads_to_a_page_and_a_place_on_it(pages: dict[Path, Page]) -> None:
    broken = []
    for path, page in pages.items():
        for link in (*page.links, *page.loaded):
            parts = urlsplit(link)
            if parts.scheme or not (parts.path or parts.fragment):
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            there = target.is_file() and (
                not parts.fragment or target not in pages or unquote(parts.fragment) in pages[target].anchors
            )
            if not there:
                broken.append(f"{path.name}: {link}")
    assert broken == []


def test_a_link_to_elsewhere_is_an_address_of_the_web(pages: dict[Path, Page]) -> None:
    leading = {
        link for page in pages.values() for link in page.links if urlsplit(link).scheme not in ("", "https", "http")
    }
    assert leading == set()


def test_nothing_is_loaded_from_elsewhere(pages: dict[Path, Page]) -> None:
    assert [
        item for page in pages.values() for item in page.loaded if urlsplit(item).scheme or item.startswith("//")
    ] == []


def test_the_reference_holds_every_option_and_ini_key(pages: dict[Path, Page]) -> None:
    text = text_of(pages, "reference/options")
    assert [flag for flag in OPTIONS if flag not in text] == []
    assert [option.name for option in OPTIONS.values() if not option.is_switch and option.name not in text] == []


def test_the_reference_holds_every_command(pages: dict[Path, Page]) -> None:
    text = text_of(pages, "reference/commands")
    assert [name for name in COMMANDS if f"drive-robust {name}" not in text] == []


def test_the_reference_holds_every_public_name(pages: dict[Path, Page]) -> None:
    anchors = next(page.anchors for path, page in pages.items() if path.as_posix().endswith("reference/api.html"))
    public = {f"pytest_drive_robust.{name}" for name in pytest_drive_robust.__all__ if not name.startswith("__")}
    public |= {f"pytest_drive_robust.testing.{name}" for name in testing.__all__}
    public |= {f"pytest_drive_robust.errors.{name}" for name in errors.__all__ if name.endswith("Error")}
    assert sorted(public - anchors) == []


def test_the_reference_holds_every_metric_failure_and_scenario(pages: dict[Path, Page]) -> None:
    assert [name for name in METRICS if name not in text_of(pages, "reference/metrics")] == []
    gallery = text_of(pages, "gallery/failures")
    assert [cls.__name__ for cls in BUILTIN.values() if cls.__name__ not in gallery] == []
    scenarios = text_of(pages, "reference/scenarios")
    assert len(SCENARIOS) == 44
    assert [name for name in SCENARIOS if name not in scenarios] == []


def test_the_reference_holds_every_object_and_field_of_the_schema(pages: dict[Path, Page]) -> None:
    schema = json.loads((ROOT / "pytest_drive_robust/report/schema/run.schema.json").read_text(encoding="utf-8"))
    text = text_of(pages, "reference/results")
    parts = {"run": schema, **schema["$defs"]}
    fields = [field for part in parts.values() for field in part.get("properties", ())]
    assert [name for name in fields if name not in text] == []


def test_models_find_every_page(site: Path, pages: dict[Path, Page]) -> None:
    listed = re.findall(r"^- \[[^]]+\]\((\S+)\): \S", (site / "llms.txt").read_text(encoding="utf-8"), re.MULTILINE)
    assert [name for name in listed if not (site / name).is_file()] == []
    sources = {path.relative_to(DOCS).as_posix() + ".txt" for kind in ("md", "rst") for path in DOCS.rglob(f"*.{kind}")}
    assert {name.removeprefix("_sources/") for name in listed} == sources


def variables_read(code: str) -> set[str]:
    """Return the variables that a module asks an environment for, by their names or by a constant of the module."""
    asked = r"environ(?:ment)?(?:\.get\(|\[)"
    constants = dict(re.findall(r"^(_?[A-Z][A-Z_]+) = \"(\w+)\"$", code, re.MULTILINE))
    by_constant = {constants[name] for name in re.findall(rf"{asked}(\w+)", code) if name in constants}
    return by_constant | set(re.findall(rf"{asked}[\"'](\w+)", code))


def test_the_reference_holds_every_variable_that_the_code_reads(pages: dict[Path, Page]) -> None:
    package = Path(pytest_drive_robust.__file__).parent
    ours = [path for path in package.rglob("*.py") if "stand_ins" not in path.parts]
    read = set().union(*(variables_read(path.read_text(encoding="utf-8")) for path in ours))
    assert read >= {"CUDA_VISIBLE_DEVICES", "PLANNER_TYPE", "PDR_SETTING"}
    read -= {"LOCALAPPDATA", "PYTEST_ADDOPTS", "PYTEST_XDIST_TESTRUNUID", "PYTHONPATH"}  # of others
    read -= {MARK}  # our processes' own
    text = text_of(pages, "reference/environment")
    assert sorted(name for name in read if name not in text) == []
