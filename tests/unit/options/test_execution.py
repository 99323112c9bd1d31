"""How the episodes of a run are driven, by what its command line says."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.cores import available_cores
from pytest_drive_robust.options.execution import ExecutionOptions


def asked(ini: dict[str, str] | None = None, **given: object) -> ExecutionOptions:
    """Return the options of a command line and an ini file."""
    config = SimpleNamespace(
        rootpath=Path(),
        invocation_params=SimpleNamespace(dir=Path()),
        getoption=lambda name, default=None: given.get(name, default),
        getini=lambda name: (ini or {}).get(name, ""),
    )
    return ExecutionOptions.from_pytest_config(config)


@pytest.mark.parametrize(
    ("given", "executor"),
    [
        ({}, "processes"),
        ({"usepdb": True}, "inline"),
        ({"trace": True}, "inline"),
        ({"capture": "no"}, "inline"),
        ({"capture": "fd"}, "processes"),
        ({"capture": "no", "drive_executor": "processes"}, "processes"),
        ({"usepdb": True, "drive_sim": "bench2drive"}, "processes"),
    ],
    ids=str,
)
def test_what_a_debugger_or_prints_need_is_driven_in_this_process(given: dict[str, object], executor: str) -> None:
    assert asked(**given).executor == executor


def test_a_worker_of_xdist_drives_one_episode_at_a_time_and_a_run_alone_one_on_each_core() -> None:
    assert asked().slots(shared=True) == 1
    assert asked().slots(shared=False) == available_cores()
    assert asked(drive_workers="3").slots(shared=True) == asked(drive_workers="3").slots(shared=False) == 3
    assert asked({"drive_workers": "auto"}).workers is None


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"drive_workers": "0"}, "--drive-workers is '0', expected a whole number >= 1, or auto"),
        ({"drive_lockstep": "6"}, "--drive-lockstep is '6', expected a multiple of 4 such as 8"),
        ({"drive_lockstep": "8", "drive_executor": "ray"}, "--drive-lockstep and --drive-executor ray cannot be"),
        ({"drive_executor": "proceses"}, "Did you mean 'processes'"),
    ],
    ids=str,
)
def test_what_cannot_be_used_is_refused(given: dict[str, object], told: str) -> None:
    with pytest.raises(UsageError, match=told):
        asked(**given)


def test_workers_of_xdist_cannot_fill_a_cluster_each() -> None:
    asked(drive_executor="inline").check_workers()
    with pytest.raises(UsageError, match="--drive-executor ray and -n cannot be combined"):
        asked(drive_executor="ray").check_workers()
