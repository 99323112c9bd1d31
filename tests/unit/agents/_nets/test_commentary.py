"""What `simlingo` can say: the grammar of its commentary."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drive_robust_agents._nets import prompts, words
from drive_robust_agents._nets.commentary import Action, Commentary, Reason, parse_commentary, refusal
from pytest_drive_robust.errors import UsageError

sentences = st.builds(Commentary, st.sampled_from(Action), st.sampled_from(Reason))


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
