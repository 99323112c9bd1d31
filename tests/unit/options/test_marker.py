from __future__ import annotations

import pytest

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.marker import MarkerOptions
from pytest_drive_robust.perturbations.readings import DriveReading


def marks(*given):
    return [pytest.mark.drive_robust(**options).mark for options in given]


def test_the_closest_mark_wins_option_by_option():
    merged = MarkerOptions.from_marks(marks({"agent": "expert"}, {"agent": "classical", "seeds": [1, 2]}))
    assert merged == MarkerOptions(agent="expert", seeds=(1, 2))


def test_no_mark_says_nothing():
    assert MarkerOptions.from_marks([]) == MarkerOptions(None, None, None)


@pytest.mark.parametrize("seeds", [3, [3], (3,), range(3, 4)])
def test_seeds_may_be_one_number_or_several(seeds):
    assert MarkerOptions.from_marks(marks({"seeds": seeds})).seeds == (3,)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"rotes": "x"}, "Did you mean 'routes'"),
        ({"agent": 3}, "agent=3, expected text"),
        ({"routes": ""}, "routes='', expected text"),
        ({"seeds": "0,1"}, "expected whole numbers"),
        ({"seeds": []}, "at least one seed"),
        ({"reading": "relesed"}, r"Did you mean 'released'.*the marker drive_robust\(reading='relesed'\)"),
        ({"reading": 2}, "reading=2, expected text"),
        ({"verdict": "evidance"}, "Did you mean 'evidence'"),
        ({"margin": 2}, "margin is 2, expected a number between 0 and 1"),
        ({"margin": "much"}, "margin is 'much', expected a number"),
    ],
)
def test_what_a_mark_cannot_mean_is_refused(options, message):
    with pytest.raises(UsageError, match=message):
        MarkerOptions.from_marks(marks(options))


def test_a_mark_reads_failures_whatever_the_run_asks_for():
    run = DriveReading("paper", "--drive-reading paper")
    assert MarkerOptions.from_marks(marks({"reading": "released"})).asked_reading(run).name == "released"
    assert MarkerOptions.from_marks(marks({"agent": "a"})).asked_reading(run) is run
    assert MarkerOptions().asked_reading(None) is None


def test_a_word_without_its_keyword_is_refused():
    with pytest.raises(UsageError, match=r"Did you mean drive_robust\(agent='expert'\)"):
        MarkerOptions.from_marks([pytest.mark.drive_robust("expert").mark])
