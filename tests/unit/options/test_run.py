from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from pytest_drive_robust.domain.verdict_rule import VERDICT_KINDS, VerdictRule
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.option import options_of
from pytest_drive_robust.options.run import RunOptions


class FakeConfig:
    """A pytest config: options by dest, ini values by key."""

    def __init__(
        self, ini: dict[str, str] | None = None, *, rootpath: Path = Path(), called_in: Path = Path(), **options: object
    ) -> None:
        self.rootpath = rootpath
        self.invocation_params = SimpleNamespace(dir=called_in)
        self._ini = ini or {}
        self._options = options

    def getoption(self, name: str) -> object:
        return self._options.get(name)

    def getini(self, name: str) -> str:
        return self._ini.get(name, "")


def test_without_options_the_defaults_hold():
    assert RunOptions.from_pytest_config(FakeConfig()) == RunOptions()
    assert (RunOptions().agent, RunOptions().routes, RunOptions().seeds) == ("tcp", "one-per-scenario", (0,))


def test_the_command_line_wins_over_the_ini_file():
    config = FakeConfig({"drive_agent": "expert", "drive_sim": "other"}, drive_agent="constant")
    settings = RunOptions.from_pytest_config(config)
    assert (settings.agent, settings.simulator) == ("constant", "other")


def test_every_option_is_read(tmp_path):
    files = tmp_path / "run.json", tmp_path / "run.csv", tmp_path / "look"
    values = (
        *(
            "a",
            "r.xml",
            "3, 1",
            "s",
            "released",
            "fixed",
            "list",
            "0.2",
            "0.01",
            "skip",
            "holm",
            "12.5",
            "kept",
            "on",
        ),
        *(*map(str, files), "on", "on"),
    )
    config = FakeConfig(**{option.name: value for option, value in zip(options_of(RunOptions), values, strict=True)})
    verdict_rule = VerdictRule("list", 0.2, 0.01)
    assert RunOptions.from_pytest_config(config) == RunOptions(
        *("a", "r.xml", (3, 1), "s", "released", "fixed", verdict_rule, "skip", "holm", 12.5, "kept", True),
        *(*files, True, True),
    )


def test_a_reading_is_asked_for_only_where_somebody_says_so():
    asked = RunOptions.from_pytest_config(FakeConfig({"drive_reading": "released"})).asked_reading
    assert (asked.name, asked.asked) == ("released", "--drive-reading released")
    assert RunOptions.from_pytest_config(FakeConfig(drive_reading="paper")).asked_reading.name == "paper"
    usual = RunOptions.from_pytest_config(FakeConfig())
    assert (usual.reading, usual.asked_reading) == ("paper", None)


def test_an_unknown_reading_is_refused_with_the_nearest_one():
    with pytest.raises(
        UsageError, match=r"there is no reading named 'relesed'\. Did you mean 'released'.*--drive-reading"
    ):
        RunOptions.from_pytest_config(FakeConfig(drive_reading="relesed"))


def test_a_store_that_is_a_file_is_refused(tmp_path):
    (tmp_path / "kept").write_text("mine")
    with pytest.raises(UsageError, match=r"--drive-store is '.*kept', which is a file; expected a folder, or off"):
        RunOptions.from_pytest_config(FakeConfig(drive_store=str(tmp_path / "kept")))
    with pytest.raises(UsageError, match="--drive-store is 'kept'"):
        RunOptions.from_pytest_config(FakeConfig({"drive_store": "kept"}, rootpath=tmp_path))
    with pytest.raises(UsageError, match="--drive-store is 'kept'"):
        RunOptions.from_pytest_config(FakeConfig(drive_store="kept", called_in=tmp_path))


def test_a_store_of_the_command_line_starts_from_the_folder_that_pytest_was_called_in(tmp_path):
    ini = {"drive_store": "kept"}
    folders = {"rootpath": tmp_path / "root", "called_in": tmp_path / "here"}
    assert RunOptions.from_pytest_config(FakeConfig(ini, **folders)).store == "kept"
    asked = RunOptions.from_pytest_config(FakeConfig(ini, drive_store="../mine", **folders)).store
    assert Path(asked) == tmp_path / "here" / ".." / "mine"
    assert RunOptions.from_pytest_config(FakeConfig(ini, drive_store="off", **folders)).store == "off"


@pytest.mark.parametrize(("text", "stop_s"), [("none", None), (None, None), ("2.5", 2.5)])
def test_a_stuck_stop_can_be_turned_off(text, stop_s):
    assert RunOptions.from_pytest_config(FakeConfig(drive_stuck_stop=text)).stuck_stop_s == stop_s


@pytest.mark.parametrize("text", ["nan", "inf", "0", "-1", "soon"])
def test_a_stuck_stop_that_is_no_time_is_refused(text):
    with pytest.raises(UsageError, match="expected seconds > 0"):
        RunOptions.from_pytest_config(FakeConfig(drive_stuck_stop=text))


@pytest.mark.parametrize(
    "option", [option for option in options_of(RunOptions) if not option.is_switch], ids=lambda option: option.flag
)
def test_a_blank_value_is_refused_on_the_command_line_and_is_none_in_the_ini_file(option):
    with pytest.raises(UsageError, match=f"{option.flag} is empty, expected {option.metavar}: "):
        RunOptions.from_pytest_config(FakeConfig(**{option.name: " "}))
    assert RunOptions.from_pytest_config(FakeConfig({option.name: " "})) == RunOptions()


def test_a_missing_folder_is_refused_with_the_nearest_one(tmp_path):
    (tmp_path / "reports").mkdir()
    with pytest.raises(UsageError, match=r"Did you mean '.*reports'"):
        RunOptions.from_pytest_config(FakeConfig(drive_json=str(tmp_path / "report" / "run.json")))
    assert [path.name for path in tmp_path.iterdir()] == ["reports"]


def test_the_help_of_the_verdict_option_names_every_rule():
    option = options_of(RunOptions, "verdict_rule")[0]
    assert all(kind in option.help for kind in VERDICT_KINDS)


def test_two_files_at_one_path_are_refused_however_it_is_written(tmp_path):
    (tmp_path / "sub").mkdir()
    for other in ("out.json", "./out.json", "sub/../out.json"):
        with pytest.raises(UsageError, match="name one path"):
            RunOptions.from_pytest_config(FakeConfig(called_in=tmp_path, drive_json="out.json", drive_csv=other))
