"""The closed vocabulary of `simlingo`."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drive_robust_agents._nets import words
from pytest_drive_robust.errors import UsageError

spoken = st.lists(st.sampled_from([word for word in words.VOCABULARY if word.isalpha()]), min_size=1, max_size=12)
speeds = st.floats(0.0, 99.9).map(lambda value: round(value, 1))


def test_every_word_has_one_number_and_the_table_of_the_network_has_room_for_all() -> None:
    assert len(set(words.VOCABULARY)) == len(words.VOCABULARY) == 95


@given(spoken)
def test_words_survive_encoding(said: list[str]) -> None:
    text = " ".join(said)
    assert words.decode(words.encode(text)) == text


@given(speeds)
def test_numbers_are_spelt_digit_by_digit_and_read_back(mps: float) -> None:
    numbers = words.encode(f"drive at {mps} m/s")
    assert len(numbers) == 3 + len(str(mps))
    assert words.decode(numbers) == f"drive at {mps} m/s"


def test_case_and_punctuation_do_not_matter_but_decimal_points_do() -> None:
    assert words.encode("Stop, now. Drive at 8.5 m/s!") == words.encode("stop now drive at 8.5 m/s")
    assert words.encode("8.5") != words.encode("85")


@pytest.mark.parametrize(("text", "near"), [("drive fastr", "'faster'"), ("stpo now", "'stop'"), ("leave_road", None)])
def test_an_unknown_word_is_refused_with_the_nearest_known_one(text: str, near: str | None) -> None:
    with pytest.raises(UsageError, match="there is no word named") as raised:
        words.encode(text)
    assert near is None or f"Did you mean {near}?" in str(raised.value)


def test_a_number_that_no_word_has_is_refused() -> None:
    with pytest.raises(UsageError, match=r"expected 0\.\.94"):
        words.decode([95])
