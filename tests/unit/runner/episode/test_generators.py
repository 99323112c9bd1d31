"""An agent that draws from global generators draws the same in every process and order."""

from __future__ import annotations

import importlib.util
import random
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.runner.episode import generators
from pytest_drive_robust.runner.episode.generators import borrowed_generators, seed_generators

FAKE_TORCH = """
import random

seeds = ["first"]

def manual_seed(seed):
    seeds.append(seed)
    cuda.manual_seed_all(seed)

def get_rng_state():
    return seeds[-1]

set_rng_state = seeds.append
initial_seed = get_rng_state

class cuda:
    generator = random.Random("first")
    is_initialized = staticmethod(lambda: cuda.used)
    manual_seed_all = generator.seed
    get_rng_state_all = generator.getstate
    set_rng_state_all = generator.setstate
    used = False

def draw():
    cuda.used = True
    return cuda.generator.random()
"""


@pytest.fixture(autouse=True)
def as_before() -> Iterator[None]:
    python, numbers, finders = random.getstate(), np.random.get_state(), list(sys.meta_path)
    generators._LATE_TORCH.wait(None)
    yield
    random.setstate(python)
    np.random.set_state(numbers)
    sys.meta_path[:] = finders


@pytest.fixture
def fake_torch(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A torch that is not imported yet."""
    monkeypatch.setitem(sys.modules, "torch", None)  # put back at the end, whatever it was
    del sys.modules["torch"]
    (tmp_path / "torch.py").write_text(FAKE_TORCH)
    monkeypatch.syspath_prepend(tmp_path)


def draws() -> tuple[float, float]:
    return random.random(), float(np.random.rand())


def test_an_episode_always_begins_alike() -> None:
    with borrowed_generators(repr(Episode("agent", "1", "clean", 0))):
        first = draws()
    draws()
    with borrowed_generators(repr(Episode("agent", "1", "clean", 0))):
        assert draws() == first


def test_another_episode_begins_otherwise() -> None:
    found = []
    for episode in (Episode("agent", "1", "clean", 0), Episode("agent", "1", "clean", 1)):
        with borrowed_generators(repr(episode)):
            found.append(draws())
    assert found[0] != found[1]


@pytest.mark.usefixtures("fake_torch")
def test_torch_is_seeded_when_it_is_there() -> None:
    torch = importlib.import_module("torch")
    seed_generators("a")
    seed_generators("b")
    seed_generators("a")
    assert torch.seeds[1] == torch.seeds[3] != torch.seeds[2]


@pytest.mark.usefixtures("fake_torch")
def test_torch_is_seeded_when_it_comes_late() -> None:
    seed_generators("b")
    seed_generators("a")
    torch = importlib.import_module("torch")
    assert len(torch.seeds) == 2
    seed_generators("a")
    assert torch.seeds[1] == torch.seeds[2]
    assert torch.seeds[1] < 1 << 32


@pytest.mark.usefixtures("fake_torch")
def test_what_is_borrowed_is_put_back_also_when_torch_came_meanwhile() -> None:
    seed_generators("mine")
    expected = draws()
    seed_generators("mine")
    with borrowed_generators("an episode"), borrowed_generators("making an agent"):
        torch = importlib.import_module("torch")
    making, episode, mine = torch.seeds[1:]
    assert draws() == expected
    seed_generators("an episode")
    seed_generators("mine")
    assert torch.seeds[-2:] == [episode, mine]
    assert making not in (episode, mine)


@pytest.mark.usefixtures("fake_torch")
def test_a_torch_that_nobody_seeded_is_left_as_it_came() -> None:
    with borrowed_generators("an episode"):
        torch = importlib.import_module("torch")
    assert torch.seeds[-1] == "first" != torch.seeds[1]


@pytest.mark.usefixtures("fake_torch")
def test_a_torch_that_comes_after_what_was_borrowed_is_not_seeded() -> None:
    with borrowed_generators("an episode"):
        pass
    assert importlib.import_module("torch").seeds == ["first"]


@pytest.mark.usefixtures("fake_torch")
def test_waiting_for_torch_hinders_no_other_import() -> None:
    seed_generators("a")
    finders = len(sys.meta_path)
    seed_generators("b")
    assert len(sys.meta_path) == finders
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("torch_that_is_nowhere")


@pytest.mark.usefixtures("fake_torch")
@pytest.mark.parametrize("used", [False, True])
def test_an_agent_that_is_made_moves_no_draw_of_a_gpu(used: bool) -> None:
    torch = importlib.import_module("torch")
    torch.cuda.used = used

    def drawn(*, is_made: bool) -> list[float]:
        with borrowed_generators("an episode"):
            first = [torch.draw()] if used else []
            if is_made:
                with borrowed_generators("making an agent"):
                    torch.draw()
            return [*first, torch.draw(), torch.draw()]

    assert drawn(is_made=True) == drawn(is_made=False)


@pytest.mark.usefixtures("fake_torch")
def test_the_generator_of_a_gpu_is_put_back_where_it_was() -> None:
    torch = importlib.import_module("torch")
    torch.manual_seed(7)
    expected = [torch.draw(), torch.draw()]
    torch.manual_seed(7)
    assert torch.draw() == expected[0]
    with borrowed_generators("an episode"):
        torch.draw()
    assert torch.draw() == expected[1]


@pytest.mark.usefixtures("fake_torch")
def test_an_agent_that_brings_torch_and_draws_on_a_gpu_moves_no_draw() -> None:
    with borrowed_generators("an episode"):
        with borrowed_generators("making an agent"):
            torch = importlib.import_module("torch")
            torch.draw()
        drawn = torch.draw()
    with borrowed_generators("an episode"):
        assert torch.draw() == drawn


@pytest.mark.usefixtures("fake_torch")
def test_who_asks_whether_there_is_a_torch_and_then_imports_it_has_it_seeded_and_put_back() -> None:
    with borrowed_generators("an episode"):
        assert importlib.util.find_spec("torch") is not None
        torch = importlib.import_module("torch")
        assert len(torch.seeds) == 2
    assert torch.seeds[-1] == "first"
