"""The texts for those who take part: what they link and name is there, and nothing is excused without a reason."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

yaml = pytest.importorskip("yaml", reason="PyYAML is not installed: pip install -e '.[dev]'")

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[2]
TEXTS = ["CONTRIBUTING.md", "SECURITY.md", "CODE_OF_CONDUCT.md", "changelog.d/README.md"]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", TEXTS)
def test_links_lead_to_files_and_headings_that_exist(name: str) -> None:
    text = (ROOT / name).read_text(encoding="utf-8")
    for link in re.findall(r"\]\(([^)]+)\)", text):
        if "://" not in link:
            path, _, heading = link.partition("#")
            target = (ROOT / name).parent / path
            assert target.exists(), link
            titles = re.findall(r"^#+ (.+)$", target.read_text(encoding="utf-8"), re.MULTILINE) if heading else []
            assert not heading or heading in [title.lower().replace(" ", "-") for title in titles], link


@pytest.mark.parametrize("name", TEXTS)
def test_no_address_of_a_person_is_made_up(name: str) -> None:
    assert re.findall(r"[\w.+-]+@[\w-]+\.\w+", (ROOT / name).read_text(encoding="utf-8")) == []


def test_the_commands_name_what_exists() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    table = re.findall(r"^\| .+ \| `(.+)` \|$", text, re.MULTILINE)
    assert len(table) > 8
    named = {word for command in table for word in command.split() if re.match(r"(tests|\.ci|docs)/", word)}
    assert named
    assert [name for name in named if not (ROOT / name).exists()] == []
    options = {word for command in table for word in command.split() if word.startswith("--")}
    assert options <= {"--whole-studies", "--hypothesis-profile", "--all-files", "--"}
    defined = set(re.findall(r"^def ([a-z]\w*)\(session: nox", (ROOT / "noxfile.py").read_text(), re.MULTILINE))
    assert set(re.findall(r"`nox -s (\w+)`", text)) == defined


def test_the_set_up_is_that_of_the_readme() -> None:
    command = re.search(r"pip install .*torch.*", (ROOT / "README.md").read_text(encoding="utf-8"))
    assert command is not None
    packages = command[0].partition(" && ")[0].replace("-q ", "")
    assert packages in (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    assert packages.removeprefix("pip install ") in (ROOT / ".devcontainer" / "devcontainer.json").read_text()


def test_what_is_excused_has_a_reason() -> None:
    reasons = PROJECT["tool"]["repo-review"]["ignore"]
    assert reasons
    assert [rule for rule, reason in reasons.items() if len(reason.split()) < 4] == []


def test_the_hooks_do_what_the_checks_do() -> None:
    config = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())
    hooks = {hook["id"] for repository in config["repos"] for hook in repository["hooks"]}
    asked = {"ruff-check", "ruff-format", "mypy", "lint-imports", "typos"}
    assert asked | {"trailing-whitespace", "check-added-large-files"} <= hooks
    pins = [repository["rev"] for repository in config["repos"] if repository["repo"] != "local"]
    assert all(re.fullmatch(r"[0-9a-f]{40}", pin) for pin in pins)


def test_the_citation_has_the_licence_and_the_name_of_the_distribution() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["license"] == PROJECT["project"]["license"]
    assert citation["title"].startswith(PROJECT["project"]["name"])
