"""`docs/architecture.md` speaks of the code as it is."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "pytest_drive_robust"
TEXT = (ROOT / "docs" / "architecture.md").read_text()
WALKS = {
    "An observation becomes a control": 11,
    "A requirement becomes a verdict": 15,
    "An episode request becomes a record": 12,
}


def section(title: str) -> str:
    return re.split(r"^#+ ", TEXT.partition(f" {title}\n")[2], maxsplit=1, flags=re.MULTILINE)[0]


@pytest.mark.parametrize(("title", "longest"), WALKS.items(), ids=str)
def test_a_walk_is_short_and_opens_modules_that_exist(title: str, longest: int) -> None:
    opened = re.findall(r"^\d+\. `([\w/]+\.py)`: ", section(title), flags=re.MULTILINE)
    assert 5 < len(opened) <= longest
    assert len(set(opened)) == len(opened)
    assert [name for name in opened if not (PACKAGE / name).is_file()] == []


def test_every_room_is_in_the_picture_and_named_by_the_import_rules() -> None:
    rooms = {folder.name for folder in PACKAGE.iterdir() if (folder / "__init__.py").is_file()}
    drawn = set(re.findall(r"│ (\w+) ", section("The rooms")))
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    layers = next(contract["layers"] for contract in contracts if contract["type"] == "layers")
    named = {name.strip().rpartition(".")[2] for layer in layers for name in layer.split("|")}
    assert rooms <= drawn
    assert rooms | {"errors", "hookspecs"} == named


def test_nothing_lies_at_the_root_but_the_public_names_the_errors_and_the_hooks() -> None:
    assert {file.name for file in PACKAGE.glob("*.py")} == {"__init__.py", "errors.py", "hookspecs.py"}


def test_every_file_that_is_named_exists() -> None:
    named = set(re.findall(r"`((?:[\w]+/)+[\w]+\.(?:py|toml))`", TEXT))
    named = {name for name in named if "NAME" not in name}
    assert [name for name in sorted(named) if not any((base / name).is_file() for base in (ROOT, PACKAGE))] == []
