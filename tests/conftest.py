"""A suite in an empty folder, driven by the fake simulator: what tests of the plugin run pytest on."""

from __future__ import annotations

import gc
import importlib
import importlib.util
import os
import pkgutil
from collections import Counter
from collections.abc import Callable, Generator, Sequence
from importlib import metadata
from pathlib import Path
from typing import TypeVar

import _pytest.pytester
import pytest
from _pytest.pytester import SysModulesSnapshot

from pytest_drive_robust.simulators.embedded.route_xml import save_routes
from pytest_drive_robust.testing import fake_route

gc.disable()  # until the tests are collected: what is loaded by then stays

LIBRARIES = (
    "av",
    "cv2",
    "gymnasium",
    "highway_env",
    "llvmlite",
    "numba",
    "numpy",
    "onnx",
    "onnxruntime",
    "rich",
    "scipy",
    "torch",
)


class _LibrariesStay(SysModulesSnapshot):
    """pytester forgets what a nested pytest imported, but these libraries refuse to be imported twice into a process.

    Some of their parts are imported where they are first used: numba's while it compiles.
    """

    def __init__(self, preserve: Callable[[str], bool] | None = None) -> None:
        super().__init__(
            lambda name: name.partition(".")[0] in LIBRARIES or (preserve is not None and preserve(name)),
        )


_pytest.pytester.SysModulesSnapshot = _LibrariesStay  # type: ignore[misc]

# Imported now, not where they are used: of our own classes there must not be two.
for _part in (
    *("arithmetic", "domain", "engine", "jit", "metrics", "perturbations", "regression", "report", "runner"),
    *("simulators", "store", "stats", "verdict"),
):
    _package = importlib.import_module(f"pytest_drive_robust.{_part}")
    for _module in pkgutil.walk_packages(_package.__path__, f"{_package.__name__}."):
        importlib.import_module(_module.name)

if importlib.util.find_spec("hypothesis"):  # who does not test this package may still ask its clone for `--help`
    from hypothesis import HealthCheck, settings

    # A busy machine is no failure, and what passed once passes again: `--hypothesis-profile search` finds new examples.
    settings.register_profile("tests", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
    settings.register_profile("search", settings.get_profile("tests"), derandomize=False)
    settings.load_profile("tests")

T = TypeVar("T")
REPOSITORY = Path(__file__).parent.parent
PLUGIN = "pytest_drive_robust.plugin"

CONFTEST = """
import os
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from pytest_drive_robust import Control, Perturbation
from pytest_drive_robust.testing import FakeSimulator, ScriptedAgent

LOG = Path(__file__).parent / "driven.log"


@dataclass
class Throttle(Perturbation):
    share: float = 1.0
    phrase = "throttle {share}"

    def actuate(self, tick, control, inference_s):
        return None if control is None else replace(control, throttle=control.throttle * self.share)


class LoggedSimulator(FakeSimulator):
    def reset(self, route, *, seed, cameras):
        with LOG.open("a") as log:
            log.write(f"{route.id} {seed} {os.getpid()}\\n")
        return super().reset(route, seed=seed, cameras=cameras)


def fake(options):
    return LoggedSimulator(replace(options, tick_cap=60))


def broken(options):
    return FakeSimulator(options, raises=RuntimeError("no map"), raises_in="step", raises_at=3)


def steady():
    return ScriptedAgent([Control(throttle=1.0)])


def seer():
    return ScriptedAgent([Control(throttle=1.0)], privileged=True)


def faulty():
    return ScriptedAgent([Control(throttle=1.0)] * 10 + [Control(throttle=7.0)])


AGENTS = [steady, seer, faulty]


@pytest.hookimpl(optionalhook=True)
def pytest_drive_robust_register(registry):
    registry.register_perturbation(Throttle)
    registry.register_simulator("fake", fake)
    registry.register_simulator("broken", broken)
    for agent in AGENTS:
        registry.register_agent(agent.__name__, agent)
"""

MEETING = """

class Meeting(LoggedSimulator):
    def reset(self, route, *, seed, cameras):
        import time
        world = super().reset(route, seed=seed, cameras=cameras)
        ends_s = time.monotonic() + 120.0
        while len({tuple(line.split()[2:]) for line in LOG.read_text().splitlines()}) < 2 and time.monotonic() < ends_s:
            time.sleep(0.005)
        return world


@pytest.hookimpl(optionalhook=True)
def pytest_drive_robust_register(registry, _known=pytest_drive_robust_register):
    _known(registry)
    registry.register_simulator("meeting", lambda options: Meeting(replace(options, tick_cap=60)))
"""
"""A world whose first episode lasts until another process has begun one, however late that comes to it."""

SUITE = '''
import pytest
from pytest_drive_robust import requirements


@pytest.mark.parametrize("requirement", requirements("""{sentences}"""))
def test_requirement(drive, requirement):
    drive.check(requirement)
'''

WITHOUT_OTHERS = "-p no:hypothesispytest -p no:allure_pytest"
INI = """
[pytest]
drive_sim = fake
drive_agent = steady
drive_routes = routes.xml
drive_verdict = point
drive_executor = inline
addopts = {others} {plugin}
filterwarnings = ignore:Module already imported
"""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--whole-studies", action="store_true", help="drive all of what some tests take a sample of")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run the files first that take long: what is left for the end is short, and no worker waits for another.

    xdist gives each worker as many tests as the others, in this order: so each part begins with some of those files.
    """
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    counts = Counter(item.path for item in items)
    sizes = [0] * int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    part_of: dict[Path, int] = {}
    for path in sorted(counts, key=lambda path: path not in slow):
        room = (part for part, size in enumerate(sizes) if size * len(sizes) < len(items))
        part_of[path] = part = len(part_of) % len(sizes) if path in slow else next(room, len(sizes) - 1)
        sizes[part] += counts[path]
    items.sort(key=lambda item: (part_of[item.path], item.path not in slow))


def pytest_collection_finish() -> None:
    """Collect garbage again, of what the tests make: in each worker a tenth of the collection was spent on it."""
    gc.enable()


@pytest.hookimpl(optionalhook=True, wrapper=True)
def pytest_xdist_auto_num_workers() -> Generator[None, int, int]:
    """Start one worker more than there are cores: many tests wait for processes of their own, or for a timeout."""
    cores = yield
    return cores if "PYTEST_XDIST_AUTO_NUM_WORKERS" in os.environ else cores + 1


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> object:
    """Let a worker that is done take over what others have not begun, unless `--dist` says otherwise."""
    from xdist.scheduler import WorkStealingScheduling

    return WorkStealingScheduling(config, log) if config.getvalue("dist") == "load" else None


@pytest.fixture(scope="session")
def sample(pytestconfig: pytest.Config) -> Callable[[Sequence[T], int], Sequence[T]]:
    """`sample(things, every)`: each `every`-th of them, and all of them with `--whole-studies`."""
    whole = pytestconfig.getoption("--whole-studies")
    return lambda things, every: things if whole else things[::every]


@pytest.fixture(scope="session")
def whole_study(pytestconfig: pytest.Config) -> None:
    """Skip a test of which another one shows a sample, but for `--whole-studies`."""
    if not pytestconfig.getoption("--whole-studies"):
        pytest.skip("only with --whole-studies")


@pytest.fixture(scope="session", autouse=True)
def _only_our_plugin() -> Generator[None]:
    """Let pytest in processes of its own do without what only this one needs: each would import them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTEST_ADDOPTS", WITHOUT_OTHERS)
        yield


@pytest.fixture
def plugin_args() -> tuple[str, ...]:
    """What loads our plugin in a new pytest; nothing where it is installed."""
    installed = any(point.value == PLUGIN for point in metadata.entry_points(group="pytest11"))
    return () if installed else ("-p", PLUGIN)


@pytest.fixture
def suite(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, plugin_args: tuple[str, ...]
) -> Callable[..., pytest.Pytester]:
    """`suite("DS under clean >= 60", ...)` writes conftest, ini, three short routes and one test per sentence."""
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)
    monkeypatch.delenv("GITHUB_STEP_SUMMARY", raising=False)  # ours, when these tests run on GitHub

    def write(*sentences: str, test: str | None = None, conftest: str = "") -> pytest.Pytester:
        save_routes(
            [fake_route(str(number), length_m=9.0 + number) for number in (1, 2, 3)], pytester.path / "routes.xml"
        )
        (pytester.path / "tox.ini").write_text(INI.format(others=WITHOUT_OTHERS, plugin=" ".join(plugin_args)))
        pytester.makeconftest(CONFTEST + conftest)
        body = SUITE.format(sentences="\n".join(sentences)) if sentences else ""
        (pytester.path / "test_suite.py").write_text(body + (test or ""))
        return pytester

    return write


@pytest.fixture
def meeting() -> str:
    """Give it as `conftest` and drive `--drive-sim meeting`: both of two workers drive, whichever is faster."""
    return MEETING


@pytest.fixture
def driven(pytester: pytest.Pytester) -> Callable[[], list[str]]:
    """The episodes that the fake simulator began: `"route seed"`, sorted."""

    def read() -> list[str]:
        log = pytester.path / "driven.log"
        return sorted(" ".join(line.split()[:2]) for line in log.read_text().splitlines()) if log.exists() else []

    return read
