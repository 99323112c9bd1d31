"""`drive-robust init` in somebody's repository, and the repository that it leaves."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml
from full_disk import full_disk

from pytest_drive_robust import requirements
from pytest_drive_robust.cli.main import main

ROOT = Path(__file__).parents[3]
FILES = ["robustness/limits.txt", "robustness/test_robustness.py"]
pytestmark = pytest.mark.usefixtures("home")


def written() -> list[str]:
    return sorted(path.as_posix() for path in Path().rglob("*") if path.is_file())


@pytest.mark.parametrize("suite", ["paper", "minimal"])
def test_it_writes_a_suite_whose_limits_parse(suite: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["init", "--suite", suite]) == 0
    assert written() == FILES
    assert len(requirements(Path("robustness/limits.txt").read_text(encoding="utf-8"))) >= 3
    assert "next: pytest --drive-robust robustness" in capsys.readouterr().out


def test_the_limits_to_begin_with_are_those_that_ship_for_every_agent_without_its_own() -> None:
    assert main(["init"]) == 0
    shipped = (ROOT / "suites" / "paper" / "limits" / "others.txt").read_text(encoding="utf-8")
    started = Path("robustness/limits.txt").read_text(encoding="utf-8")
    assert list(map(str, requirements(started))) == list(map(str, requirements(shipped)))


@pytest.mark.parametrize(
    ("service", "name"), [("github", ".github/workflows/robustness.yml"), ("gitlab", ".gitlab-ci.yml")]
)
def test_it_writes_the_workflow_that_the_documentation_shows(
    service: str, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["init", "--ci", service]) == 0
    assert "the workflow drives the agent of drive_agent in pytest.ini or" in capsys.readouterr().out
    assert written() == sorted([*FILES, name])
    text = Path(name).read_text(encoding="utf-8")
    assert isinstance(yaml.safe_load(text), dict)
    page = (ROOT / "docs" / "how-to" / "ci.md").read_text(encoding="utf-8")
    shown = re.search(rf"<!-- file: {re.escape(name)} -->\n```yaml\n(.*?)```", page, re.DOTALL)
    assert shown is not None
    assert text == shown[1]


@pytest.mark.parametrize("repository", [".", "../..", None], ids=["its root", "below it", "none"])
def test_below_the_root_of_a_repository_it_says_where_the_workflow_is_read(
    repository: str | None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    top = Path.cwd()
    (top / "part" / "car").mkdir(parents=True)
    monkeypatch.chdir(top / "part" / "car")
    if repository is not None:
        Path(repository, ".git").mkdir()
    assert main(["init", "--ci", "github"]) == 0
    said = capsys.readouterr().out
    moved = f"only: move it to {top}/.github/workflows/robustness.yml\nand let its commands run in part/car,"
    assert (moved in said) is (repository == "../..")
    assert ("root of the repository" in said) is (repository == "../..")


@pytest.mark.parametrize("there", ["robustness/limits.txt", ".gitlab-ci.yml"])
def test_it_never_writes_over_a_file_and_then_writes_none(there: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path(there).parent.mkdir(exist_ok=True)
    Path(there).write_text("mine")
    assert main(["init", "--ci", "gitlab"]) == 4
    assert written() == [there]
    assert Path(there).read_text() == "mine"
    assert there in capsys.readouterr().err


def test_where_the_workflow_cannot_be_written_nothing_is(capsys: pytest.CaptureFixture[str]) -> None:
    Path(".github").write_text("a file")
    assert main(["init", "--ci", "github"]) == 4
    assert written() == [".github"]
    assert "cannot write '.github/workflows/robustness.yml': Not a directory." in capsys.readouterr().err


def test_a_full_disk_leaves_no_half_of_a_file_in_the_way_of_another_try(capsys: pytest.CaptureFixture[str]) -> None:
    with full_disk(100):
        assert main(["init"]) == 4
    assert "cannot write 'robustness/test_robustness.py': File too large." in capsys.readouterr().err
    assert main(["init"]) == 0


def test_what_it_wrote_is_driven_and_keeps_the_limits_that_are_proposed(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, plugin_args: tuple[str, ...]
) -> None:
    monkeypatch.chdir(pytester.path)
    assert main(["init", "--suite", "minimal"]) == 0
    options = ("--drive-agent", "blind", "--drive-routes", "601,602,605", "--drive-executor", "inline")
    command = ("-p", "no:hypothesispytest", *plugin_args, "--drive-robust", "robustness", *options)
    pytester.runpytest_inprocess(*command, "--drive-save=first")
    assert main(["limits", "--agent", "blind", "--out", "proposed.txt"]) == 0
    proposed = Path("proposed.txt").read_text(encoding="utf-8")
    assert len(requirements(proposed)) == 3
    Path("robustness/limits.txt").write_text(proposed, encoding="utf-8")
    again = pytester.runpytest_inprocess(*command)
    again.assert_outcomes(passed=3)
