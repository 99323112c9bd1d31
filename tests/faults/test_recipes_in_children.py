"""A child process knows the names that the run knows, and its episodes are bit for bit those of this process."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from guarded_worlds import request, worker_setup

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.engine.fork_server import ForkServer
from pytest_drive_robust.engine.supervisor import Supervisor
from pytest_drive_robust.engine.worker_setup import Limits
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.perturbations import Perturbation, Setting
from pytest_drive_robust.registry.plugins import plugin_source
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.episode.machine import with_machine
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.routes import resolve_routes
from pytest_drive_robust.store.record import encode_episode

CONFTEST = """
from dataclasses import dataclass, replace

import pytest
from pytest_drive_robust import Control, Perturbation
from pytest_drive_robust.testing import ScriptedAgent


@dataclass
class Weaker{number}(Perturbation):
    share: float = 1.0
    phrase = "weaker{number} {{share}}"

    def actuate(self, tick, control, inference_s):
        return None if control is None else replace(control, throttle=control.throttle * self.share)


@pytest.hookimpl(optionalhook=True)
def pytest_drive_robust_register(registry):
    registry.register_perturbation(Weaker{number})
    registry.register_agent("own{number}", lambda: ScriptedAgent([Control(throttle=1.0)]))
"""

Driving = Callable[..., EpisodeResult]
OPTIONS = SimulatorOptions(tick_cap=120)


@pytest.fixture
def drive_with() -> Iterator[Driving]:
    """`drive_with(request, **changes of the worker_setup)`: one episode in a child of its own."""
    open_now: list[Supervisor | ForkServer] = []

    def drive(wanted: object, **changes: object) -> EpisodeResult:
        fork_server = ForkServer(replace(worker_setup(), **changes))  # type: ignore[arg-type]
        supervisor = Supervisor(fork_server, Limits(episode_s=60.0))
        open_now.extend((fork_server, supervisor))
        return supervisor.drive(wanted)  # type: ignore[arg-type]

    yield drive
    for item in reversed(open_now):
        item.close()


@pytest.fixture
def two_conftests(tmp_path: Path) -> tuple[tuple[str, str], ...]:
    """Two files of one module name, as pytest knows them."""
    found = []
    for number in (1, 2):
        folder = tmp_path / f"folder{number}"
        folder.mkdir()
        (folder / "conftest.py").write_text(CONFTEST.format(number=number))
        found.append(("conftest", str(folder / "conftest.py")))
    return tuple(found)


def test_names_of_conftest_files_are_known(drive_with: Driving, two_conftests: tuple[tuple[str, str], ...]) -> None:
    clean = drive_with(request("own1"), plugins=two_conftests)
    assert clean.outcome is Outcome.COMPLETED
    assert drive_with(request("own2"), plugins=two_conftests).trace.digest == clean.trace.digest


def test_a_perturbation_that_does_not_pickle_is_found_by_its_sentence(
    drive_with: Driving, two_conftests: tuple[tuple[str, str], ...]
) -> None:
    @dataclass
    class Weaker1(Perturbation):  # local: no other process can import it
        share: float = 1.0
        phrase = "weaker1 {share}"

    clean = drive_with(request("own1"), plugins=two_conftests)
    weaker = drive_with(request("own1", setting=Setting.of(Weaker1(share=0.5))), plugins=two_conftests)
    assert weaker.ticks > clean.ticks


def test_a_perturbation_that_nobody_can_send_is_the_users_error(drive_with: Driving) -> None:
    @dataclass
    class Local(Perturbation):
        phrase = "local trouble"

    with pytest.raises(UsageError, match=r"'local trouble' cannot be sent .* give --drive-executor inline"):
        drive_with(request("Steady", setting=Setting.of(Local())))


def test_a_plugin_that_does_not_load_is_the_users_error(drive_with: Driving, tmp_path: Path) -> None:
    (tmp_path / "broken.py").write_text("import sys\nsys.exit('not here')\n")
    with pytest.raises(UsageError, match=r"the plugin broken .* SystemExit: not here"):
        drive_with(request("Steady"), plugins=(("broken", str(tmp_path / "broken.py")),))


def test_a_plugin_object_is_refused_with_advice() -> None:
    class Plugin:
        def pytest_drive_robust_register(self, registry: object) -> None: ...

    with pytest.raises(UsageError, match=r"is not a module in a file.*conftest\.py, or give --drive-executor inline"):
        plugin_source(Plugin())
    assert plugin_source(sys.modules[__name__]) == (__name__, str(Path(__file__).absolute()))


@pytest.mark.parametrize(
    "trouble",
    [
        "import ctypes; ctypes.string_at(0)",
        "import threading, time; threading.Thread(target=time.sleep, args=(600,), daemon=True).start()",
    ],
)
def test_an_agent_module_that_cannot_be_preloaded_does_not_harm_the_others(
    drive_with: Driving, tmp_path: Path, trouble: str
) -> None:
    (tmp_path / "troublesome.py").write_text(trouble)
    path = (str(tmp_path), *worker_setup().python_path)
    result = drive_with(request("Steady"), python_path=path, preload_agents=("troublesome:Agent",))
    assert result.outcome is Outcome.COMPLETED


def test_a_plugin_that_starts_threads_costs_only_time(drive_with: Driving, tmp_path: Path) -> None:
    (tmp_path / "busy.py").write_text(
        "import threading, time\nthreading.Thread(target=time.sleep, args=(600,), daemon=True).start()\n"
    )
    result = drive_with(request("Steady"), plugins=(("busy", str(tmp_path / "busy.py")),))
    assert result.outcome is Outcome.COMPLETED


def test_libraries_get_one_thread(drive_with: Driving, tmp_path: Path) -> None:
    (tmp_path / "counting.py").write_text(
        "import os, cv2\nfrom guarded_agents import Steady\n"
        "class Counts(Steady):\n"
        "    def fault(self, observation):\n"
        "        raise RuntimeError(f\"{os.environ['OMP_NUM_THREADS']} {os.environ['MKL_NUM_THREADS']} "
        "{cv2.getNumThreads()} {len(os.listdir('/proc/self/task'))}\")\n"
    )
    path = (str(tmp_path), *worker_setup().python_path)
    result = drive_with(request("counting:Counts"), python_path=path)
    assert "RuntimeError: 1 1 1 1 (" in result.end_detail


@pytest.fixture(scope="module")
def embedded() -> Iterator[Supervisor]:
    fork_server = ForkServer(worker_setup("embedded", options=OPTIONS, preload_agents=("classical",)))
    supervisor = Supervisor(fork_server, Limits(episode_s=60.0))
    yield supervisor
    supervisor.close()
    fork_server.close()


@pytest.mark.parametrize("sentence", ["clean", "gps noise 5 m", "200 ms latency"])
def test_the_embedded_world_gives_the_same_bits_in_a_child(embedded: Supervisor, sentence: str) -> None:
    route, setting = resolve_routes("dev10")[0], Setting.parse(sentence)
    registry = default_registry()
    simulator, agent = registry.simulator("embedded", OPTIONS), registry.agent("classical")
    here = drive_episode(simulator, agent, route=route, setting=setting, seed=1, agent_name="classical")
    here = with_machine(here, agent, simulator)
    there = embedded.drive(request("classical", setting=setting, route=route, seed=1))
    assert there.trace.digest == here.trace.digest
    assert encode_episode(replace(there, wall_s=0.0)) == encode_episode(replace(here, wall_s=0.0))
    assert here.ticks == 120
    assert max(here.trace.column("speed_mps")) > 1.0


def test_a_fault_in_the_embedded_world_is_told_by_us_and_not_by_its_libraries(embedded: Supervisor) -> None:
    result = embedded.drive(request("Segfaults", route=resolve_routes("dev10")[0]))
    assert result.end_detail.startswith("SIGSEGV in act at tick 30 (tests/helpers/guarded_agents.py:")
    assert "parachute" not in embedded.output
    assert result.route_completion_pct > 0.0
