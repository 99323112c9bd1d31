"""`--drive-agent leaderboard:FILE+CONFIG` through the front door."""

from __future__ import annotations

import pytest

AGENT = """
import carla
from leaderboard.autoagents.autonomous_agent import AutonomousAgent, Track


def get_entry_point():
    return "Cruiser"


class Cruiser(AutonomousAgent):
    def setup(self, path_to_conf_file):
        self.track = Track.SENSORS
        with open(path_to_conf_file) as file:
            self.throttle = float(file.read())

    def sensors(self):
        return [
            {"type": "sensor.speedometer", "reading_frequency": 20, "id": "SPEED"},
            {"type": "sensor.other.gnss", "x": 0.0, "y": 0.0, "z": 0.0, "id": "GPS"},
        ]

    def run_step(self, input_data, timestamp):
        assert set(input_data) == {"SPEED", "GPS"}
        assert input_data["GPS"][0] == round(timestamp * 20)
        return carla.VehicleControl(throttle=self.throttle)
"""

CLEAN = "DS under clean >= 60"


@pytest.fixture
def folder(suite):
    made = suite(CLEAN)
    (made.path / "team").mkdir()
    (made.path / "team" / "cruiser.py").write_text(AGENT)
    (made.path / "gentle.txt").write_text("1.0")
    return made


@pytest.mark.parametrize("workers", [(), ("-n2",)], ids=["one-process", "two-workers"])
def test_an_agent_of_the_leaderboard_is_driven(folder, driven, workers):
    args = ("--drive-robust", "--drive-agent", "leaderboard:team/cruiser.py+gentle.txt", *workers)
    result = folder.runpytest_inprocess(*args)
    result.assert_outcomes(passed=1)
    assert len(driven()) == 3


def test_it_is_driven_again_only_when_its_configuration_changes(folder, driven):
    args = ("--drive-robust", "--drive-agent", "leaderboard:team/cruiser.py+gentle.txt")
    folder.runpytest_subprocess(*args).assert_outcomes(passed=1)
    folder.runpytest_subprocess(*args).assert_outcomes(passed=1)
    assert len(driven()) == 3
    (folder.path / "gentle.txt").write_text("0.9")
    folder.runpytest_subprocess(*args)
    assert len(driven()) == 6


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("leaderboard:team/crusier.py+gentle.txt", "did you mean 'team/cruiser.py'?"),
        ("leaderboard:team/cruiser.py+gentel.txt", "did you mean 'gentle.txt'?"),
        ("leaderboard:team/cruiser.py", "Cruiser of cruiser.py cannot be set up: FileNotFoundError"),
        ("leaderbord:team/cruiser.py", "Did you mean 'leaderboard:team/cruiser.py'?"),
    ],
)
def test_what_cannot_be_driven_is_said_before_anything_is(folder, driven, given, message):
    result = folder.runpytest_inprocess("--drive-robust", "--drive-agent", given)
    assert result.ret == 4
    output = " ".join("\n".join((*result.outlines, *result.errlines)).split())
    assert message in output
    assert "Traceback" not in output
    assert driven() == []


def test_an_unknown_sensor_is_said_before_anything_is_driven(folder, driven):
    file = folder.path / "team" / "cruiser.py"
    file.write_text(file.read_text().replace("sensor.other.gnss", "sensor.other.radr"))
    result = folder.runpytest_inprocess("--drive-robust", "--drive-agent", "leaderboard:team/cruiser.py+gentle.txt")
    assert result.ret == 4
    assert "Did you mean 'sensor.other.radar'?" in " ".join("\n".join((*result.outlines, *result.errlines)).split())
    assert driven() == []
