"""An agent that draws from global generators draws the same in every process and order."""

from __future__ import annotations

import importlib
import random
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.runner.episode.generators import seed_for, seed_generators

FAKE_TORCH = "seeds = []\ndef manual_seed(seed):\n    seeds.append(seed)\n"


@pytest.fixture(autouse=True)
def as_before() -> Iterator[None]:
    python, numbers, finders = random.getstate(), np.random.get_state(), list(sys.meta_path)
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
    seed_for(Episode("agent", "1", "clean", 0))
    first = draws()
    draws()
    seed_for(Episode("agent", "1", "clean", 0))
    assert draws() == first


def test_another_episode_begins_otherwise() -> None:
    found = []
    for episode in (Episode("agent", "1", "clean", 0), Episode("agent", "1", "clean", 1)):
        seed_for(episode)
        found.append(draws())
    assert found[0] != found[1]


@pytest.mark.usefixtures("fake_torch")
def test_torch_is_seeded_when_it_is_there() -> None:
    torch = importlib.import_module("torch")
    seed_generators("a")
    seed_generators("b")
    seed_generators("a")
    assert torch.seeds[0] == torch.seeds[2] != torch.seeds[1]


@pytest.mark.usefixtures("fake_torch")
def test_torch_is_seeded_when_it_comes_late() -> None:
    seed_generators("b")
    seed_generators("a")
    torch = importlib.import_module("torch")
    assert len(torch.seeds) == 1
    seed_generators("a")
    assert torch.seeds[0] == torch.seeds[1]
    assert torch.seeds[0] < 1 << 32


@pytest.mark.usefixtures("fake_torch")
def test_waiting_for_torch_hinders_no_other_import() -> None:
    seed_generators("a")
    finders = len(sys.meta_path)
    seed_generators("b")
    assert len(sys.meta_path) == finders
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("torch_that_is_nowhere")
