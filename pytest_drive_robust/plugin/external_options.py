"""Adapts the options of a run that the official evaluator drives, or that judges results; refuses unused options."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.execution import ExecutionOptions
from pytest_drive_robust.options.option import asked_for
from pytest_drive_robust.options.run import BENCH2DRIVE, RESULTS, RunOptions
from pytest_drive_robust.options.table import OPTIONS
from pytest_drive_robust.plugin.process_roles import is_controller
from pytest_drive_robust.registry.registry import default_registry

if TYPE_CHECKING:  # few sessions judge results
    from pytest_drive_robust.bench2drive.results.results_executor import ResultsExecutor

RESULTS_READ = pytest.StashKey["ResultsExecutor"]()
"""In `config.stash`: the results that `--drive-results` names."""
_DRIVES_BY_ITSELF = (
    f"--drive-sim {BENCH2DRIVE}: the official evaluator drives in processes and by rules of its own, and keeps its "
    "records. Leave it out; --drive-episode-timeout, --drive-workers, --drive-store=FOLDER and --drive-fresh do have "
    "an effect."
)
_READS_RESULTS = "--drive-results, which judges what was driven before. Leave it out."


def external_options(config: pytest.Config, options: RunOptions, execution: ExecutionOptions) -> RunOptions:
    """Return the run options, adapted to the official evaluator or to results; unchanged for our simulators.

    Our store keeps no external episode. The evaluator keeps its own records and ends episodes by its own rules, so
    `stuck_stop_s` is None. Results are read here, in every process: when no seeds were given, the repetitions of the
    results are the seeds, also in the header. Raises `UsageError` for options that do not go together.
    """
    if execution.results:
        if options.simulator == BENCH2DRIVE and not asked_for("--drive-results", config):
            raise UsageError("--drive-results judges what was driven before: leave --drive-sim bench2drive out.")
        _refuse_unheeded(config, _unheeded_by_results(config, options, execution), why=_READS_RESULTS)
        agent = options.agent if options.agent_given else RESULTS
        results = _read_results(config, options, execution)
        seeds = options.seeds if options.seeds_given else results.repetitions
        return replace(options, agent=agent, simulator=RESULTS, seeds=seeds)
    if options.simulator != BENCH2DRIVE:
        return options
    if not execution.b2d_root:
        raise UsageError(
            "--drive-sim bench2drive needs --drive-b2d-root=FOLDER, a checkout of Bench2Drive; "
            "`drive-robust doctor --root FOLDER` says what else is missing."
        )
    if is_controller(config):
        raise UsageError(
            "--drive-sim bench2drive drives from one process: leave -n out; --drive-workers N gives N CARLA servers."
        )
    _refuse_unheeded(config, _unheeded_by_evaluator(options, execution), why=_DRIVES_BY_ITSELF)
    return replace(options, stuck_stop_s=None)


def _read_results(config: pytest.Config, options: RunOptions, execution: ExecutionOptions) -> ResultsExecutor:
    """Read the results that `--drive-results` names, once in each process. Raises `UsageError`."""
    from pytest_drive_robust.bench2drive.results.results_executor import ResultsExecutor

    known = default_registry().perturbations()
    start = None if asked_for("--drive-results", config) else config.rootpath  # the ini file's paths start there
    results = ResultsExecutor.read(execution.results, known, options.asked_reading, start=start)
    config.stash[RESULTS_READ] = results
    return results


def _unheeded_by_evaluator(options: RunOptions, execution: ExecutionOptions) -> dict[str, bool]:
    """Return, for each flag that the official evaluator ignores, whether its value asks for an effect."""
    return {
        "--drive-act-timeout": execution.act_timeout_s is not None,
        "--drive-memory": execution.memory_bytes is not None,
        "--drive-stuck-stop": options.stuck_stop_s is not None,
        "--drive-lockstep": execution.lockstep is not None,
        "--drive-executor": execution.executor in ("inline", "ray"),
        "--drive-store": options.store == "off",  # its records are kept
        "--drive-probe": options.probe,
    }


def _unheeded_by_results(config: pytest.Config, options: RunOptions, execution: ExecutionOptions) -> dict[str, bool]:
    """Return, for each flag about driving, whether its value asks for an effect: results are driven already."""
    return {
        **_unheeded_by_evaluator(options, execution),
        "--drive-sim": True,
        "--drive-store": options.store != "off",
        "--drive-fresh": options.fresh,
        "--drive-workers": execution.workers is not None,
        "--drive-episode-timeout": execution.episode_timeout_s is not None,
        "--drive-executor": config.getoption("drive_executor") != "auto",
    }


def _refuse_unheeded(config: pytest.Config, unheeded: Mapping[str, bool], *, why: str) -> None:
    """Raise `UsageError` for a flag of `unheeded` that the command line asks for.

    The ini file may set such a flag: other runs read the ini file, too.
    """
    for flag, is_unheeded in unheeded.items():
        if is_unheeded and asked_for(flag, config):
            option = OPTIONS[flag]
            given = flag if option.is_switch else f"{flag} {config.getoption(option.name)}"
            raise UsageError(f"{given} has no effect with {why}")
