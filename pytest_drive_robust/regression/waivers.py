"""Waivers: requirements that may fail until a date, in a TOML file that people review.

::

    [[waiver]]
    requirement = "RD under 500 ms latency <= 0.30"   # the sentence, the id of the test case, or a pattern of either
    agent = "classical"                               # or a pattern; left out: every agent
    owner = "planning team"
    reason = "the new planner lands in week 50"
    expires = 2026-12-15                              # the last day on which it holds

The sentence is the sentence of the summary, with ``(reading=released)`` where failures are read in that way. The id of
the test case matches in both readings. The spelling of a number or a failure does not matter: ``<= 0.3`` and
``500ms latency`` match too.

The file is TOML, because people write and read waivers and want comments.
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from datetime import date, datetime
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path
from typing import Any

from pytest_drive_robust.errors import UnknownNameError, UsageError, did_you_mean, nearest
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.regression import clock
from pytest_drive_robust.store.events import Judged
from pytest_drive_robust.verdict.sentences import requirements

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


_GROUP = re.compile(r"(?<=[\])\w])@[^]/:@]*\Z")
"""The suffix that `--dist loadgroup` of pytest-xdist adds to a test id: `test_suite.py::test_it[case]@group`."""


@dataclass(frozen=True, slots=True)
class Waiver:
    """A requirement, or a pattern of requirements, that may fail until the end of `expires`; `owner` answers for it."""

    requirement: str
    owner: str
    reason: str
    expires: date
    agent: str = "*"

    def __str__(self) -> str:
        whom = "" if self.agent == "*" else f" of {self.agent}"
        return f"{self.requirement}{whom} ({self.owner} until {self.expires}: {self.reason})"

    @property
    def signature(self) -> str:
        """The waiver in words: `"waived by planning team until 2026-12-15: the new planner lands in week 50"`."""
        return f"waived by {self.owner} until {self.expires}: {self.reason}"

    @property
    def holds(self) -> bool:
        """True up to and on the day on which it expires."""
        return clock.today() <= self.expires

    def covers(self, sentence: str, nodeid: str, *, agent: str) -> bool:
        """Return True when the waiver matches the agent and the requirement's sentence, test case or test id."""
        test = _GROUP.sub("", nodeid)
        case = test[test.index("[") + 1 :].removesuffix("]") if "[" in test else test
        return _matches(self.agent, agent) and any(
            _matches(self.requirement, text) for text in (sentence, case, test, nodeid)
        )


class Waivers:
    """The waivers of a run."""

    def __init__(self, waivers: Sequence[Waiver] = ()) -> None:
        self._read = tuple(waivers)

    @cached_property
    def _waivers(self) -> tuple[Waiver, ...]:
        """The waivers, first asked for when tests run: a conftest.py beside the tests may name failures until then."""
        return tuple(replace(waiver, requirement=_as_judged(waiver.requirement)) for waiver in self._read)

    @classmethod
    def of(cls, path: Path | None) -> Waivers:
        """Return the waivers of a file, none for None. Raises `UsageError` for errors in the file."""
        return cls(() if path is None else read_waivers(path))

    def find(self, sentence: str, nodeid: str, *, agent: str) -> Waiver | None:
        """Return the waiver of a requirement, or None; if several match, the waiver that expires last."""
        found = [waiver for waiver in self._waivers if waiver.covers(sentence, nodeid, agent=agent)]
        return max(found, key=lambda waiver: waiver.expires, default=None)

    def review(self, judged: Sequence[Judged], *, whole: bool, open_fails: bool = False) -> list[str]:
        """Return the lines to report at the end of a run, at most one for each waiver, in the order of the file.

        `whole` says that every test was selected and ran; only then is a waiver without a match a mistake. `open_fails`
        says that an inconclusive verdict fails its test.
        """
        lines = (self._line(waiver, judged, whole=whole, open_fails=open_fails) for waiver in self._waivers)
        return [line for line in lines if line]

    def _line(self, waiver: Waiver, judged: Sequence[Judged], *, whole: bool, open_fails: bool) -> str:
        covered = [item for item in judged if waiver.covers(item.requirement, item.nodeid, agent=item.agent)]
        if not covered:
            return _matching_nothing(waiver, judged) if whole else ""
        verdicts = Counter(item.verdict for item in covered)
        failing = verdicts["fail"] + (verdicts["inconclusive"] if open_fails else 0)
        inconclusive = 0 if open_fails else verdicts["inconclusive"]
        counts = f"{failing} failing" if failing else "nothing fails"
        counts += f", {inconclusive} inconclusive" if inconclusive else ""
        if not waiver.holds:
            return f"waiver expired, {counts}{'' if failing else ', remove it'}: {waiver}"
        if failing:
            return f"waived, {counts}: {waiver}"
        if inconclusive:
            return f"waiver not used, {counts}: {waiver}"
        return f"waiver not needed any more, all of it passes: {waiver}" if verdicts["pass"] else ""


def _matching_nothing(waiver: Waiver, judged: Sequence[Judged]) -> str:
    """Return a warning with the nearest requirement or agent; empty for a known agent that was not driven."""
    meant = [item.requirement for item in judged if _matches(waiver.agent, item.agent)]
    if meant:
        close = nearest(waiver.requirement, meant)
        hint = f" The nearest one is {close!r}." if close else ""
        return f"warning: this waiver matches no requirement: {waiver}.{hint}"
    known = [name.partition(":")[0] for name, _ in default_registry().names("agents")]
    if not judged or ":" in waiver.agent or any(_matches(waiver.agent, name) for name in known):
        return ""
    hint = did_you_mean(waiver.agent, [*known, *(item.agent for item in judged)])
    return f"warning: this waiver matches no agent: {waiver}.{hint}"


def read_waivers(path: Path) -> tuple[Waiver, ...]:
    """Read the waivers of a file. Raises `UsageError`, naming the file and the waiver, for an error in the file."""
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8-sig"))  # some editors write a byte order mark
    except OSError as error:
        raise UsageError(f"the waivers {str(path)!r} cannot be read: {error.strerror}.") from None
    except RecursionError:
        raise UsageError(f"the waivers {str(path)!r} are not valid TOML: they are nested too deeply.") from None
    except ValueError as error:
        raise UsageError(f"the waivers {str(path)!r} are not valid TOML: {error}.") from None
    given = document.pop("waiver", [])
    if document:
        raise UnknownNameError.of(f"table in {str(path)!r}", next(iter(document)), ["waiver"])
    if not isinstance(given, list) or not all(isinstance(item, dict) for item in given):
        raise UsageError(f"'waiver' in {str(path)!r} is not a list of tables, expected [[waiver]] before each.")
    return tuple(_waiver(item, f"waiver {number} in {str(path)!r}") for number, item in enumerate(given, start=1))


def _waiver(given: Mapping[str, Any], where: str) -> Waiver:
    names = [item.name for item in fields(Waiver)]
    for name in given:
        if name not in names:
            raise UnknownNameError.of(f"key for {where}", name, names)
    for name in ("requirement", "owner", "reason", "expires"):
        if name not in given:
            raise UsageError(f"{where} has no {name!r}; expected requirement, owner, reason and expires.")
    for name in set(given) - {"expires"}:
        if not (isinstance(given[name], str) and given[name].strip()):
            raise UsageError(f"{where} has {name} = {given[name]!r}, expected text.")
    requirement, expires = _as_judged(given["requirement"]), _date(given["expires"], where)
    return Waiver(**{**given, "requirement": requirement, "expires": expires})


def _as_judged(requirement: str) -> str:
    """Return a sentence in the form that verdicts show, and a test id or a pattern unchanged."""
    try:
        (stated,) = requirements(requirement)
    except (UsageError, ValueError):  # no sentence, or several lines
        return requirement
    return str(stated)


def _date(given: object, where: str) -> date:
    if isinstance(given, date) and not isinstance(given, datetime):
        return given
    if isinstance(given, str):
        with suppress(ValueError):
            return date.fromisoformat(given)
    raise UsageError(f"{where} has expires = {given!r}, expected a date, as in expires = 2026-12-15.")


def _matches(pattern: str, text: str) -> bool:
    """Return whether `text` equals or matches `pattern`; equality first, as brackets are special in a pattern."""
    return pattern == text or fnmatchcase(text, pattern)
