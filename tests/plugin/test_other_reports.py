"""What other plugins show of a broken requirement: JUnit files, annotations on GitHub, Allure."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

LIMITS = "# the limits\nDS under clean >= 1\n\nRD under GPS noise 15 m <= 0.1  # too much\n"
SUITE = """
from pathlib import Path
import pytest
from pytest_drive_robust import requirements

@pytest.mark.parametrize("requirement", requirements(Path(__file__).with_name("limits.txt")))
def test_it(drive, requirement):
    drive.check(requirement)
"""
STATED = f'''
import pytest
from pytest_drive_robust import requirements

@pytest.mark.parametrize("requirement", requirements("DS under clean >= 1"))
def test_ten(drive, requirement):
    drive.check(requirement)

@pytest.mark.parametrize("requirement", requirements("""{LIMITS}"""))
def test_it(drive, requirement):
    drive.check(requirement)
'''


def line_of(text: str, sentence: str) -> int:
    return next(number for number, line in enumerate(text.splitlines(), 1) if line.startswith(sentence))


def run(folder: Path, *words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-p", "no:randomly", "--drive-robust"]
    command += ["--drive-agent", "blind", "--drive-routes", "3001", "--drive-verdict", "point", *words]
    command += ["--drive-workers", "1", "--drive-stuck-stop", "5"]
    dropped = ("PYTEST_", "COV_", "GITHUB_")
    kept = {name: value for name, value in os.environ.items() if not name.startswith(dropped)}
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, env={**kept, **environment})


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """Return a folder in whose suite one of two requirements is broken; both are lines of a file."""
    (tmp_path / "pytest.ini").write_text("[pytest]\njunit_family = xunit1\n")
    (tmp_path / "suites").mkdir()
    (tmp_path / "suites" / "limits.txt").write_text(LIMITS)
    (tmp_path / "suites" / "test_suite.py").write_text(SUITE)
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("workers", [["-n", "0"], ["-n", "1"]], ids=lambda words: words[1])
def test_a_failure_points_to_the_line_of_its_requirement(files, workers):
    pytest.importorskip("pytest_github_actions_annotate_failures", reason="not installed: pip install -e '.[dev]'")
    told = run(files, "--junitxml=junit.xml", *workers, "suites", GITHUB_ACTIONS="true", GITHUB_WORKSPACE=str(files))
    assert told.returncode == 1, told.stdout + told.stderr
    assert "  stated:  suites/limits.txt:4\n" in told.stdout
    (annotation,) = [line for line in told.stderr.splitlines() if line.startswith("::error")]
    assert annotation.startswith("::error file=suites/limits.txt,line=4::")
    assert "RD under GPS noise 15 m = " in annotation
    held, broken = ElementTree.parse(files / "junit.xml").getroot().iter("testcase")
    assert held.get("file") == "suites/test_suite.py"
    assert (broken.get("file"), broken.get("line")) == ("suites/limits.txt", "3")  # JUnit files of pytest count from 0
    failure = broken.find("failure")
    assert failure.get("message").startswith("RD under GPS noise 15 m = ")
    assert "stated:  suites/limits.txt:4" in failure.text
    assert {item.get("name") for item in broken.iter("property")} >= {"drive_requirement", "drive_value"}


@pytest.mark.slow
def test_a_sentence_in_the_module_is_found_near_its_test(files):
    (files / "suites" / "test_suite.py").write_text(STATED)
    told = run(files, "-n", "0", "suites")
    line = line_of(STATED, "RD under GPS noise 15 m <= 0.1")
    assert f"  stated:  suites/test_suite.py:{line}\n" in told.stdout, told.stdout + told.stderr


@pytest.mark.slow
def test_allure_gets_the_plots_and_the_film(files):
    pytest.importorskip("allure_pytest", reason="allure-pytest is not installed: pip install -e '.[dev]'")
    told = run(files, "-n", "0", "--alluredir=allure", "suites")
    assert told.returncode == 1, told.stdout + told.stderr
    results = [json.loads(path.read_text()) for path in (files / "allure").glob("*-result.json")]
    (broken,) = [result for result in results if result["status"] == "failed"]
    (held,) = [result for result in results if result["status"] == "passed"]
    assert not held.get("attachments")
    found = {item["name"]: files / "allure" / item["source"] for item in broken["attachments"]}
    assert list(found) == ["driving scores", "speed on 3001", "film of 3001", "replay"]
    for name in ("driving scores", "speed on 3001"):
        assert ElementTree.parse(found[name]).getroot().tag.endswith("svg")
    film = found["film of 3001"].read_bytes()
    assert film[4:8] == b"ftyp" or film.startswith(b"\x89PNG")
    assert "first divergence at" in found["replay"].read_text()


FULL = """
import allure

def full(*given, **named):
    raise OSError(28, "No space left on device")

allure.attach = full
"""


@pytest.mark.slow
def test_a_picture_that_allure_cannot_keep_does_not_hide_the_verdict(files):
    pytest.importorskip("allure_pytest", reason="allure-pytest is not installed: pip install -e '.[dev]'")
    (files / "conftest.py").write_text(FULL)
    told = run(files, "-n", "0", "--alluredir=allure", "suites")
    assert told.returncode == 1, told.stdout + told.stderr
    assert "\nRD under GPS noise 15 m = " in told.stdout
    assert "  allure:  not all was attached: OSError: [Errno 28] No space left on device\n" in told.stdout


REPORTER = """
import pytest

class Brief:
    \"\"\"As little as reporters of other plugins have.\"\"\"
    hasmarkup, stats = False, {}  # what pytest itself reads of it
    def section(self, title, sep="=", **kw): print("==", title)
    def write_line(self, line, **kw): print(line)
    def ensure_newline(self): pass
    @pytest.hookimpl(wrapper=True)
    def pytest_sessionfinish(self):
        yield
        self.config.hook.pytest_terminal_summary(terminalreporter=self, exitstatus=0, config=self.config)

@pytest.hookimpl(trylast=True)
def pytest_configure(config):
    config.pluginmanager.unregister(name="terminalreporter")
    brief = Brief()
    brief.config = config
    config.pluginmanager.register(brief, "terminalreporter")
"""


def test_the_table_is_shown_by_another_reporter(files):
    (files / "conftest.py").write_text(REPORTER)
    done = run(files, "-s")
    assert "Error" not in done.stdout + done.stderr
    assert "== drive-robust\n" in done.stdout
    assert "GPS noise 15 m" in done.stdout
