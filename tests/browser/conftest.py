"""Chromium on the pages of real runs. Without Chromium these tests are skipped; `.ci/run` has one and must not skip."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import pytest
from filelock import FileLock

NEEDED = "DRIVE_ROBUST_NEEDS_CHROMIUM"
"""Set where a missing browser is a failure."""
_NAMES = ("chromium", "chromium-browser", "google-chrome")
_ARGUMENTS = (
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
_AGENT = """
from drive_robust_agents.classical import Classical
from pytest_drive_robust import Control


class Follower(Classical):
    \"\"\"Brakes as hard as its brakes are.\"\"\"

    def act(self, observation):
        control = super().act(observation)
        return Control(control.throttle, control.steer, control.brake * BRAKES)
"""
_SUITE = """
import pytest

from pytest_drive_robust import requirements


@pytest.mark.parametrize(
    "requirement",
    requirements(\"\"\"
    DS under clean >= 1
    RD under GPS noise 15 m <= 0.01
    SR under GPS noise 15 m >= 0.99
\"\"\"),
)
def test_follower(drive, requirement):
    drive.check(requirement)
"""
_ROUTES = "801,2301,2501,3901"


@pytest.fixture(scope="session")
def reports(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    """Return a folder with the pages of a run in which much is broken (`now`), compared with one that brakes.

    The workers of pytest-xdist share it: the first that needs it drives.
    """
    base = tmp_path_factory.getbasetemp()
    folder = (base if worker_id == "master" else base.parent) / "driven"
    with FileLock(folder.with_suffix(".lock")):
        if not (folder / "now" / "index.html").is_file():
            folder.mkdir(exist_ok=True)
            _drive(folder)
    return folder


def _drive(folder: Path) -> None:
    (folder / "test_follower.py").write_text(_SUITE)
    for name, brakes in (("before", 1.0), ("now", 0.0)):
        (folder / "follower.py").write_text(f"BRAKES = {brakes}\n{_AGENT}")
        words = ["--drive-routes", _ROUTES, f"--drive-save={name}", "--drive-stuck-stop", "10"]
        if name == "now":
            words += ["--drive-compare=before", "--drive-report", "now"]
        command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:randomly", "-n", "0"]
        command += ["--drive-robust", "--drive-agent", "follower:Follower", "--drive-verdict", "point", *words]
        command += ["--drive-workers", "1", "test_follower.py"]
        told = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, check=False, env=_environment(folder)
        )
        assert told.returncode in (0, 1), told.stdout + told.stderr


def _environment(folder: Path) -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST_", "COV_"))}
    return {**kept, "PYTHONPATH": os.pathsep.join(filter(None, (str(folder), os.environ.get("PYTHONPATH"))))}


def _chromium() -> str:
    found = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, _NAMES)), None)
    if found is None:
        missing = "there is no Chromium: apt-get install chromium, or name one with CHROMIUM=/path/to/it"
        if os.environ.get(NEEDED):
            pytest.fail(missing)
        pytest.skip(missing)
    return found


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Yield one Chromium with an empty profile."""
    if not os.environ.get(NEEDED):
        pytest.importorskip("playwright", reason="playwright is not installed: pip install -e '.[dev]'")
    path = _chromium()
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        context = playwright.chromium.launch_persistent_context(
            str(tmp_path_factory.mktemp("profile")), executable_path=path, args=list(_ARGUMENTS), headless=True
        )
        context.set_default_timeout(60_000)  # a busy machine is no failure
        yield context
        context.close()


class Opened:
    """A page of a report, with what it complained of and what it asked for."""

    def __init__(self, page: Any, folder: Path) -> None:
        self.page = page
        self.folder = folder
        self.complaints: list[str] = []
        self.asked: list[str] = []
        page.on("console", lambda message: self._note(message.type, message.text))
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("request", lambda request: self.asked.append(request.url))

    def _note(self, kind: str, text: str) -> None:
        if kind in ("error", "warning") and "willReadFrequently" not in text:  # it is we who read
            self.complaints.append(f"{kind}: {text}")

    def go(self, place: str = "#/") -> Any:
        """Open a view by its link, from nothing, and wait until it is there."""
        self.page.goto("about:blank")
        self.page.goto(f"{self.folder.joinpath('index.html').as_uri()}{place}")
        self.page.wait_for_selector("html[data-ready]")
        return self.page

    def follow(self, locator: Any) -> Any:
        """Click a link and wait for the heading of another view."""
        before = self.page.evaluate("location.hash")
        locator.click()
        self.until(f"location.hash !== {json.dumps(before)}")
        self.until("document.activeElement === document.getElementById('main')")
        return self.page

    def until(self, expression: str) -> None:
        """Wait until JavaScript is true. Playwright's own waiting evaluates in the page, which its policy forbids."""
        for _ in range(1200):
            if self.page.evaluate(expression):
                return
            self.page.wait_for_timeout(50)
        raise AssertionError(f"this never became true: {expression}")

    def strangers(self) -> list[str]:
        """Return what was asked for outside the folder."""
        inside = self.folder.resolve()
        paths = [url for url in self.asked if url != "about:blank" and not url.startswith("data:")]
        return [
            url
            for url in paths
            if urlsplit(url).scheme != "file" or inside not in Path(unquote(urlsplit(url).path)).resolve().parents
        ]


@pytest.fixture
def opened(browser: Any, reports: Path) -> Iterator[Callable[..., Opened]]:
    """Return what opens a report; at the end no page may have complained or asked for anything outside its folder."""
    pages: list[Opened] = []

    def open_report(
        folder: Path | None = None, *, width: int = 1280, height: int = 900, scheme: str = "light"
    ) -> Opened:
        page = browser.new_page()
        page.set_viewport_size({"width": width, "height": height})
        page.emulate_media(color_scheme=scheme)
        pages.append(Opened(page, folder or reports / "now"))
        return pages[-1]

    yield open_report
    complaints, strangers = [], []
    for item in pages:
        complaints += item.complaints
        strangers += item.strangers()
        if item.page.url.startswith("file:"):
            item.page.evaluate("localStorage.clear()")  # the theme that was chosen
        item.page.close()
    assert complaints == []
    assert strangers == []
