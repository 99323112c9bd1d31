"""`--drive-reading`, the marker and brackets: what is driven, and that every output says which reading it was."""

from __future__ import annotations

import csv
import json

import jsonschema
import pytest
from published_schema import run_schema

LATE = "RD under 150 ms latency <= 0.90"
MARKED = """
import pytest
from pytest_drive_robust import InferenceLatency, Setting, requirement, requirements

late, = requirements("RD under 150 ms latency <= 0.90")

@pytest.mark.parametrize("requirement", [late])
def test_of_the_run(drive, requirement):
    assert drive.check(requirement).requirement.setting == READ_BY_THE_RUN

@pytest.mark.drive_robust(reading="released")
@pytest.mark.parametrize("requirement", [late])
def test_of_the_marker(drive, requirement):
    released = "RD under 150 ms latency (reading=released) <= 0.90"
    assert str(drive.check(requirement).requirement) == released

def test_objects_and_sentences_are_read_alike(drive):
    read = str(READ_BY_THE_RUN)
    assert drive.check(requirement("RD", InferenceLatency(ms=150)) <= 0.9).requirement.setting == READ_BY_THE_RUN
    assert drive.rd(InferenceLatency(ms=150)).setting == read
    assert drive.ds(Setting.parse("150 ms latency")).setting == read
    assert drive.sr("150 ms latency").setting == read
    assert {episode.episode.setting for episode in drive.episodes(InferenceLatency(ms=150))} == {read}

def test_a_search_keeps_to_the_reading(drive):
    found = drive.largest(InferenceLatency, limit=0.95, levels=[100, 150])
    assert found >= InferenceLatency(ms=100)
    assert str(found.ladder.at(100)) == str(READ_BY_THE_RUN).replace("150", "100")
    assert ("(reading=released)" in str(found)) == ("released" in str(READ_BY_THE_RUN))
"""
PROCESSES = pytest.mark.parametrize("workers", [(), ("-n2",)], ids=["one-process", "two-workers"])


def run(suite, *args):
    return suite.runpytest_inprocess("--drive-robust", "--drive-json", "run.json", "--drive-csv", "run.csv", *args)


def settings_of(folder) -> list[str]:
    document = json.loads((folder.path / "run.json").read_text())
    jsonschema.validate(document, run_schema())
    return [row["setting"] for row in document["summaries"]]


def refused(folder, *args) -> str:
    result = folder.runpytest_inprocess("--drive-robust", *args)
    assert result.ret == 4
    output = "\n".join((*result.outlines, *result.errlines))
    assert "Traceback" not in output
    return output


def test_without_a_word_it_is_the_papers_and_the_header_says_so(suite):
    folder = suite(LATE)
    result = run(folder)
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(["drive-robust: agent=steady * reading=paper *"])
    assert settings_of(folder) == ["clean", "150 ms latency"]
    assert json.loads((folder.path / "run.json").read_text())["settings"]["reading"] == "paper"
    result.stdout.no_fnmatch_line("*reading=released*")


@PROCESSES
def test_every_output_of_a_run_in_the_other_reading_says_so(suite, workers):
    folder = suite("DS under 150 ms latency >= 99", "RD under 1 s burst frame drop and 150 ms latency <= 0.90")
    result = run(folder, "--drive-reading", "released", *workers)
    result.assert_outcomes(passed=1, failed=1)
    late = "150 ms latency (reading=released)"
    both = f"1 s burst frame drop (reading=released) and {late}"
    assert sorted(settings_of(folder)) == ["0 ms latency (reading=released)", both, late]
    document = json.loads((folder.path / "run.json").read_text())
    assert document["settings"]["reading"] == "released"
    assert {item["setting"] for item in document["requirements"]} == {late, both}
    with (folder.path / "run.csv").open() as file:
        assert {row["setting"] for row in csv.DictReader(file)} == set(settings_of(folder))
    shown = ["drive-robust: agent=steady * reading=released *"] if not workers else []
    result.stdout.fnmatch_lines([*shown, f"DS under {late} = *", f'  replay: * --setting "{late}" *'])


def test_the_ini_key_asks_and_the_command_line_wins(suite):
    folder = suite(LATE)
    with (folder.path / "tox.ini").open("a") as ini:
        ini.write("drive_reading = released\n")
    run(folder).assert_outcomes(passed=1)
    assert "150 ms latency (reading=released)" in settings_of(folder)
    run(folder, "--drive-reading", "paper").assert_outcomes(passed=1)
    assert settings_of(folder) == ["clean", "150 ms latency"]


@pytest.mark.parametrize("reading", ["paper", "released"])
def test_the_marker_wins_over_the_run_and_objects_are_read_as_sentences_are(suite, reading):
    sentence = "150 ms latency" + (" (reading=released)" if reading == "released" else "")
    conftest = "import builtins\nfrom pytest_drive_robust import Setting\n"
    conftest += f"builtins.READ_BY_THE_RUN = Setting.parse({sentence!r})\n"
    run(suite(test=MARKED, conftest=conftest), "--drive-reading", reading).assert_outcomes(passed=4)


def test_a_sentence_says_its_own_reading_whatever_the_run_asks_for(suite):
    folder = suite("RD under 150 ms latency (reading=paper) <= 0.90", "latency margin >= 100 ms (RD <= 0.95)")
    run(folder, "--drive-reading", "released").assert_outcomes(passed=2)
    assert settings_of(folder) == [
        *("clean", "150 ms latency", "0 ms latency (reading=released)", "100 ms latency (reading=released)")
    ]


def test_the_switches_spelled_out_are_the_same_episodes(suite, driven):
    folder = suite(LATE.replace("latency", "latency (mode=hold, warmup_ticks=20)"))
    run(folder).assert_outcomes(passed=1)
    before = len(driven())
    run(suite(LATE), "--drive-reading", "released").assert_outcomes(passed=1)
    assert before > 0
    assert len(driven()) == before


@PROCESSES
def test_a_switch_that_contradicts_the_reading_is_a_usage_error_with_both(suite, driven, workers):
    folder = suite("RD under 150 ms latency (mode=fifo) <= 0.90")
    output = refused(folder, "--drive-reading", "released", *workers)
    assert "mode=fifo contradicts the reading 'released', which has mode=hold (--drive-reading released)" in output
    assert driven() == []


def test_a_marker_that_contradicts_a_switch_is_named(suite, driven):
    test = """
import pytest
from pytest_drive_robust import requirements

@pytest.mark.drive_robust(reading="paper")
@pytest.mark.parametrize("requirement", requirements("RD under 150 ms latency (mode=hold) <= 0.9"))
def test_late(drive, requirement):
    drive.check(requirement)
"""
    output = refused(suite(test=test))
    assert "mode=hold contradicts the reading 'paper', which has mode=fifo (the marker drive_robust(" in output
    assert driven() == []


def test_switches_are_free_where_nobody_asks_for_a_reading(suite):
    folder = suite("RD under 150 ms latency (mode=hold) <= 0.90")
    run(folder).assert_outcomes(passed=1)
    assert settings_of(folder) == ["clean", "150 ms latency (mode=hold)"]


@pytest.mark.parametrize("args", [("--drive-reading", "relesed")], ids=["option"])
def test_an_unknown_reading_is_refused_with_the_nearest_one(suite, driven, args):
    assert "there is no reading named 'relesed'. Did you mean 'released'?" in refused(suite(LATE), *args)
    assert driven() == []


def test_how_much_time_went_by_stands_in_the_observation(suite):
    conftest = """
class Clock:
    consumes = frozenset({"speed"})

    def sensors(self):
        return ()

    def reset(self, route, seed):
        self.seen = []

    def act(self, observation):
        self.seen.append(observation.tick)
        with (Path(__file__).parent / "ticks.txt").open("a") as file:
            file.write(f"{observation.tick} ")
        return Control(throttle=1.0)

AGENTS.append(Clock)
"""
    folder = suite("DS under 150 ms latency (reading=released) >= 1", conftest=conftest)
    folder.runpytest_inprocess("--drive-robust", "--drive-agent", "Clock").assert_outcomes(passed=1)
    ticks = [int(word) for word in (folder.path / "ticks.txt").read_text().split()]
    starts = [place for place, tick in enumerate(ticks) if tick == 0]
    assert len(starts) >= 3
    assert ticks[: starts[1]] == list(range(0, 3 * starts[1], 3))
