"""Run what a page of the documentation shows: its blocks in order, in one empty folder, as a reader would.

A comment before a block says what it is; without one a `python` block is executed, an `sh` block is run and must end
with exit code 0, a `toml`, `yaml`, `json` or `xml` block must parse, and others are only text.

=========================== ==========================================================================================
comment                     the block below it
=========================== ==========================================================================================
`<!-- file: NAME -->`       is written to that file
`<!-- run: exit 1 -->`      is run and must end with that code
`<!-- run: with A=b -->`    is run with these variables: `PYTEST_ADDOPTS=--drive-routes=801` makes a long run short
`<!-- shows -->`            is what the last command printed: each line somewhere, in this order; `...` stands for any
`<!-- shows like -->`       the same but for the numbers, which are those of one machine
`<!-- not run: REASON -->`  needs what is not there
`<!-- slow -->`             (anywhere) the page takes more than ten seconds
=========================== ==========================================================================================
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import yaml

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = ["Block", "blocks_of", "is_slow", "run_page"]

_BLOCK = re.compile(
    r"^(?P<indent> *)(?P<fence>`{3,})(?P<language>[\w{}-]*)[^\n]*\n(?P<body>.*?)^ *(?P=fence) *$", re.M | re.S
)
_COMMENT = re.compile(r"<!-- (?P<words>[^\n]*?) -->\s*\Z")
_RULE = re.compile(r"([=_])\1{3,}")
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
_MINUTES = re.compile(r"(?<=\ds) \(\d+:\d\d:\d\d\)")
"""What pytest adds to the seconds of a run from a minute on, as a loaded machine takes."""
_PARSERS: dict[str, Callable[[str], object]] = {
    "toml": tomllib.loads,
    "yaml": yaml.safe_load,
    "json": json.loads,
    "xml": ElementTree.fromstring,
}
_RUN_ELSEWHERE = ("drive", "complete", "test")
"""Commands of the README that need the repository: `.ci/run` runs its set-up, `tests/readme` the complete table."""


@dataclass(frozen=True)
class Block:
    """One fenced block: where it begins, its language, the words of the comment before it, its text."""

    line: int
    language: str
    comment: str
    text: str


def blocks_of(text: str) -> Iterator[Block]:
    """Yield the blocks of a page. Directives of MyST are the site's, not the reader's."""
    for match in _BLOCK.finditer(text):
        if not match["language"].startswith("{"):
            comment = _COMMENT.search(text[: match.start()])
            line = text.count("\n", 0, match.start()) + 1
            yield Block(line, match["language"], comment["words"] if comment else "", textwrap.dedent(match["body"]))


def is_slow(text: str) -> bool:
    """Return whether the page says that it takes more than ten seconds."""
    return "<!-- slow -->" in text


def run_page(page: Path, folder: Path) -> None:
    """Run every block of `page` in `folder`. Raises `AssertionError` that names the line of the one that fails."""
    session = _Session(folder)
    for block in blocks_of(page.read_text(encoding="utf-8")):
        try:
            session.run(block)
        except Exception as error:  # noqa: PERF203 - the line that failed is what one looks for
            raise AssertionError(f"{page}:{block.line}: {type(error).__name__}: {error}") from error


class _Session:
    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._names: dict[str, object] = {"__name__": "page"}
        self._printed = ""

    def run(self, block: Block) -> None:
        what, _, words = block.comment.partition(": ")
        if what == "file":
            path = self._folder / words
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.text, encoding="utf-8")
        elif what in ("shows", "shows like"):
            _require_shown(block.text, self._printed, numbers=what == "shows")
        elif what == "not run":
            assert words, "say why this block is not run"
        elif block.comment in _RUN_ELSEWHERE:
            pass
        elif block.language == "sh":
            self._run_shell(block.text, words if what == "run" else "")
        elif block.language == "python":
            self._run_python(block)
        elif block.language in _PARSERS:
            _PARSERS[block.language](block.text)
        else:
            assert block.language in ("", "text"), f"a block of {block.language!r} needs a comment that says what it is"

    def _run_shell(self, command: str, how: str) -> None:
        expected = int(how.removeprefix("exit ").split()[0]) if how.startswith("exit ") else 0
        given = dict(word.split("=", 1) for word in how.partition("with ")[2].split(";") if word)
        # A page speaks to someone at a desk: where CI is set, blessing is refused.
        environ = {
            name: value
            for name, value in os.environ.items()
            if name == "PYTEST_ADDOPTS" or (name != "CI" and not name.startswith(("PYTEST_", "COV_", "GITHUB_")))
        }
        path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
        done = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", command],
            cwd=self._folder,
            env={**environ, "PATH": path, "COLUMNS": "100", **given},
            capture_output=True,
            text=True,
            check=False,
        )
        self._printed = done.stdout + done.stderr
        assert done.returncode == expected, (
            f"{command}exit code {done.returncode}, expected {expected}\n{self._printed}"
        )

    def _run_python(self, block: Block) -> None:
        printed = io.StringIO()
        here = Path.cwd()
        sys.path.insert(0, str(self._folder))
        os.chdir(self._folder)
        try:
            with contextlib.redirect_stdout(printed):
                exec(compile(block.text, f"block at line {block.line}", "exec"), self._names)
        finally:
            os.chdir(here)
            sys.path.remove(str(self._folder))
        self._printed = printed.getvalue()


def _require_shown(shown: str, printed: str, *, numbers: bool) -> None:
    """Raise `AssertionError` for the first line that the output does not hold, after those before it."""
    output = [_plain(line, numbers=numbers) for line in printed.splitlines()]
    at = 0
    for line in filter(None, (_plain(line, numbers=numbers) for line in shown.splitlines())):
        if line == "...":
            continue
        pattern = re.escape(line).replace(r"\.\.\.", ".*")
        found = next((number for number in range(at, len(output)) if re.fullmatch(pattern, output[number])), None)
        assert found is not None, f"nothing printed reads {line!r} in:\n{printed}"
        at = found + 1


def _plain(line: str, *, numbers: bool) -> str:
    words = _MINUTES.sub("", " ".join(_RULE.sub(r"\1\1\1", line).split()))  # a rule is as long as the terminal is wide
    return words if numbers else _NUMBER.sub("0", words)
