from __future__ import annotations

from types import SimpleNamespace

from pytest_drive_robust.engine.ray.driver import _Driver


class Connection:
    """What the other side is told."""

    def __init__(self) -> None:
        self.told: list[tuple[int | None, object]] = []

    def send(self, message: tuple[int | None, object]) -> None:
        self.told.append(message)


class Cluster:
    """A stand-in for Ray with one node: episodes end when the test calls what waits for them."""

    def __init__(self) -> None:
        self.node = {"CPU": 4.0, "GPU": 1.0}
        self.waiting = []

    def nodes(self):
        return [{"Alive": True, "Resources": self.node}]

    def cancel(self, ref, *, force):
        """The answer of the cancelled episode comes later."""

    def options(self, **needs):
        future = SimpleNamespace(add_done_callback=self.waiting.append)
        return SimpleNamespace(remote=lambda asked: SimpleNamespace(future=lambda: future))


def asked(name: str) -> SimpleNamespace:
    return SimpleNamespace(lost=lambda why: f"{name} was lost: {why}")


def test_what_comes_of_a_cancelled_episode_is_never_told_of_another_one():
    connection, cluster = Connection(), Cluster()
    driver = _Driver(connection)  # type: ignore[arg-type]
    driver._ray = driver._drive = cluster
    driver._update()
    driver._begin(7, (1.0, 1.0), asked("first"))
    cluster.node["GPU"] = 0.0
    driver._update()  # gives it up
    driver._begin(7, (1.0, 0.0), asked("second"))
    cancelled, driven = cluster.waiting
    cancelled(SimpleNamespace(exception=lambda: RuntimeError("cancelled")))
    driven(SimpleNamespace(exception=lambda: None, result=lambda: "second was driven"))
    assert [content for number, content in connection.told if number == 7] == [
        "first was lost: no node of the cluster has num_cpus=1, num_gpus=1 any more",
        "second was driven",
    ]
