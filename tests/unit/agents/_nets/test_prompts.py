"""What can be said to `simlingo`: instructions and prompts."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drive_robust_agents._nets import prompts, words
from drive_robust_agents._nets.prompts import PHRASES, THINGS, Instruction, Kind, parse_instruction
from drive_robust_agents.training.data.commentary import Action, Commentary, Reason
from pytest_drive_robust import RoadOption
from pytest_drive_robust.errors import UsageError

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


@given(instructions())
def test_an_instruction_is_understood_as_it_was_said(told: Instruction) -> None:
    assert parse_instruction(told.text) == told
    assert parse_instruction(told.text.capitalize() + ".") == told


@pytest.mark.parametrize("text", ["drive left", "keep 100.5 m/s", "keep 8.5 m", "hit the lane", "keep m/s", ""])
def test_a_sentence_that_was_never_learnt_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="there is no instruction named"):
        parse_instruction(text)


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
