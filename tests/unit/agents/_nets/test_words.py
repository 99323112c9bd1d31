"""What can be said to `simlingo` and what it can say: a closed vocabulary and small grammars."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("torch")

from drive_robust_agents._nets import prompts, words
from drive_robust_agents._nets.commentary import Action, Commentary, Reason, parse_commentary, refusal
from drive_robust_agents._nets.prompts import PHRASES, THINGS, Instruction, Kind, parse_instruction
from pytest_drive_robust import RoadOption
from pytest_drive_robust.errors import UsageError

spoken = st.lists(st.sampled_from([word for word in words.VOCABULARY if word.isalpha()]), min_size=1, max_size=12)
speeds = st.floats(0.0, 99.9).map(lambda value: round(value, 1))
sentences = st.builds(Commentary, st.sampled_from(Action), st.sampled_from(Reason))


@st.composite
def instructions(draw: st.DrawFn) -> Instruction:
    kind = draw(st.sampled_from(Kind))
    return Instruction(
        kind,
        mps=draw(speeds) if kind is Kind.SPEED else None,
        thing=draw(st.sampled_from(THINGS)) if kind is Kind.CRASH else None,
        phrase=draw(st.integers(0, len(PHRASES[kind]) - 1)),
    )


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


@given(instructions())
def test_an_instruction_is_understood_as_it_was_said(told: Instruction) -> None:
    assert parse_instruction(told.text) == told
    assert parse_instruction(told.text.capitalize() + ".") == told


@pytest.mark.parametrize("text", ["drive left", "keep 100.5 m/s", "keep 8.5 m", "hit the lane", "keep m/s", ""])
def test_a_sentence_that_was_never_learnt_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="there is no instruction named"):
        parse_instruction(text)


@given(st.booleans(), sentences)
def test_commentary_is_understood_as_it_was_said(refuses: bool, said: Commentary) -> None:
    text = refusal(said) if refuses else said.text
    assert parse_commentary(text) == (refuses, said)
    row = prompts.answer_row(text)
    assert len(row) == prompts.ANSWER_SLOTS
    assert words.decode(row) == f"{text} waypoints:"


def test_a_text_outside_the_grammar_of_commentary_is_refused() -> None:
    with pytest.raises(UsageError, match="there is no commentary named"):
        parse_commentary("stop because the vehicle is red")


@given(
    st.floats(allow_nan=True, allow_infinity=True),
    st.sampled_from(RoadOption),
    st.floats(0.0, 1e6),
    instructions(),
    sentences,
)
def test_every_prompt_of_the_grammar_fits_into_its_places(
    mps: float, command: RoadOption, metres: float, told: Instruction, said: Commentary
) -> None:
    way, by_command = prompts.by_targets(mps), prompts.by_command(mps, command, metres)
    texts = [prompts.driving(way), prompts.comment(way), prompts.driving(by_command), prompts.comment(by_command)]
    texts += [
        prompts.given(way, said.text),
        *(prompts.instructed(way, told, safety=safety) for safety in (True, False)),
    ]
    for text in texts:
        row = prompts.prompt_row(text)
        assert len(row) == prompts.PROMPT_SLOTS
        assert (row[0], row[-1]) == (words.SPEED, words.ANSWER)
        assert words.decode(row[1:-1]) == text


def test_a_prompt_that_is_too_long_is_refused() -> None:
    with pytest.raises(UsageError, match="has 21 words, expected at most 20"):
        prompts.prompt_row("stop " * 21)


@pytest.mark.parametrize(
    ("mps", "said"), [(-3.0, "0.0"), (-0.0, "0.0"), (math.nan, "0.0"), (math.inf, "99.9"), (12.349, "12.3")]
)
def test_speeds_that_no_prompt_can_say_are_cut(mps: float, said: str) -> None:
    assert prompts.by_targets(mps) == f"speed {said} m/s target <target> <next>"
