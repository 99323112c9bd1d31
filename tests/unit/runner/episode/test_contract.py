"""What an agent is told to have done wrong, also where what it raised or gave is odd itself."""

from __future__ import annotations

import sys
from typing import Any

import pytest

from pytest_drive_robust.errors import AgentError
from pytest_drive_robust.runner.episode.contract import agent_act, agent_privileged


class Raises:
    """Raises, or returns, what it is given."""

    def __init__(self, given: object) -> None:
        self.given = given

    def act(self, observation: object) -> Any:
        if isinstance(self.given, BaseException):
            raise self.given
        return self.given


def told(given: object) -> str:
    with pytest.raises(AgentError) as caught:
        agent_act(Raises(given), None)  # type: ignore[arg-type]
    return str(caught.value)


@pytest.mark.skipif(sys.version_info < (3, 11), reason="exceptions have no notes")
@pytest.mark.parametrize(("notes", "words"), [([1, None, "near the end"], "1; None; near the end"), (5, "5")])
def test_notes_that_are_no_text_are_told(notes: Any, words: str) -> None:
    error = ValueError("lost")
    error.__notes__ = notes  # type: ignore[attr-defined]
    assert told(error).startswith(f"act raised ValueError: lost; {words} (")


def test_an_exception_that_holds_itself_is_told() -> None:
    error = ValueError("round and round")
    error.exceptions = (error,)  # type: ignore[attr-defined]
    assert told(error).startswith("act raised ValueError: round and round; ValueError: round and round; ")


def test_what_leaves_the_process_when_it_is_shown_is_told() -> None:
    class Leaves:
        def __repr__(self) -> str:
            sys.exit(3)

    assert told(Leaves()).startswith("act returned something that cannot be shown (SystemExit in its __repr__) of type")


def test_what_a_property_raises_is_found_in_the_file_of_the_agent() -> None:
    class Unread:
        @property
        def privileged(self) -> bool:
            raise KeyError("map")

    with pytest.raises(
        AgentError, match=r"privileged raised KeyError: 'map' \(.*test_contract\.py:\d+ in privileged\)"
    ):
        agent_privileged(Unread())  # type: ignore[arg-type]
