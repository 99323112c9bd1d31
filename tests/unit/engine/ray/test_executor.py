from __future__ import annotations

import sys
from importlib.machinery import ModuleSpec
from types import ModuleType

import pytest

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.engine.ray.executor import RayExecutor, needs_of
from pytest_drive_robust.engine.worker_setup import Limits, WorkerSetup
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.testing import fake_route


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


class Cluster(RayExecutor):
    """Speaks with nobody: `numbers` are those of the episodes that the process which uses Ray would hear of."""

    def _start(self, cluster):
        self.numbers = []

    def _write(self, message):
        self.numbers.append(message[0])


def test_an_answer_that_comes_late_is_never_that_of_another_episode(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", ModuleType("ray"))
    sys.modules["ray"].__spec__ = ModuleSpec("ray", None)  # nothing of it is used before a cluster is started
    registry = Registry()
    registry.register_agent("modest", object)
    cluster = Cluster(lambda: WorkerSetup((), "", (), "fake"), Limits(), registry=registry)
    for seed in range(20):
        cluster.submit(EpisodeRequest(Episode("modest", "1", "clean", seed), fake_route(), Setting.CLEAN))
        cluster._pending.clear()  # it was given up, and nobody keeps its future
    assert len(set(cluster.numbers)) == 20
