"""`pytest --drive-robust --drive-sim gymnasium:ID`, as people call it."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from pytest_drive_robust.cli.main import main
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.testing import ScriptedAgent

CONFTEST = """
import math

from pytest_drive_robust import Control
from pytest_drive_robust.testing import ScriptedAgent


def crawl(observation):
    route, ego = observation.truth.route, observation.truth.state.ego
    x, y = route[min(observation.truth.progress + 5, len(route) - 1), :2]
    right = -(x - ego.x_m) * math.sin(ego.yaw_rad) + (y - ego.y_m) * math.cos(ego.yaw_rad)
    push = 5.0 - ego.speed_mps
    return Control(min(max(push, 0.0), 1.0), min(max(right / 4.0, -1.0), 1.0), min(max(-push, 0.0), 1.0))


def pytest_drive_robust_register(registry):
    registry.register_agent("crawl", lambda: ScriptedAgent(crawl, privileged=True))
"""
SUITE = '''
import pytest
from pytest_drive_robust import requirements


@pytest.mark.parametrize("requirement", requirements("""DS under clean >= 1\nDS under 500 ms latency >= 1"""))
def test_requirement(drive, requirement):
    drive.check(requirement)
'''


def standing():
    return ScriptedAgent([Control(brake=1.0)])


@pytest.fixture
def run(tmp_path, plugin_args):
    """A real process: highway-env brings libraries that cannot be imported twice into one."""
    (tmp_path / "conftest.py").write_text(CONFTEST)
    (tmp_path / "test_suite.py").write_text(SUITE)
    (tmp_path / "tox.ini").write_text("[pytest]\n")
    environment = os.environ | {"COLUMNS": "120", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    environment.pop("PYTEST_ADDOPTS", None)

    def call(*arguments):
        command = [sys.executable, "-m", "pytest", *plugin_args, "--drive-robust", "--drive-agent", "crawl"]
        return subprocess.run(
            [*command, *arguments], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )

    return call


def test_two_routes_are_driven_and_judged(run):
    result = run("--drive-sim", "gymnasium:roundabout-v0", "--drive-routes", "roundabout-v0-0,roundabout-v0-12")
    assert result.returncode == 0, result.stdout + result.stderr
    assert "sim=gymnasium:roundabout-v0 routes=2 (roundabout-v0-0,roundabout-v0-12)" in result.stdout
    assert "2 passed" in result.stdout
    assert "500 ms latency" in result.stdout


def test_without_routes_it_brings_its_own(run):
    result = run("--drive-sim", "gymnasium:merge-v0", "--collect-only")
    assert "routes=10 (gymnasium:merge-v0)" in result.stdout
    assert result.returncode == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("gymnasium:roundabot-v0",), "Did you mean 'roundabout-v0'?"),
        (("gymnasium:merge-v0", "--drive-routes", "dev10"), "does not fit gymnasium:merge-v0"),
    ],
    ids=["unknown-id", "our-routes"],
)
def test_what_cannot_be_driven_is_refused_before_anything_is(run, arguments, message):
    result = run("--drive-sim", *arguments)
    assert result.returncode == 4, result.stdout + result.stderr
    assert message in result.stdout + result.stderr
    assert "Traceback" not in result.stdout + result.stderr


@pytest.mark.parametrize(
    ("simulator", "message"),
    [
        ("gymnasum:roundabout-v0", "Did you mean 'gymnasium:roundabout-v0'?"),
        ("gymnasium:parking-v0", "gymnasium:parking-v0 cannot be driven: it has no lane"),
        ("gymnasium", "give gymnasium:ID"),
        ("gymnasium:merge-v0", "Did you mean 'merge-v0-0'?"),
    ],
    ids=["unknown-name", "refused", "no-id", "unknown-route"],
)
def test_the_command_line_refuses_the_same(simulator, message, capsys):
    arguments = ["replay", "merge-v1-0", "--agent", f"{__name__}:standing", "--sim", simulator]
    assert main(arguments) == 4
    assert message in capsys.readouterr().err


@pytest.mark.parametrize("body", ["raise SystemExit('no licence')", "1 / 0", "import no_such_module"])
def test_a_module_of_environments_that_does_not_load_is_refused(body, tmp_path, monkeypatch, capsys):
    (tmp_path / "leaving.py").write_text(body)
    monkeypatch.syspath_prepend(str(tmp_path))
    arguments = ["replay", "merge-v1-0", "--agent", f"{__name__}:standing", "--sim", "gymnasium:leaving:merge-v1"]
    assert main(arguments) == 4
    assert "the module 'leaving' of gymnasium:leaving:merge-v1 does not load: " in capsys.readouterr().err


def test_pytest_refuses_a_module_of_environments_that_exits(run, tmp_path):
    (tmp_path / "leaving.py").write_text("import sys\nsys.exit('no licence')")
    result = run("--drive-sim", "gymnasium:leaving:merge-v1")
    assert result.returncode == 4, result.stdout + result.stderr
    assert "does not load: SystemExit: no licence." in result.stdout + result.stderr
    assert "INTERNALERROR" not in result.stdout + result.stderr


def test_the_list_of_simulators_shows_how_to_name_one(capsys):
    assert main(["list", "simulators"]) == 0
    shown = capsys.readouterr().out
    assert "gymnasium:ID" in shown
