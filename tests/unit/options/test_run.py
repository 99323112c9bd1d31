from __future__ import annotations

from pathlib import Path

import pytest

from pytest_drive_robust.domain.verdict_rule import VERDICT_KINDS, VerdictRule
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.run import RunOptions, check_seeds, parse_seeds
from pytest_drive_robust.options.table import OPTIONS


class FakeConfig:
    """A pytest config: options by dest, ini values by key."""

    def __init__(self, ini: dict[str, str] | None = None, *, rootpath: Path = Path(), **options: str) -> None:
        self.rootpath = rootpath
        self._ini = ini or {}
        self._options = options

    def getoption(self, name: str) -> str | None:
        return self._options.get(name)

    def getini(self, name: str) -> str:
        return self._ini.get(name, "")


def test_without_options_the_defaults_hold():
    assert RunOptions.from_pytest_config(FakeConfig()) == RunOptions()
    assert (RunOptions().agent, RunOptions().routes, RunOptions().seeds) == ("classical", "one-per-scenario", (0,))


def test_the_command_line_wins_over_the_ini_file():
    config = FakeConfig({"drive_agent": "expert", "drive_sim": "other"}, drive_agent="constant")
    settings = RunOptions.from_pytest_config(config)
    assert (settings.agent, settings.simulator) == ("constant", "other")


def test_every_option_is_read(tmp_path):
    files = tmp_path / "run.json", tmp_path / "run.csv"
    values = (
        *("a", "r.xml", "3, 1", "s", "fixed", "list", "0.2", "0.01", "skip", "holm", "12.5", "kept"),
        *map(str, files),
    )
    config = FakeConfig(**{option.ini: value for option, value in zip(OPTIONS, values, strict=True)})
    verdict_rule = VerdictRule("list", 0.2, 0.01)
    assert RunOptions.from_pytest_config(config) == RunOptions(
        "a", "r.xml", (3, 1), "s", "fixed", 12.5, files[0], verdict_rule, "skip", files[1], "holm", "kept"
    )


def test_a_store_that_is_a_file_is_refused(tmp_path):
    (tmp_path / "kept").write_text("mine")
    with pytest.raises(UsageError, match=r"--drive-store is '.*kept', which is a file; expected a folder, or off"):
        RunOptions.from_pytest_config(FakeConfig(drive_store=str(tmp_path / "kept")))
    with pytest.raises(UsageError, match="--drive-store is 'kept'"):
        RunOptions.from_pytest_config(FakeConfig(drive_store="kept", rootpath=tmp_path))


@pytest.mark.parametrize("text", ["", "x", "1,", "-1", "1.5", "0,0", "²"])
def test_seeds_that_are_no_distinct_whole_numbers_are_refused(text):
    with pytest.raises(UsageError, match="--drive-seeds"):
        parse_seeds(text, source="--drive-seeds")


@pytest.mark.parametrize("seeds", [[], [True], ["0"], [0.0], [1, 1], [-1]])
def test_seeds_of_a_marker_are_checked_too(seeds):
    with pytest.raises(UsageError, match="the marker"):
        check_seeds(seeds, source="the marker")


@pytest.mark.parametrize("text", ["nan", "inf", "0", "-1", "soon"])
def test_a_stuck_stop_that_is_no_time_is_refused(text):
    with pytest.raises(UsageError, match="expected seconds > 0"):
        RunOptions.from_pytest_config(FakeConfig(drive_stuck_stop=text))


def test_a_missing_folder_is_refused_with_the_nearest_one(tmp_path):
    (tmp_path / "reports").mkdir()
    with pytest.raises(UsageError, match=r"Did you mean '.*reports'"):
        RunOptions.from_pytest_config(FakeConfig(drive_json=str(tmp_path / "report" / "run.json")))
    assert [path.name for path in tmp_path.iterdir()] == ["reports"]


def test_the_help_of_the_verdict_option_names_every_rule():
    option = next(option for option in OPTIONS if option.ini == "drive_verdict")
    assert all(kind in option.help for kind in VERDICT_KINDS)
