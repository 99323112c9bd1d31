"""Lockstep is refused to every agent whose answer depends on who shares the batch, and to no other."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from lockstep_agents import Floats, Net, bits, drive_together, task

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import Observation
from pytest_drive_robust.runner.lockstep.check import Recording, check_lockstep, record
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.testing import FakeSimulator, ScriptedAgent


def world() -> FakeSimulator:
    return FakeSimulator(SimulatorOptions(tick_cap=150))


def recorded() -> list[Recording]:
    recordings = [record(world(), Net(), task(metres=metres, seed=seed)) for metres, seed in ((20.0, 0), (15.0, 1))]
    return [recording for recording in recordings if recording is not None]


def test_a_recording_is_what_the_agent_was_given() -> None:
    recording = record(world(), Net(), task(seed=3), count=4, every=5)
    assert recording is not None
    assert recording.seed == 3
    assert [seen.tick for seen in recording.observations] == [0, 5, 10, 15]
    assert all("front" in seen.cameras for seen in recording.observations)


def test_a_recording_ends_where_the_episode_ends() -> None:
    recording = record(world(), Net(), task(metres=1.0), count=100, every=1)
    assert recording is not None
    assert 1 < len(recording.observations) < 100


def test_what_breaks_before_anything_was_seen_gives_no_recording() -> None:
    assert record(world(), Net(), task(seed=904)) is None
    assert record(FakeSimulator(raises=OSError("gone"), raises_in="reset"), Net(), task()) is None


def test_the_same_sums_in_the_same_order_are_accepted() -> None:
    assert check_lockstep(Net, recorded()) is None


def normalised(inputs: Floats) -> Floats:
    return Net.forward(inputs - inputs.mean(axis=0))


def attending(inputs: Floats) -> Floats:
    scores = np.exp(np.einsum("bi,ci->bc", inputs, inputs))
    return Net.forward(np.einsum("bc,ci->bi", scores / scores.sum(axis=1, keepdims=True), inputs))


def by_place(inputs: Floats) -> Floats:
    return Net.forward(inputs + 1e-12 * np.arange(len(inputs))[:, None])


def by_width(inputs: Floats) -> Floats:
    return Net.forward(inputs if len(inputs) <= 8 else inputs[:, ::1] * (1.0 + 1e-12))


def dropping(inputs: Floats) -> Floats:
    return Net.forward(inputs * (np.random.default_rng().random(inputs.shape) < 0.9))


class Chained:
    """A state that agents share."""

    def __init__(self) -> None:
        self.last = np.zeros(3)

    def __call__(self, inputs: Floats) -> Floats:
        self.last = 0.5 * self.last + Net.forward(inputs).mean(axis=0)
        return Net.forward(inputs) * 0.9 + 0.01 * np.tanh(self.last)


def made(forward: Callable[[Floats], Floats]) -> type[Net]:
    return type("Made", (Net,), {"forward": staticmethod(forward)})


@pytest.mark.parametrize("forward", [normalised, attending, by_place, by_width, dropping, Chained()])
def test_whatever_depends_on_the_company_is_refused(forward: Callable[[Floats], Floats]) -> None:
    problem = check_lockstep(made(forward), recorded())
    assert problem is not None
    assert problem.startswith("act_batch gives Control(")
    assert "at place" in problem
    assert "for the same observation in other company. Usual causes: batch normalisation" in problem


@pytest.mark.parametrize("forward", [normalised, attending, by_place])
def test_one_width_is_enough_to_see_it(forward: Callable[[Floats], Floats]) -> None:
    assert check_lockstep(made(forward), recorded(), widths=[4]) is not None


@pytest.mark.parametrize("hidden", [24, 331, 777])
def test_a_matrix_product_is_taken_at_its_word_only_when_it_keeps_its_word(hidden: int) -> None:
    rng = np.random.default_rng(1)
    first, second = rng.normal(size=(8, hidden)), rng.normal(size=(hidden, 3))
    agent = made(lambda inputs: np.tanh(np.tanh(inputs @ first) @ second))
    if check_lockstep(agent, recorded()) is None:  # which products keep their bits is up to this machine's BLAS
        together = [task(metres=metres, seed=seed) for metres in (3.0, 8.0) for seed in range(3)]
        alone = [bits(drive_together(world, agent, [one])[0]) for one in together]
        assert [bits(result) for result in drive_together(world, agent, together)] == alone


def test_a_product_of_one_matrix_for_a_whole_batch_flattened_is_refused() -> None:
    def flattened(inputs: Floats) -> Floats:
        weights = np.random.default_rng(2).normal(size=(inputs.size, 3))
        return np.tanh(inputs.reshape(1, -1) @ weights / inputs.size) * np.ones((len(inputs), 1))

    assert check_lockstep(made(flattened), recorded()) is not None


def test_a_width_that_differs_is_found_when_it_is_asked_for() -> None:
    agent = made(by_width)
    assert check_lockstep(agent, recorded(), widths=(4, 8)) is None
    assert check_lockstep(agent, recorded(), widths=(4, 16)) is not None


def test_an_agent_without_act_batch_is_refused() -> None:
    problem = check_lockstep(lambda: ScriptedAgent([Control()]), recorded())
    assert problem == "ScriptedAgent has no act_batch."


def test_an_act_batch_that_breaks_is_refused_with_its_own_words() -> None:
    def broken(inputs: Floats) -> Floats:
        raise ValueError("expected 3 rows")

    problem = check_lockstep(made(broken), recorded())
    assert problem is not None
    assert problem.startswith("act_batch raised ValueError: expected 3 rows (")


def test_an_act_batch_that_gives_no_control_is_refused() -> None:
    class Nothing(Net):
        @classmethod
        def act_batch(cls, agents: Sequence[Net], observations: Sequence[Observation]) -> list[Control]:
            return [None] * len(agents)  # type: ignore[list-item]

    assert check_lockstep(Nothing, recorded()) == "act_batch returned None of type NoneType, expected a Control."


def test_without_recordings_nothing_can_be_said() -> None:
    with pytest.raises(ValueError, match="expected recordings"):
        check_lockstep(Net, [])
    with pytest.raises(ValueError, match=r"multiples of 4, got widths \(6,\)"):
        check_lockstep(Net, recorded(), widths=[6])
