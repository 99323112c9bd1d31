"""`leaderboard:path/to/agent_file.py+path/to/config`: what is found, and what is said when it is not."""

from __future__ import annotations

import pytest
from leaderboard_files import AGENT

from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.runner.cache_key.identity import agent_identity


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "team").mkdir()
    (tmp_path / "team" / "noisy_agent.py").write_text(AGENT)
    (tmp_path / "settings.yaml").write_text("gain: 1\n")
    return tmp_path


def refusal(name):
    with pytest.raises(UsageError) as raised:
        Registry().agent(name)
    return str(raised.value)


def test_an_agent_is_made_of_its_file_and_gets_its_configuration(folder):
    agent = Registry().agent("leaderboard:team/noisy_agent.py+settings.yaml")
    assert [camera.name for camera in agent.sensors()] == ["CAM_FRONT"]
    assert agent.consumes == {"cameras", "gps", "compass", "imu", "speed"}
    assert not agent.privileged
    assert agent._class.calls[0] == ("setup", "settings.yaml", 3)


def test_the_list_of_agents_shows_the_syntax():
    assert ("leaderboard:FILE+CONFIG", "built in") in Registry().names("agents")


def test_a_missing_agent_file_is_named_with_the_nearest_one(folder):
    message = refusal("leaderboard:team/noisi_agent.py")
    assert "there is no agent file 'team/noisi_agent.py' (did you mean 'team/noisy_agent.py'?)" in message
    assert "names no agent file" in refusal("leaderboard:")


def test_a_missing_configuration_file_is_named(folder):
    message = refusal("leaderboard:team/noisy_agent.py+setings.yaml")
    assert "there is no 'setings.yaml' (did you mean 'settings.yaml'?)" in message


def test_a_configuration_that_is_no_file_is_passed_on(folder):
    agent = Registry().agent("leaderboard:team/noisy_agent.py+fast")
    assert agent._class.calls[-1] == ("destroy", "fast")


def test_a_misspelt_leaderboard_is_no_module():
    with pytest.raises(UnknownNameError, match=r"Did you mean 'leaderboard:team/noisy_agent\.py'"):
        Registry().agent("leaderbord:team/noisy_agent.py")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("def get_entry_point", "def entry_point", "has no get_entry_point"),
        ('return "NoisyAgent"', "return 3", "returned 3, expected the name of a class"),
        ('return "NoisyAgent"', 'return "NoisiAgent"', "Did you mean 'NoisyAgent'"),
        ("(autonomous_agent.AutonomousAgent)", "", "lacks set_global_plan"),
        ("import carla", "import no_such_module_here", "No module named 'no_such_module_here'"),
        ("import carla", "import carla\ncarla.Client", "our stand-in for carla has no 'Client'"),
        ("self.seen = []", "1 / 0", "cannot be set up: ZeroDivisionError"),
        ("sensor.other.gnss", "sensor.other.gns", "Did you mean 'sensor.other.gnss'"),
        ("sensor.other.gnss", "sensor.camera.depth", "there is no sensor type named 'sensor.camera.depth'"),
        ('"id": "GPS"', '"id": "IMU"', "two sensors with the id 'IMU'"),
        ('"fov": 70', '"fov": "wide"', "the sensor 'CAM_FRONT' of NoisyAgent of changed.py has 'fov': 'wide'"),
        ('"width": 64, ', "", "has 'width': None, expected a number"),
        ('"roll": 0.0', '"roll": 5.0', "has a roll of 5 degrees"),
    ],
)
def test_what_is_wrong_with_an_agent_file_is_said(folder, old, new, message):
    if "stand-in" in message and _carla_is_installed():
        pytest.skip("the carla package is installed here and has everything")
    (folder / "changed.py").write_text(AGENT.replace(old, new))
    assert message in refusal("leaderboard:changed.py")


def test_two_files_of_one_name_are_two_agents(folder):
    (folder / "noisy_agent.py").write_text(AGENT.replace('"CAM_FRONT"', '"CAM_OTHER"'))
    names = {
        file: Registry().agent(f"leaderboard:{file}").sensors()[0].name
        for file in ("noisy_agent.py", "team/noisy_agent.py")
    }
    assert names == {"noisy_agent.py": "CAM_OTHER", "team/noisy_agent.py": "CAM_FRONT"}


def test_file_configuration_neighbours_and_environment_are_the_agent_s_identity(folder, monkeypatch):
    team = folder / "team" / "planning_agent.py"
    team.write_text("import os\nimport near_planner\nMODE = os.environ.get('PLANNER_TYPE')\n" + AGENT)
    (folder / "team" / "near_planner.py").write_text("GAIN = 1\n")
    name = "leaderboard:team/planning_agent.py+settings.yaml"
    first = agent_identity(name, Registry())
    assert agent_identity(name, Registry()) == first
    seen = {first}

    def changed():
        seen.add(agent_identity(name, Registry()))
        return len(seen)

    (folder / "settings.yaml").write_text("gain: 2\n")
    assert changed() == 2
    (folder / "team" / "near_planner.py").write_text("GAIN = 2\n")
    assert changed() == 3
    team.write_text(team.read_text() + "# changed\n")
    assert changed() == 4
    monkeypatch.setenv("PLANNER_TYPE", "only_traj")
    assert changed() == 5
    monkeypatch.setenv("UNRELATED", "1")
    assert changed() == 5


def test_other_agents_can_take_an_argument_too(folder):
    from pytest_drive_robust.testing import ScriptedAgent

    registry = Registry()
    registry.register_agent("scripted", lambda text: lambda: ScriptedAgent([text]), argument="WORD")
    assert "scripted:WORD" in [name for name, _ in registry.names("agents")]
    assert isinstance(registry.agent("scripted:hello"), ScriptedAgent)


def _carla_is_installed():
    from importlib import metadata

    try:
        return bool(metadata.version("carla"))
    except metadata.PackageNotFoundError:
        return False
