"""What `simlingo` can say: the grammar of its commentary."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from drive_robust_agents._nets import prompts, words
from drive_robust_agents.training.data.commentary import Action, Commentary, Reason, refusal

sentences = st.builds(Commentary, st.sampled_from(Action), st.sampled_from(Reason))


@given(st.booleans(), sentences)
def test_an_answer_fits_its_slots_word_by_word(refuses: bool, said: Commentary) -> None:
    text = refusal(said) if refuses else said.text
    row = prompts.answer_row(text)
    assert len(row) == prompts.ANSWER_SLOTS
    assert words.decode(row) == f"{text} waypoints:"


def test_no_two_answers_are_the_same_words() -> None:
    said = [Commentary(action, reason) for action in Action for reason in Reason]
    answers = [answer for one in said for answer in (one.text, refusal(one))]
    assert len(set(answers)) == 2 * len(Action) * len(Reason)
