"""Strategies for hypothesis: what is drawn, and what it shrinks to."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis.database import DirectoryBasedExampleDatabase
from hypothesis.errors import NoSuchExample
from hypothesis.strategies import SearchStrategy

from pytest_drive_robust.perturbations import BUILTIN, GpsNoise, InferenceLatency, PartialObservation, Setting
from pytest_drive_robust.testing import strategies


def smallest(strategy: SearchStrategy[Setting], condition: object = lambda _: True) -> Setting:
    from hypothesis import find

    return find(strategy, condition, settings=hypothesis_settings(database=None, max_examples=2000))  # type: ignore[arg-type]


@given(strategies.settings())
def test_settings_are_stacks_of_different_failures_in_one_order(setting: Setting) -> None:
    kinds = [type(item) for item in setting.perturbations]
    assert 1 <= len(kinds) <= 3
    assert kinds == [cls for cls in BUILTIN.values() if cls in kinds]
    assert Setting.parse(str(setting)) == setting


@given(strategies.settings(min_size=2, max_size=2), strategies.settings([GpsNoise], min_size=0))
def test_sizes_are_kept(two: Setting, few: Setting) -> None:
    assert len(two.perturbations) == 2
    assert len(few.perturbations) <= 1


@given(strategies.perturbations(InferenceLatency(ms=0, mode="hold"), dt_s=0.02))
def test_objects_keep_their_other_severities(latency: InferenceLatency) -> None:
    assert latency.mode == "hold"
    assert (latency.ms or 0.0) % 20.0 == 0.0


def test_sizes_that_the_failures_cannot_fill_are_refused() -> None:
    with pytest.raises(ValueError, match="stacks of 2 to 3 of 1 failures"):
        strategies.settings([GpsNoise], min_size=2)


def test_shrinking_ends_at_one_mild_failure() -> None:
    assert len(smallest(strategies.settings()).perturbations) == 1
    assert str(smallest(strategies.settings([InferenceLatency]))) == "50 ms latency"


def test_shrinking_leaves_what_the_property_needs_and_nothing_else() -> None:
    def breaks(setting: Setting) -> bool:
        found = {type(item): item for item in setting.perturbations}
        latency, mask = found.get(InferenceLatency), found.get(PartialObservation)
        return isinstance(latency, InferenceLatency) and (latency.ms or 0.0) >= 150 and mask is not None

    assert str(smallest(strategies.settings(), breaks)) == "occlusion 0.1 and 150 ms latency"


def test_nothing_is_found_where_nothing_breaks() -> None:
    with pytest.raises(NoSuchExample):
        smallest(strategies.settings([GpsNoise]), lambda setting: False)


def test_what_failed_is_tried_first_the_next_time(tmp_path: Path) -> None:
    seen: list[str] = []

    @strategies.driving(max_examples=50, database=DirectoryBasedExampleDatabase(tmp_path))
    @given(setting=strategies.settings())
    def holds(setting: Setting) -> None:
        seen.append(str(setting))
        assert "GPS" not in str(setting)

    with pytest.raises(AssertionError):
        holds()
    failed = next(sentence for sentence in seen if "GPS" in sentence)
    seen.clear()
    with pytest.raises(AssertionError):
        holds()
    assert seen[0] == failed
