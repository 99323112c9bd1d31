"""One small campaign by every engine, through the front door: the same verdicts, the same bytes."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.metrics.comfort import comfort
from pytest_drive_robust.metrics.score import driving_score
from pytest_drive_robust.store.record import decode_episode, encode_episode

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not sys.platform.startswith("linux"), reason="forks")]

CONFTEST = '''
import random
from dataclasses import replace

import numpy as np
from pytest_drive_robust import CameraSpec, Control
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator

_DRAW = np.random.default_rng(5)
_IN, _OUT = _DRAW.normal(size=(6, 16)), _DRAW.normal(size=(16, 3))


class Row:
    """A small recurrent network that sees: the same sums in the same order for every row. It begins as it was drawn."""

    def __init__(self):
        self.first_memory = random.random() - float(np.random.rand())

    def sensors(self):
        return [CameraSpec("front", width_px=32, height_px=16)]

    def reset(self, route, seed):
        self.memory = self.first_memory + 0.1 * seed

    def act(self, observation):
        return self.act_batch([self], [observation])[0]

    @classmethod
    def act_batch(cls, agents, observations):
        rows = np.array([one.row(seen) for one, seen in zip(agents, observations, strict=True)])
        hidden = np.tanh(np.einsum("bi,io->bo", rows, _IN))
        controls = []
        for one, (throttle, steer, memory) in zip(agents, np.tanh(np.einsum("bi,io->bo", hidden, _OUT)), strict=True):
            one.memory = float(memory)
            controls.append(Control(throttle=0.7 + 0.3 * float(throttle), steer=0.02 * float(steer)))
        return controls

    def row(self, seen):
        left, right = (float(half.mean()) / 255.0 for half in np.split(seen.cameras["front"].pixels, 2, axis=1))
        return [self.memory, seen.gps.x_m / 100.0, seen.speed.mps / 10.0, left, right, 1.0]


def pytest_drive_robust_register(registry):
    registry.register_simulator("short", lambda options: EmbeddedSimulator(replace(options, tick_cap=80)))
    registry.register_agent("row", Row)
'''

SUITE = '''
import pytest
from pytest_drive_robust import requirements

SENTENCES = """
DS under clean >= 1
RD under GPS noise 5 m <= 0.5
RD under 200 ms latency and occlusion 0.5 <= 0.000001
comfort under 200 ms latency and occlusion 0.5 >= 1
"""


@pytest.mark.parametrize("requirement", requirements(SENTENCES))
def test_requirement(drive, requirement):
    drive.check(requirement)
'''

INI = """
[pytest]
drive_sim = short
drive_agent = row
drive_routes = 801,2501,4001
drive_seeds = 0,1
drive_verdict = point
"""

ENGINES = {
    "processes": ("--drive-executor", "processes", "--drive-workers", "2"),
    "two workers of xdist": ("-n", "2"),
    "ray": ("--drive-executor", "ray", "--drive-workers", "2"),
}
LOCKSTEP = {
    "lockstep": ("--drive-executor", "inline", "--drive-lockstep", "8"),
    "lockstep in processes": ("--drive-executor", "processes", "--drive-workers", "2", "--drive-lockstep", "8"),
}
EPISODES = 3 * 2 * 3


class Campaign:
    """What one run of the suite told and stored."""

    def __init__(self, folder: Path, *options: str) -> None:
        folder.mkdir()
        for name, text in (("conftest.py", CONFTEST), ("test_suite.py", SUITE), ("tox.ini", INI)):
            (folder / name).write_text(text)
        without = ("-p", "no:cacheprovider", "-p", "no:hypothesispytest", "-p", "no:allure_pytest")
        command = [sys.executable, "-m", "pytest", "--drive-robust", "-q", *without]
        done = subprocess.run(
            [*command, "--drive-json", "run.json", *options], cwd=folder, capture_output=True, text=True, check=False
        )
        self.text = done.stdout + done.stderr
        assert done.returncode in (0, 1), self.text
        self.told: dict[str, Any] = json.loads((folder / "run.json").read_text())
        found = {path.stem: decode_episode(path.read_bytes()) for path in folder.rglob("*.episode")}
        assert len(found) == EPISODES, self.text
        self.by_key = found
        self.by_name = {str(result.episode): result for result in found.values()}

    def verdicts(self) -> dict[str, dict[str, Any]]:
        """Everything that was said about each requirement."""
        return {judged["nodeid"]: judged for judged in self.told["requirements"]}

    def tables(self) -> list[dict[str, Any]]:
        """The rows of the table."""
        return sorted(self.told["summaries"], key=lambda row: row["setting"])


def bits(result: EpisodeResult) -> bytes:
    """The record, but for how long it took."""
    return encode_episode(replace(result, wall_s=0.0))


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    return Campaign(tmp_path_factory.mktemp("engines") / "suite", "--drive-executor", "inline")


def test_the_campaign_tells_episodes_and_settings_apart(alone: Campaign) -> None:
    assert {judged["verdict"] for judged in alone.verdicts().values()} >= {"pass", "fail"}
    assert len({result.trace.digest for result in alone.by_key.values()}) > EPISODES / 2
    assert {result.ticks for result in alone.by_key.values()} == {80}


@pytest.mark.parametrize("engine", ENGINES)
def test_an_engine_gives_the_verdicts_and_the_bytes_of_driving_inline(
    tmp_path: Path, alone: Campaign, engine: str
) -> None:
    if engine == "ray" and importlib.util.find_spec("ray") is None:
        pytest.skip("ray is not installed")
    other = Campaign(tmp_path / "suite", *ENGINES[engine])
    assert other.verdicts() == alone.verdicts()
    assert other.tables() == alone.tables()
    assert {key: bits(one) for key, one in other.by_key.items()} == {
        key: bits(one) for key, one in alone.by_key.items()
    }


@pytest.mark.parametrize("engine", LOCKSTEP)
def test_lockstep_gives_the_verdicts_the_scores_and_the_traces_of_driving_inline(
    tmp_path: Path, alone: Campaign, engine: str
) -> None:
    other = Campaign(tmp_path / "suite", *LOCKSTEP[engine])
    assert other.verdicts() == alone.verdicts()
    assert other.tables() == alone.tables()
    assert not other.by_key.keys() & alone.by_key.keys(), "what was driven in lockstep has keys of its own"
    for name, one in other.by_name.items():
        twin = alone.by_name[name]
        assert one.versions == {**twin.versions, "lockstep": "8"}
        assert (driving_score(one), comfort(one)) == (driving_score(twin), comfort(twin))
        assert one.trace.rows.tobytes() == twin.trace.rows.tobytes()
        assert bits(replace(one, versions={})) == bits(replace(twin, versions={}))
