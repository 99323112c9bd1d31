"""A campaign of slow fake episodes in a folder of its own, and somebody who kills its processes at random moments."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from heeding_interrupts import heed_interrupts
from patience import PATIENCE_S

from pytest_drive_robust.simulators.embedded.route_xml import save_routes
from pytest_drive_robust.store.folder import FolderStore
from pytest_drive_robust.testing import fake_route

CONFTEST = """
import os, time
from dataclasses import dataclass, replace
from pathlib import Path

from pytest_drive_robust import Control, Perturbation
from pytest_drive_robust.testing import FakeSimulator, ScriptedAgent

LOG = Path(__file__).parent / "begun.log"
GO, SECOND = (Path(__file__).parent / name for name in ("go", "second"))
TICK_S = float(os.environ["CAMPAIGN_TICK_S"])
HOLD = int(os.environ["CAMPAIGN_HOLD"])


@dataclass
class Throttle(Perturbation):
    share: float = 1.0
    phrase = "throttle {share}"

    def actuate(self, tick, control, inference_s):
        return None if control is None else replace(control, throttle=control.throttle * self.share)


class SlowSimulator(FakeSimulator):
    def reset(self, route, *, seed, cameras):
        with LOG.open("ab") as log:
            log.write(f"{route.id} {seed}\\n".encode())
            log.flush()
            begun = LOG.read_bytes()[: log.tell()].count(b"\\n")  # not those of other workers behind it
        while HOLD and begun >= HOLD and not GO.exists():
            time.sleep(0.005)
        return super().reset(route, seed=seed, cameras=cameras)

    def step(self, control):
        time.sleep(TICK_S)
        return super().step(control)


def pytest_runtest_logstart(nodeid):
    with (GO.parent / "tests.log").open("a") as log:
        log.write(f"{os.getpid()} {nodeid}\\n")


def pytest_keyboard_interrupt():
    with (GO.parent / "interrupted.log").open("a") as log:
        log.write(f"{os.getpid()}\\n")
    while "CAMPAIGN_SECOND" in os.environ and not SECOND.exists():
        time.sleep(0.005)


def pytest_drive_robust_register(registry):
    registry.register_perturbation(Throttle)
    registry.register_simulator("slow", lambda options: SlowSimulator(replace(options, tick_cap=60)))
    registry.register_agent("steady", lambda: ScriptedAgent([Control(throttle=1.0)]))
"""

SUITE = '''
import pytest
from pytest_drive_robust import requirements

SENTENCES = """
DS under clean >= 10
RD under throttle 0.9 <= 0.9
RD under throttle 0.5 <= 0.9
RD under throttle 0.2 <= 0.99
"""


@pytest.mark.parametrize("requirement", requirements(SENTENCES))
def test_requirement(drive, requirement):
    drive.check(requirement)
'''

INI = """
[pytest]
drive_sim = slow
drive_agent = steady
drive_routes = routes.xml
drive_verdict = point
"""


@dataclass
class Campaign:
    """A folder with a suite; `episodes` are what it needs in all, and each of their ticks takes `tick_s`.

    From the `hold`-th episode on (0: none) each waits at its beginning until `go`: so many have begun then as there
    are slots beside the first, and all before are stored.
    """

    folder: Path
    routes: int = 12
    tick_s: float = 0.0
    hold: int = 0
    kills: int = 0
    lost: list[str] = field(default_factory=list)

    @property
    def episodes(self) -> int:
        """Clean and three settings on every route."""
        return 4 * self.routes

    def write(self) -> None:
        """Write the suite."""
        self.folder.mkdir(parents=True, exist_ok=True)
        routes = [fake_route(str(number), length_m=9.0 + number / 2) for number in range(1, self.routes + 1)]
        save_routes(routes, self.folder / "routes.xml")
        (self.folder / "conftest.py").write_text(CONFTEST)
        (self.folder / "test_suite.py").write_text(SUITE)
        (self.folder / "tox.ini").write_text(INI)

    def begin(self, *arguments: str, **environment: str) -> subprocess.Popen[bytes]:
        """Start pytest in a session of its own."""
        without = ("-p", "no:cacheprovider", "-p", "no:hypothesispytest", "-p", "no:allure_pytest")
        command = [sys.executable, "-m", "pytest", "--drive-robust", "-q", *without, *arguments]
        with (self.folder / "output.txt").open("ab") as output:
            return subprocess.Popen(
                command,
                cwd=self.folder,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=heed_interrupts,
                env={
                    **os.environ,
                    "CAMPAIGN_TICK_S": str(self.tick_s),
                    "CAMPAIGN_HOLD": str(self.hold),
                    **environment,
                },
            )

    def run(self, *arguments: str) -> int:
        """Run pytest to its end; the exit code."""
        return self.begin(*arguments).wait(timeout=PATIENCE_S)

    def go(self) -> None:
        """Let those go on that wait."""
        (self.folder / "go").touch()

    def noted(self, name: str) -> list[list[str]]:
        """Return the words of each line of a log: `"tests"` that began, with their process, or `"interrupted"`."""
        log = self.folder / f"{name}.log"
        return [line.split(maxsplit=1) for line in log.read_text().splitlines()] if log.exists() else []

    def stored(self) -> set[str]:
        """Return the keys of whole records in the store."""
        return {path.stem for path in (self.folder / ".drive-robust" / "episodes").glob("*/*.episode")}

    def begun(self) -> int:
        """Return how many episodes were begun, by whomever."""
        log = self.folder / "begun.log"
        return len(log.read_text().splitlines()) if log.exists() else 0

    def digests(self) -> dict[str, tuple[object, ...]]:
        """Return what decides about each stored episode, without times."""
        store = FolderStore(self.folder / ".drive-robust")
        found = {key: store.get(key) for key in self.stored()}
        return {
            key: (
                str(result.episode), result.outcome, result.end, result.ticks, result.trace.digest,
                result.route_completion_pct, result.infractions, result.schedule, result.reception,
            )
            for key, result in found.items()
            if result is not None
        }  # fmt: skip

    def disturb(self, arguments: Sequence[str], *, kills: int, seed: int, controller_share: float = 0.2) -> None:
        """Run pytest until `kills` of its processes were killed and then to its end, starting it again when it dies.

        Most runs are left alone until they drive; one in ten is killed while it starts. What waits at `hold` goes on
        after half of the kills.
        """
        draw = random.Random(seed)
        while True:
            at_once, before = draw.random() < 0.1, self.begun()
            process = self.begin(*arguments)
            while process.poll() is None:
                if 2 * self.kills >= kills:
                    self.go()
                if self.kills >= kills:
                    process.wait(timeout=PATIENCE_S)
                elif at_once or self.begun() > before:
                    time.sleep(draw.uniform(0.05, 0.4))
                    self._kill_one(process, draw, controller_share)
                else:
                    time.sleep(0.01)
            if self.kills >= kills and process.returncode >= 0:
                return
            if len(self.stored()) == self.episodes and self.kills < kills:
                return  # everything is driven: there is nothing left to disturb

    def _kill_one(self, process: subprocess.Popen[bytes], draw: random.Random, controller_share: float) -> None:
        if process.poll() is not None:
            return  # it has ended by itself
        children = descendants(process.pid)
        victim = process.pid if not children or draw.random() < controller_share else draw.choice(children)
        before = self.stored()
        try:
            os.kill(victim, signal.SIGKILL)
        except ProcessLookupError:
            return
        self.kills += 1
        time.sleep(0.02)
        self.lost += sorted(before - self.stored())


def descendants(pid: int) -> list[int]:
    """Return every process below `pid`, by /proc."""
    parents: dict[int, int] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            parents[int(entry.name)] = int(fields[1])
    found: list[int] = []
    level = {pid}
    while level:
        level = {child for child, parent in parents.items() if parent in level}
        found += sorted(level)
    return found
