"""The names of films: another one for each episode, and one that every disk takes."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.report.film.file_name import film_name

EPISODE = Episode("my_agent:MyAgent", "603", "GPS noise 5 m", 0)


def test_a_name_says_of_what_the_film_is() -> None:
    assert film_name(EPISODE).startswith("replay-my_agent-myagent-603-gps-noise-5-m-seed0-")
    assert film_name(Episode("tcp?engine=torch", "7", "clean", 12)).startswith(
        "replay-tcp-engine-torch-7-clean-seed12-"
    )


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (EPISODE, replace(EPISODE, agent="my_agent:Other")),
        (EPISODE, replace(EPISODE, route_id="604")),
        (EPISODE, replace(EPISODE, setting="GPS noise 15 m")),
        (EPISODE, replace(EPISODE, seed=1)),
        (EPISODE, replace(EPISODE, agent="My_Agent:MyAgent")),
        (EPISODE, replace(EPISODE, agent="my_agent.MyAgent")),
        (replace(EPISODE, agent="агент"), replace(EPISODE, agent="водитель")),
        (replace(EPISODE, agent="a-1", route_id="2"), replace(EPISODE, agent="a", route_id="1-2")),
        (replace(EPISODE, setting="x" * 500 + "y"), replace(EPISODE, setting="x" * 500 + "z")),
    ],
    ids=str,
)
def test_two_episodes_have_two_names_that_differ_in_more_than_case(one: Episode, other: Episode) -> None:
    assert film_name(one).lower() != film_name(other).lower()


@pytest.mark.parametrize("word", ["", "../..", "агент", "a\udcff", "x" * 500, "CON", "a\0b", "ﬀ İ"])
def test_a_name_is_one_that_every_disk_takes(word: str) -> None:
    name = film_name(Episode(word, word, word, 0))
    assert name.isascii()
    assert name == name.lower()
    assert len(name) < 130
    assert not set(name) & set('/\\:*?"<>|\0 ')
    assert name.endswith(".mp4")
