"""Waivers: until the end of a day, and not one longer."""

from __future__ import annotations

from datetime import date, timedelta
from pathlib import Path

import pytest

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.regression import clock
from pytest_drive_robust.regression.waivers import Waiver, Waivers, read_waivers
from pytest_drive_robust.store.events import Judged
from pytest_drive_robust.verdict.sentences import requirements

LAST_DAY = date(2026, 12, 15)
SENTENCE = "RD under 500 ms latency <= 0.30"
NODEID = "suites/paper/test_paper.py::test_paper[rd-500ms-latency-le-0.30]"
WAIVER = Waiver(SENTENCE, "planning", "new planner", LAST_DAY)


def judged(verdict: str, *, agent: str = "driver", sentence: str = SENTENCE, nodeid: str = NODEID) -> Judged:
    return Judged(nodeid, sentence, agent, "full", (0,), "RD", "500 ms latency", "<=", 0.3, verdict)


@pytest.fixture(autouse=True)
def the_last_day(monkeypatch: pytest.MonkeyPatch) -> None:
    days_later(0, monkeypatch)


def days_later(days: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clock, "today", lambda: LAST_DAY + timedelta(days=days))


@pytest.mark.parametrize(
    ("days", "holds"), [(-365, True), (-1, True), (0, True), (1, False), (365, False)], ids=lambda value: str(value)
)
def test_a_waiver_holds_up_to_and_on_its_day(days: int, holds: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    days_later(days, monkeypatch)
    assert WAIVER.holds is holds


@pytest.mark.parametrize(
    ("requirement", "agent", "covered"),
    [
        (SENTENCE, "*", True),
        ("rd-500ms-latency-le-0.30", "driver", True),
        ("RD under * latency <= *", "dri*", True),
        (NODEID, "*", True),
        ("suites/paper/*", "*", True),
        ("RD under 500 ms latency", "*", False),
        ("rd-500ms-latency", "*", False),
        (SENTENCE, "other", False),
    ],
)
def test_a_waiver_covers_a_sentence_an_id_or_a_pattern(requirement: str, agent: str, covered: bool) -> None:
    waiver = Waiver(requirement, "planning", "why", LAST_DAY, agent)
    assert waiver.covers(SENTENCE, NODEID, agent="driver") is covered


def test_the_id_of_a_case_may_hold_brackets_of_its_own() -> None:
    waiver = Waiver("rig[0] late", "me", "why", date(2026, 12, 15))
    assert waiver.covers("RD under clean <= 0.3", "suites/test_a.py::test_it[rig[0] late]", agent="driver")
    assert not waiver.covers("RD under clean <= 0.3", "suites/test_a.py::test_it[rig[1] late]", agent="driver")


@pytest.mark.parametrize("nodeid", ["a@b/test_a.py::test_it", "a@b/test_a.py::test_it[rd-1]"])
def test_an_id_covers_where_xdist_adds_a_group(nodeid: str) -> None:
    """With `--dist loadgroup` the id of a test ends with its group, but for the newest versions of pytest."""
    for requirement in (nodeid, nodeid.partition("[")[2].rstrip("]") or nodeid):
        waiver = Waiver(requirement, "kim", "new planner", date(2026, 12, 15))
        assert waiver.covers("RD under clean <= 0.3", nodeid, agent="driver")
        assert waiver.covers("RD under clean <= 0.3", f"{nodeid}@slow-ones", agent="driver")
        assert not waiver.covers("RD under clean <= 0.3", f"{nodeid}2", agent="driver")


def test_of_several_waivers_the_longest_counts() -> None:
    short, long = (Waiver("RD*", "planning", "why", LAST_DAY + timedelta(days=n)) for n in (0, 5))
    assert Waivers([short, long]).find(SENTENCE, NODEID, agent="driver") == long
    assert Waivers([long, short]).find(SENTENCE, NODEID, agent="driver") == long
    assert Waivers().find(SENTENCE, NODEID, agent="driver") is None


@pytest.mark.parametrize(
    ("verdicts", "days", "told"),
    [
        (["fail", "pass"], 0, "waived, 1 failing: "),
        (["fail"], 1, "waiver expired, 1 failing: "),
        (["pass"], 0, "waiver not needed any more, all of it passes: "),
        (["pass"], 1, "waiver expired, nothing fails, remove it: "),
    ],
)
def test_the_review_says_what_became_of_a_waiver(
    verdicts: list[str], days: int, told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    days_later(days, monkeypatch)
    (line,) = Waivers([WAIVER]).review([judged(verdict) for verdict in verdicts], whole=True)
    assert line.startswith(told)
    assert "planning until 2026-12-15: new planner" in line


@pytest.mark.parametrize(
    ("verdicts", "days", "open_fails", "told"),
    [
        (["inconclusive", "fail"], 0, False, "waived, 1 failing, 1 inconclusive: "),
        (["inconclusive", "fail"], 0, True, "waived, 2 failing: "),
        (["inconclusive", "pass"], 0, False, "waiver not used, nothing fails, 1 inconclusive: "),
        (["inconclusive"], 1, False, "waiver expired, nothing fails, 1 inconclusive, remove it: "),
        (["inconclusive"], 1, True, "waiver expired, 1 failing: "),
    ],
)
def test_an_open_verdict_counts_as_failing_only_where_it_fails_its_test(
    verdicts: list[str], days: int, open_fails: bool, told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    days_later(days, monkeypatch)
    given = [judged(verdict) for verdict in verdicts]
    (line,) = Waivers([WAIVER]).review(given, whole=True, open_fails=open_fails)
    assert line.startswith(told)


def test_a_waiver_of_what_could_not_be_judged_is_not_called_superfluous() -> None:
    assert Waivers([WAIVER]).review([judged("error")], whole=True) == []


def test_a_waiver_that_matches_nothing_is_a_warning_only_when_everything_ran() -> None:
    others = [judged("pass", sentence="DS under clean >= 60", nodeid="t.py::t[ds]")]
    (line,) = Waivers([WAIVER]).review(others, whole=True)
    assert line.startswith("warning: this waiver matches no requirement: ")
    assert Waivers([WAIVER]).review(others, whole=False) == []


def test_the_warning_names_the_nearest_requirement_that_was_judged() -> None:
    waiver = Waiver("RD under 500 ms latency <= 0.15", "planning", "why", LAST_DAY)
    (line,) = Waivers([waiver]).review([judged("fail")], whole=True)
    assert line.endswith(f" The nearest one is {SENTENCE!r}.")


@pytest.mark.parametrize(("agent", "near"), [("drivr", "driver"), ("leaderbord", "leaderboard")])
def test_a_waiver_of_an_agent_that_nobody_knows_is_a_warning(agent: str, near: str) -> None:
    waiver = Waiver(SENTENCE, "planning", "why", LAST_DAY, agent)
    (line,) = Waivers([waiver]).review([judged("fail")], whole=True)
    assert line.startswith("warning: this waiver matches no agent: ")
    assert line.endswith(f" Did you mean {near!r}?")
    assert Waivers([waiver]).review([judged("fail")], whole=False) == []


@pytest.mark.parametrize("agent", ["leaderboard", "leader*", "my_agent:MyAgent"])
def test_a_waiver_of_an_agent_that_was_not_driven_says_nothing(agent: str) -> None:
    waiver = Waiver(SENTENCE, "planning", "why", LAST_DAY, agent)
    assert Waivers([waiver]).review([judged("fail")], whole=True) == []


@pytest.mark.parametrize(
    ("written", "covered"),
    [
        ("RD under 500ms latency <= 0.3", True),
        ("RD under 500 ms latency <= 0.30", True),
        ("RD under * latency <= *", True),
        ("rd-500ms-latency-le-0.30", True),
        ("RD under 500 ms latency <= 0.15", False),
    ],
)
def test_a_sentence_covers_however_it_is_written(tmp_path: Path, written: str, covered: bool) -> None:
    text = f'[[waiver]]\nrequirement = "{written}"\nowner = "a"\nreason = "b"\nexpires = 2026-12-15\n'
    (waiver,) = read_waivers(write(tmp_path, text))
    assert waiver.covers(str(requirements("RD under 500 ms latency <= 0.3")[0]), NODEID, agent="driver") is covered


def write(folder: Path, text: str) -> Path:
    path = folder / "waivers.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_is_read_with_dates_and_comments(tmp_path: Path) -> None:
    text = """
    # reviewed in the weekly meeting
    [[waiver]]
    requirement = "RD under 500 ms latency <= 0.30"
    owner = "planning"
    reason = "new planner"
    expires = 2026-12-15

    [[waiver]]
    requirement = "rd-*"
    agent = "classical"
    owner = "lee"
    reason = "old"
    expires = "2026-01-01"
    """
    first, second = read_waivers(write(tmp_path, text))
    assert first == WAIVER
    assert (second.agent, second.expires) == ("classical", date(2026, 1, 1))
    assert read_waivers(write(tmp_path, f"\ufeff{text}")) == (first, second), "some editors write a byte order mark"
    assert read_waivers(write(tmp_path, "")) == ()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("waiver = 1", "expected \\[\\[waiver\\]\\] before each"),
        ("[[waivers]]", "Did you mean 'waiver'"),
        ("[[waiver]]\nownr = 'k'", "Did you mean 'owner'"),
        ("[[waiver]]\nrequirement = 'x'\nowner = 'k'\nreason = 'r'", "waiver 1 in .* has no 'expires'"),
        (
            "[[waiver]]\nrequirement = 'x'\nowner = ' '\nreason = 'r'\nexpires = 2026-12-15",
            "owner = ' ', expected text",
        ),
        ("[[waiver]]\nrequirement = 'x'\nowner = 'k'\nreason = 'r'\nexpires = 'soon'", "expected a date"),
        ("[[waiver]]\nrequirement = 'x'\nowner = 'k'\nreason = 'r'\nexpires = 5", "expected a date"),
        (
            "[[waiver]]\nrequirement = 'x'\nowner = 'k'\nreason = 'r'\nexpires = 2026-12-15T10:00:00",
            "expected a date",
        ),
        ("[[waiver", "are not valid TOML"),
        ("a = " + "[" * 5000, "are not valid TOML: they are nested too deeply"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_with_its_place(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(UsageError, match=told):
        read_waivers(write(tmp_path, text))
