"""The command line, in the process and once from outside."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from pytest_drive_robust.cli.main import COMMANDS, main
from pytest_drive_robust.registry import registry

FAKE = "pytest_drive_robust.testing:FakeSimulator"
AGENT = """
from pytest_drive_robust import Control

class Good:
    def sensors(self): return []
    def reset(self, route, seed): pass
    def act(self, observation): return Control(throttle=1.0, steer=max(-1.0, min(1.0, -0.1 * observation.gps.y_m)))

class Bad(Good):
    def act(self, observation): return None
"""


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "cli_agents.py").write_text(AGENT)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))


def test_list_shows_every_kind_with_its_origin(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list"]) == 0
    shown = capsys.readouterr().out
    for word in ("agents", "burst-frame-drop", "embedded", "built in", "comfort", "one-per-scenario", "dev10"):
        assert word in shown


def test_list_of_one_kind_shows_no_other(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "simulators"]) == 0
    shown = capsys.readouterr().out
    assert "embedded" in shown
    assert "burst-frame-drop" not in shown


def test_an_agent_that_keeps_the_contract_exits_with_0(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check-agent", "cli_agents:Good", "--sim", FAKE]) == 0
    shown = capsys.readouterr().out
    assert "keeps the contract" in shown
    assert "determinism" in shown


def test_an_agent_that_breaks_the_contract_exits_with_1(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check-agent", "cli_agents:Bad", "--sim", FAKE]) == 1
    shown = capsys.readouterr().out
    assert "breaks the contract" in shown
    assert "act returned None" in shown


def test_every_route_that_is_named_is_checked(capsys: pytest.CaptureFixture[str]) -> None:
    from pytest_drive_robust.runner.routes import resolve_routes

    ids = [route.id for route in resolve_routes("full")[:2]]
    assert main(["check-agent", "cli_agents:Good", "--sim", FAKE, "--routes", ",".join(ids)]) == 0
    assert capsys.readouterr().out.count("keeps the contract") == 2


def test_replay_shows_both_episodes_and_where_they_part(capsys: pytest.CaptureFixture[str]) -> None:
    from pytest_drive_robust.runner.routes import resolve_routes

    route = resolve_routes("full")[0]
    arguments = ["replay", route.id, "--agent", "cli_agents:Good", "--sim", FAKE, "--setting", "200 ms latency"]
    assert main([*arguments, "--seed", "5", "--no-video"]) == 0
    shown = capsys.readouterr().out
    assert f"cli_agents:Good on {route.id} under clean, seed 5 ({route.scenario.type})" in shown
    assert f"cli_agents:Good on {route.id} under 200 ms latency, seed 5" in shown
    assert shown.count("completed: DS ") == 2
    assert "first divergence at " in shown


def test_replay_of_the_clean_setting_drives_once(capsys: pytest.CaptureFixture[str]) -> None:
    from pytest_drive_robust.runner.routes import resolve_routes

    route = resolve_routes("full")[0]
    assert main(["replay", route.id, "--agent", "cli_agents:Bad", "--sim", FAKE, "--no-video"]) == 0
    shown = capsys.readouterr().out
    assert shown.count("under clean") == 1
    assert "agent_error" in shown
    assert "first divergence" not in shown


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["list", "agnts"], "Did you mean 'agents'"),
        (["check-agent", "nobody"], "no agent named 'nobody'"),
        (["check-agent", "cli_agents:Good", "--sim", "embeded"], "Did you mean 'embedded'"),
        (["check-agent", "cli_agents:Good", "--sim", FAKE, "--routes", "dev11"], "Did you mean 'dev10'"),
        (["-p", "conftes.py", "list"], "-p is 'conftes.py', but there is no such file"),
        (["-p", "no_such_plugin", "list"], "expected a module that can be imported or the path of a conftest.py"),
        (["-p", "cli_agents", "list"], "registers no names: it has no function pytest_drive_robust_register"),
        (["-p", "leaves.py", "list"], "SystemExit: not here"),
        (["replay", "no-such", "--agent", "cli_agents:Good", "--sim", FAKE], "no route named 'no-such'"),
        (["replay", "1", "--agent", "cli_agents:Good", "--sim", FAKE, "--setting", "200 ms latncy"], "latency"),
    ],
)
def test_what_cannot_be_used_exits_with_4_and_one_message(
    arguments: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "leaves.py").write_text("raise SystemExit('not here')")
    assert main(arguments) == 4
    captured = capsys.readouterr()
    assert told in captured.err
    assert captured.err.startswith("drive-robust: ")
    assert "Traceback" not in captured.err


@pytest.mark.parametrize("inside", ["", "pack"])
def test_a_module_or_a_conftest_registers_names(
    inside: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A `conftest.py` may import its neighbours, by the name of its package where it is in one."""
    registry.default_registry.cache_clear()
    neighbour = "pack.drivers" if inside else "drivers"
    hook = "def pytest_drive_robust_register(registry): registry.register_agent({!r}, Good)\n"
    (tmp_path / "suites" / inside).mkdir(parents=True)
    if inside:
        (tmp_path / "suites" / inside / "__init__.py").touch()
    (tmp_path / "suites" / inside / "drivers.py").write_text(AGENT)
    (tmp_path / "suites" / inside / "conftest.py").write_text(f"from {neighbour} import Good\n" + hook.format("mine"))
    (tmp_path / "of_a_module.py").write_text("from cli_agents import Good\n" + hook.format("another"))
    for module in ("conftest", "pack", "pack.conftest", "drivers", "pack.drivers", "of_a_module", "cli_agents"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    plugins = ("-p", (Path("suites") / inside / "conftest.py").as_posix(), "-p", "of_a_module")
    assert main([*plugins, "check-agent", "mine", "--sim", FAKE]) == 0
    assert main(["check-agent", "another", "--sim", FAKE]) == 0
    assert main([*plugins, "list", "agents"]) == 0  # the same once more is no second registration
    registry.default_registry.cache_clear()
    capsys.readouterr()
    assert main(["check-agent", "mine", "--sim", FAKE]) == 4
    assert "drive-robust reads that of a conftest.py with -p conftest.py" in capsys.readouterr().err


def test_the_version_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main(["--version"])
    assert left.value.code == 0
    assert capsys.readouterr().out.startswith("drive-robust ")


def test_the_module_runs_as_a_program() -> None:
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-m", "pytest_drive_robust.cli", "list", "simulators"],
        capture_output=True,
        text=True,
        check=False,
        cwd=root,
    )
    assert done.returncode == 0, done.stderr
    assert "embedded" in done.stdout


def test_a_replay_stops_early_where_the_run_did(capsys: pytest.CaptureFixture[str]) -> None:
    from pytest_drive_robust.runner.routes import resolve_routes

    route = next(route.id for route in resolve_routes("full") if route.scenario.type == "ParkedObstacle")
    arguments = ["replay", route, "--agent", "drive_robust_agents.constant:Constant", "--no-video", "--stuck-stop"]
    assert main([*arguments, "5"]) == 0
    assert "stopped early" in capsys.readouterr().out
    assert main([*arguments, "soon"]) == 4
    assert "--stuck-stop is 'soon', expected seconds > 0" in capsys.readouterr().err


def test_every_command_of_the_table_has_a_module_and_is_listed_by_help(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--help"])
    shown = capsys.readouterr().out
    for name in COMMANDS:
        assert name in shown.split()
        with pytest.raises(SystemExit) as left:
            main([name, "--help"])
        assert left.value.code == 0


def test_only_the_module_of_the_command_is_imported() -> None:
    program = (
        "import sys\n"
        "from pytest_drive_robust.cli.main import main\n"
        "main(['runs', 'list'])\n"
        "print(*sorted(name for name in sys.modules if name.startswith('pytest_drive_robust.cli.')))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1].split() == [
        f"pytest_drive_robust.cli.{name}" for name in ("main", "runs", "tables")
    ]
