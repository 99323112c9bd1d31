"""Ray: two nodes, one of them lost in the middle; agents that break; and nothing of it left behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from heeding_interrupts import heed_interrupts
from patience import PATIENCE_S
from ray_project import MODULE, load_project, setup_of, write_project

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.engine.ray.executor import RayExecutor
from pytest_drive_robust.engine.supervisor import Stopped
from pytest_drive_robust.engine.worker_setup import Limits
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.runner.inline_executor import InlineExecutor
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.simulators.embedded.route_xml import save_routes
from pytest_drive_robust.store.record import encode_episode
from pytest_drive_robust.testing import fake_route

pytest.importorskip("ray")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks at processes in /proc"),
]

STORE_BYTES = 80 << 20


class Project:
    """A project in a folder, this process's view of it, and executors for it."""

    def __init__(self, folder: Path, *, tick_s: float) -> None:
        self.folder = folder
        self.file = write_project(folder, tick_s=tick_s)
        self.registry: Registry = load_project(self.file)

    def requests(self, agent: str, count: int, sentence: str = "clean") -> list[EpisodeRequest]:
        setting = Setting.parse(sentence, self.registry.perturbations())
        routes = [fake_route(str(number), length_m=500.0) for number in range(count)]
        return [EpisodeRequest(Episode(agent, route.id, str(setting), 0), route, setting) for route in routes]

    def inline(self, request: EpisodeRequest) -> EpisodeResult:
        worker_setup = setup_of(self.file)
        executor = InlineExecutor(
            self.registry, simulator=worker_setup.simulator, options=worker_setup.options, ticked=lambda: None
        )
        future = executor.submit(request)
        assert executor.work is not None
        executor.work()
        executor.close()
        return future.result(timeout=0.0)

    def ray(self, address: str | None) -> RayExecutor:
        limits = Limits(act_s=2.0)
        return RayExecutor(lambda: setup_of(self.file), limits, address=address, registry=self.registry)

    def begun(self) -> list[list[str]]:
        """Route and folder of the code of every episode that began, retries too."""
        log = self.folder / "begun.log"
        return [line.split() for line in log.read_text().splitlines()] if log.exists() else []


def same_bytes(result: EpisodeResult) -> bytes:
    """The record but for how long it took."""
    return encode_episode(replace(result, wall_s=0.0))


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """A head that drives nothing and two nodes of one core each, the first with what Ray takes for a GPU."""
    from ray.cluster_utils import Cluster

    quick = {"health_check_period_ms": 500, "health_check_failure_threshold": 3}  # to notice a lost node soon
    head = {"num_cpus": 0, "object_store_memory": STORE_BYTES, "_system_config": quick}
    made = Cluster(initialize_head=True, head_node_args=head)
    made.nodes = [made.add_node(num_cpus=1, num_gpus=gpus, object_store_memory=STORE_BYTES) for gpus in (1, 0)]
    yield made
    made.shutdown()


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Project]:
    (tmp_path / "project").mkdir()
    monkeypatch.chdir(tmp_path / "project")  # the places of faults are told from the folder of the run
    yield Project(tmp_path / "project", tick_s=0.001)
    sys.modules.pop(MODULE, None)


def test_agents_that_break_cost_one_episode_each(cluster, project):
    broken = {
        "raises": End.AGENT_CRASHED,
        "segfaults": End.AGENT_CRASHED_HARD,
        "leaves": End.AGENT_CRASHED_HARD,
        "hangs": End.AGENT_TIMED_OUT,
    }
    good = project.requests("steady", 3) + project.requests("steady", 3, "halved throttle")
    bad = [request for agent in broken for request in project.requests(agent, 1)]
    executor = project.ray(cluster.address)
    futures = [executor.submit(request) for request in (*good[:3], *bad, *good[3:])]
    found = {future.result(PATIENCE_S).episode: future.result() for future in futures}
    assert executor.slots == 2
    executor.close()
    for request in (*good, *project.requests("raises", 1)):
        assert same_bytes(found[request.episode]) == same_bytes(project.inline(request))
    for request in bad:
        result = found[request.episode]
        assert (result.outcome, result.end) == (Outcome.AGENT_ERROR, broken[request.episode.agent]), result.end_detail
        assert result.ticks == 29
    on_cluster = [Path(folder) for _, folder in project.begun() if Path(folder) != project.folder.resolve()]
    assert len(on_cluster) >= len(futures)  # the copy that travelled drove, not the folder that happens to be here too


def test_an_agent_gets_the_gpu_that_it_asks_for_and_what_no_node_has_is_told_at_once(cluster, project):
    executor = project.ray(cluster.address)
    result = executor.submit(project.requests("withgpu", 1)[0]).result(PATIENCE_S)
    assert executor.slots == 1
    assert result.ticks == 60
    assert (project.folder / "devices").read_text() == "0"
    with pytest.raises(UsageError, match=r"num_cpus=1, num_gpus=8, and no node of the cluster has that"):
        executor.submit(project.requests("withmanygpus", 1)[0]).result(PATIENCE_S)
    executor.close()


def test_weights_that_did_not_travel_are_refused(cluster, project):
    (project.folder / ".rayignore").write_text("weights.bin\n")
    executor = project.ray(cluster.address)
    with pytest.raises(UsageError, match=r"weights.*cannot be read"):
        executor.submit(project.requests("weighted", 1)[0]).result(PATIENCE_S)
    executor.close()


def test_closing_early_stops_what_is_under_way(cluster, tmp_path):
    project = Project(tmp_path / "project", tick_s=10.0)
    executor = project.ray(cluster.address)
    futures = [executor.submit(request) for request in project.requests("steady", 3)]
    wait_for(lambda: len(project.begun()) == 2)
    started = time.monotonic()
    executor.close()
    assert time.monotonic() - started < PATIENCE_S  # an episode takes ten minutes
    for future in futures:
        with pytest.raises(Stopped):
            future.result(0)
    wait_for(lambda: not processes_in(str(project.folder)))


def test_a_lost_node_costs_only_its_running_episodes(cluster, tmp_path):
    project = Project(tmp_path / "project", tick_s=0.02)
    requests = project.requests("steady", 10)
    executor = project.ray(cluster.address)
    futures = [executor.submit(request) for request in requests]
    wait_for(lambda: sum(future.done() for future in futures) >= 4)
    cluster.remove_node(cluster.nodes[1], allow_graceful=False)
    results = [future.result(PATIENCE_S) for future in futures]
    wait_for(lambda: executor.slots == 1)
    executor.close()
    assert len(project.begun()) <= len(requests) + 1  # two in flight, one of them on the node that went
    assert [same_bytes(result) for result in results] == [same_bytes(project.inline(request)) for request in requests]


def test_a_cluster_that_ends_is_told_once(cluster, tmp_path):
    project = Project(tmp_path / "project", tick_s=0.05)
    executor = project.ray(cluster.address)
    first, *others = [executor.submit(request) for request in project.requests("steady", 3)]
    first.result(PATIENCE_S)
    cluster.shutdown()
    assert {future.result(PATIENCE_S).outcome for future in others} == {Outcome.INFRA_ERROR}
    request = project.requests("steady", 1)[0]
    wait_for(lambda: isinstance(executor.submit(request).exception(PATIENCE_S), UsageError))
    with pytest.raises(UsageError, match=r"no Ray cluster can be used at"):
        executor.submit(request).result(0)
    executor.close()


@pytest.fixture
def suite(tmp_path: Path) -> Path:
    folder = tmp_path / "suite"
    write_project(folder, tick_s=0.01)
    save_routes([fake_route(str(number)) for number in range(4)], folder / "routes.xml")
    (folder / "pytest.ini").write_text(
        "[pytest]\ndrive_sim = slow\ndrive_agent = steady\ndrive_routes = routes.xml\ndrive_verdict = point\n"
    )
    (folder / "conftest.py").write_text(f"from {MODULE} import pytest_drive_robust_register\n")
    (folder / "test_suite.py").write_text(
        "import pytest\nfrom pytest_drive_robust import requirements\n\n"
        "SENTENCES = requirements('DS under clean >= 10\\nRD under halved throttle <= 0.9')\n\n\n"
        "@pytest.mark.parametrize('requirement', SENTENCES)\n"
        "def test_requirement(drive, requirement):\n    drive.check(requirement)\n"
    )
    return folder


def start_pytest(folder: Path, *options: str) -> subprocess.Popen[str]:
    with (folder / "output.txt").open("w") as output:
        return subprocess.Popen(
            [sys.executable, "-m", "pytest", "--drive-robust", "-p", "no:cacheprovider", *options],
            cwd=folder,
            stdout=output,
            stderr=subprocess.STDOUT,
            preexec_fn=heed_interrupts,
            text=True,
            start_new_session=True,
            env={**os.environ, "PYTHONPATH": str(folder), "DRIVE_ROBUST_MARK": str(folder)},
        )


def test_a_cluster_of_our_own_says_nothing_and_leaves_nothing(suite):
    process = start_pytest(suite, "--drive-executor", "ray", "--drive-workers", "2")
    assert process.wait(PATIENCE_S) == 0, (suite / "output.txt").read_text()
    output = (suite / "output.txt").read_text()
    assert "2 passed" in output
    assert "raylet" not in output
    wait_for(lambda: not processes_in(str(suite)))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_an_interrupted_run_leaves_no_process(suite, number):
    write_project(suite, tick_s=0.2)
    process = start_pytest(suite, "--drive-executor", "ray", "--drive-workers", "2")
    wait_for(lambda: (suite / "begun.log").exists())
    os.killpg(process.pid, number)
    expected = 2 if number == signal.SIGINT else -number
    assert process.wait(PATIENCE_S) == expected, (suite / "output.txt").read_text()
    wait_for(lambda: not processes_in(str(suite)))


def test_an_address_where_nobody_is_is_a_usage_error(suite):
    process = start_pytest(suite, "--drive-executor", "ray", "--drive-ray-address", "127.0.0.1:9")
    process.wait(PATIENCE_S)
    output = (suite / "output.txt").read_text()
    assert "no Ray cluster can be used at '127.0.0.1:9'" in output
    assert "ray start --head" in output


def wait_for(condition: Any) -> None:
    ends = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < ends, "it did not come to pass"
        time.sleep(0.05)


def processes_in(mark: str) -> list[str]:
    """Command lines of processes whose environment or command line holds the folder of a test."""
    found = []
    for entry in Path("/proc").iterdir():
        if not entry.name.isdecimal() or int(entry.name) == os.getpid():
            continue
        with suppress(OSError):
            command = (entry / "cmdline").read_bytes()
            if mark.encode() in command + (entry / "environ").read_bytes():
                found.append(command.replace(b"\0", b" ").decode(errors="replace"))
    return found
