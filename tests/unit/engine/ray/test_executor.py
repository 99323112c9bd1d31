from __future__ import annotations

import sys

import pytest

from pytest_drive_robust.engine.ray.executor import RayExecutor, needs_of
from pytest_drive_robust.engine.worker_setup import Limits, WorkerSetup
from pytest_drive_robust.errors import UsageError


def never() -> WorkerSetup:
    raise AssertionError("nothing was driven")


class Greedy:
    num_cpus = 4
    num_gpus = 0.5


def test_an_agent_says_what_an_episode_takes():
    assert needs_of(Greedy, "greedy") == (4.0, 0.5)
    assert needs_of(object, "modest") == (1.0, 0.0)


@pytest.mark.parametrize(
    ("name", "given"), [("num_cpus", 0), ("num_cpus", "two"), ("num_gpus", -1), ("num_gpus", True)]
)
def test_what_is_no_number_of_cores_is_refused(name, given):
    factory = type("Odd", (), {name: given})
    with pytest.raises(UsageError, match=rf"'odd' has {name} = {given!r}, expected a number"):
        needs_of(factory, "odd")


def test_without_ray_the_message_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(UsageError, match=r"pip install 'pytest-drive-robust\[ray\]'"):
        RayExecutor(never, Limits())


def test_nothing_is_started_before_the_first_episode():
    pytest.importorskip("ray")
    executor = RayExecutor(never, Limits(), address="127.0.0.1:9")
    assert executor.slots == 1
    executor.close()
    executor.close()
