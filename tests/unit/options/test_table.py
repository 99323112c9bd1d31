"""Every option is stated once and read once."""

from __future__ import annotations

from pytest_drive_robust.options.execution import ExecutionOptions
from pytest_drive_robust.options.option import options_of
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.options.table import OPTIONS
from pytest_drive_robust.regression.options import RegressionOptions


def test_every_option_but_the_switch_of_the_plugin_is_read_by_one_field():
    read = [option for cls in (RunOptions, ExecutionOptions, RegressionOptions) for option in options_of(cls)]
    assert sorted(option.flag for option in read) == sorted(set(OPTIONS) - {"--drive-robust"})


def test_the_table_finds_an_option_by_its_flag_and_the_name_is_its_ini_key():
    assert all(option.flag == flag for flag, option in OPTIONS.items())
    assert OPTIONS["--drive-stuck-stop"].name == "drive_stuck_stop"


def test_a_switch_has_no_value():
    assert {option.flag for option in OPTIONS.values() if option.is_switch} == {
        "--drive-robust",
        "--drive-fresh",
        "--drive-plan",
        "--drive-probe",
    }
    assert not any(option.metavar or option.default for option in OPTIONS.values() if option.is_switch)
