from __future__ import annotations

import io
from contextlib import contextmanager

from pytest_drive_robust.report.progress import LiveProgress, PlainProgress
from pytest_drive_robust.report.progress_state import ProgressState
from pytest_drive_robust.store.events import (
    Compiling,
    EpisodesNeeded,
    Finished,
    Planned,
    Spared,
    Started,
    StoreTroubled,
)


class Clock:
    now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


class FakeScreen:
    def __init__(self) -> None:
        self.stream = io.StringIO()

    @contextmanager
    def __call__(self):
        yield self.stream


def needed(setting: str, *keys: str) -> EpisodesNeeded:
    return EpisodesNeeded("driver", "two", setting, (0,), keys)


def started(key: str) -> Started:
    return Started(key, "driver", "clean", f"{key} Straight")


def test_planned_episodes_count_once_and_the_total_grows_when_tests_ask_for_more():
    state = ProgressState(Clock())
    for event in (Planned(("a", "b")), Planned(("a", "b")), needed("clean", "b", "c"), Finished("a", 1.0)):
        state.see(event)
    assert (state.done, state.total) == (1, 3)


def test_the_time_left_follows_from_the_time_that_passed():
    clock = Clock()
    state = ProgressState(clock)
    state.see(Planned(("a", "b", "c", "d")))
    state.see(started("a"))
    assert state.left_s is None
    clock.now_s += 30.0
    state.see(Finished("a", 30.0))
    assert state.left_s == 90.0
    assert state.counts() == "1/4 episodes, about 90 s left"


def test_it_says_what_is_under_way():
    clock = Clock()
    state = ProgressState(clock)
    state.see(started("a"))
    state.see(started("b"))
    assert state.now() == "driver, clean, b Straight (and 1 more)"
    state.see(Finished("b", 1.0))
    assert state.now() == "driver, clean, a Straight"
    clock.now_s += 60.0
    state.see(Finished("a", 1.0))
    assert state.now() == "", "the next one begins soon"
    clock.now_s += 4.0
    assert state.now() == "waiting for another run"


def test_a_setting_is_complete_when_its_last_episode_is():
    state = ProgressState(Clock())
    clean = needed("clean", "a", "b")
    assert state.see(clean) == []
    assert state.see(Finished("a", 1.0)) == []
    assert state.see(Finished("b", 1.0)) == [clean]
    assert state.see(clean) == [], "a second test that asks has nothing to wait for"


def test_of_two_settings_that_end_together_the_perturbed_one_is_named():
    screen = FakeScreen()
    progress = PlainProgress(screen, Clock())
    for event in (needed("clean", "a", "b"), needed("late", "c", "d"), Finished("a", 1.0), Finished("c", 1.0)):
        progress.see(event)
    progress.see(Spared(("b", "d")))
    assert screen.stream.getvalue().startswith("drive-robust: driver under late done, 2/2 episodes")


def test_plain_lines_are_few():
    clock, screen = Clock(), FakeScreen()
    progress = PlainProgress(screen, clock)
    for number in range(20):
        progress.see(needed(f"setting {number}", f"key {number}"))
        progress.see(Finished(f"key {number}", 0.1))
        clock.now_s += 1.0
    lines = screen.stream.getvalue().splitlines()
    assert lines[0] == "drive-robust: driver under setting 0 done, 1/1 episodes"
    assert len(lines) == 7


def test_a_long_setting_gives_a_sign_of_life():
    clock, screen = Clock(), FakeScreen()
    progress = PlainProgress(screen, clock)
    progress.see(needed("clean", "a"))
    progress.see(started("a"))
    for _ in range(600):
        clock.now_s += 0.1
        progress.refresh()
    assert screen.stream.getvalue().count("0/1 episodes, now driver, clean, a Straight") == 2


def test_a_problem_of_the_store_is_said_at_once_and_only_once():
    for progress in (PlainProgress(screen := FakeScreen(), Clock()), LiveProgress(other := FakeScreen(), Clock())):
        for _ in range(2):  # two workers send it
            progress.see(StoreTroubled("the disk is full"))
    assert screen.stream.getvalue() == other.stream.getvalue() == "drive-robust: the disk is full\n"


def test_compiling_is_said_at_once_and_then_every_five_seconds():
    clock, screen = Clock(), FakeScreen()
    progress = PlainProgress(screen, clock)
    progress.see(needed("clean", "a"))
    progress.see(started("a"))
    for done in range(13):
        progress.see(Compiling(done, 12))
        progress.refresh()
        clock.now_s += 1.0
    said = [line.partition(": ")[2] for line in screen.stream.getvalue().splitlines()]
    assert said == [f"compiling, {done} of 12 functions done (kept for later runs)" for done in (0, 5, 10)]


def test_nothing_is_compiling_any_more_when_an_episode_ends():
    state = ProgressState(Clock())
    for event in (Compiling(0, 12), Finished("a", 1.0)):
        state.see(event)
    assert state.compiling() == ""


def test_the_live_line_counts_functions_while_they_are_compiled():
    clock, screen = Clock(), FakeScreen()
    progress = LiveProgress(screen, clock)
    for event in (needed("clean", "a"), started("a"), Compiling(3, 12)):
        progress.see(event)
    progress.refresh()
    drawn = screen.stream.getvalue()
    progress.see(Compiling(12, 12))
    clock.now_s += 1.0
    progress.refresh()
    progress.pause()
    assert "compiling, 3 of 12 functions done" in drawn
    assert "0/1 episodes" not in drawn
    assert "0/1 episodes" in screen.stream.getvalue()


def test_where_the_line_is_full_the_episode_is_cut_off_and_not_the_time_left(monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    clock, screen = Clock(), FakeScreen()
    progress = LiveProgress(screen, clock)
    setting = "GPS noise 15 m and speed noise 0.2"
    for event in (
        needed(setting, "a", "b"),
        started("a"),
        Finished("a", 90.0),
        Started("b", "expert", setting, "2801 " * 9),
    ):
        clock.now_s += 60.0
        progress.see(event)
    progress.refresh()
    progress.pause()
    drawn = screen.stream.getvalue()
    assert "1/2 episodes, about 2 min left" in drawn
    assert "expert, GPS noise 15 m" in drawn
    assert "…" in drawn
