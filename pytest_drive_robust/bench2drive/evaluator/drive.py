"""Drive one route in the official evaluator, again after harness errors."""

from __future__ import annotations

import os
import shutil
import threading
from pathlib import Path

from pytest_drive_robust.bench2drive.evaluator.attempt import STOPPED, Attempt, attempt
from pytest_drive_robust.bench2drive.evaluator.injection_log import Injected, injected_in
from pytest_drive_robust.bench2drive.evaluator.ports import PORTS_PER_SLOT, TRAFFIC_OFFSET, held_ports
from pytest_drive_robust.bench2drive.evaluator.route_result import (
    DrivenRoute,
    excuse_of,
    keep_files,
    read_finished,
    record_in,
    was_injected,
)
from pytest_drive_robust.bench2drive.evaluator.run_folder import RunFolder
from pytest_drive_robust.bench2drive.evaluator.setup import (
    INJECTED_LOG,
    EvaluatorSetup,
    evaluator_command,
    own_variables,
)
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.perturbations import Setting

_REFUSED = 78
_CANNOT_START = ("ModuleNotFoundError", "ImportError", "SyntaxError")


def drive_route(
    setup: EvaluatorSetup,
    route: str,
    run_folder: RunFolder,
    *,
    slot: int,
    stop: threading.Event,
    reuse: bool,
) -> DrivenRoute:
    """Drive a route until it has a score, at most `setup.tries` times, or until `stop` is set.

    With `reuse`, a route that has a score already is not driven; without, its new score replaces the old one. If
    another command drives the route, wait for that command's result.

    Raises `UsageError` when the evaluator cannot be started with this setup at all, and when the injection does not
    reach the agent.
    """
    finished = read_finished(run_folder, route, setup.setting, setup.seed) if reuse else None
    if finished is not None:
        return finished
    claim = run_folder.claim(route, stop)
    if claim is None:
        return DrivenRoute(route, None, (), Injected(), 0.0)
    with claim:
        # the former holder of the claim may have finished the route
        finished = read_finished(run_folder, route, setup.setting, setup.seed) if reuse else None
        return finished or _drive(setup, route, run_folder, slot=slot, stop=stop)


def _drive(
    setup: EvaluatorSetup, route: str, run_folder: RunFolder, *, slot: int, stop: threading.Event
) -> DrivenRoute:
    troubles: list[str] = []
    wall_s = 0.0
    for number in range(1, setup.tries + 1):
        ended = _once(setup, route, run_folder, number, slot, stop)
        wall_s += ended.wall_s
        if ended.trouble == STOPPED:
            break
        log = run_folder.log(route, number)
        record, trouble = record_in(run_folder.work(route) / "result.json", route, ended)
        injection_log = run_folder.work(route) / INJECTED_LOG
        injected = injected_in(injection_log, route=route, setting=str(setup.setting), seed=setup.seed)
        excuse = "" if record is None else excuse_of(record, ended, log)
        if record is not None and excuse:
            trouble, record = f"{record.status}, {excuse}", None
        if record is not None and not was_injected(setup.setting, record, injected):
            _refuse_unreached(setup.setting, injected)
            trouble, record = f"{record.status}, but nothing tells that {str(setup.setting)!r} was injected", None
        if record is not None:
            keep_files(run_folder, route)
            shutil.rmtree(run_folder.work(route), ignore_errors=True)
            return DrivenRoute(route, record, tuple(troubles), injected, wall_s)
        _refuse_hopeless(ended, log)
        troubles.append(f"{trouble} (see {log})")
    shutil.rmtree(run_folder.work(route), ignore_errors=True)
    return DrivenRoute(route, None, tuple(troubles), Injected(), wall_s)


def _once(
    setup: EvaluatorSetup, route: str, run_folder: RunFolder, number: int, slot: int, stop: threading.Event
) -> Attempt:
    work, log = run_folder.work(route), run_folder.log(route, number)
    shutil.rmtree(work, ignore_errors=True)
    for folder in (work, log.parent, run_folder.results, run_folder.injected(route).parent):
        folder.mkdir(parents=True, exist_ok=True)
    log.unlink(missing_ok=True)
    first = setup.port + slot * PORTS_PER_SLOT
    with held_ports(first) as port, held_ports(first + TRAFFIC_OFFSET) as traffic_port:
        return attempt(
            evaluator_command(setup, route, work, port=port, traffic_port=traffic_port),
            environment={**setup.checkout.environment(os.environ), **own_variables(setup, work, run_folder)},
            folder=setup.checkout.root,  # the evaluator reads files by paths relative to the checkout
            log=log,
            patience=setup.patience,
            stop=stop,
        )


def _refuse_unreached(setting: Setting, injected: Injected) -> None:
    """Raise `UsageError` if the agent drove without the injection: another try would end the same."""
    if injected.ticks:
        raise UsageError(
            f"the agent drove {injected.ticks} ticks and read no sensors through the evaluator's SensorInterface: "
            f"{str(setting)!r} did not reach it. Let its sensors() list what it reads, and run_step() use what it is "
            "given."
        )


def _refuse_hopeless(ended: Attempt, log: Path) -> None:
    """Raise `UsageError` if the evaluator was refused or could not start: another try would end the same."""
    lines = [line.strip() for line in log.read_text(encoding="utf-8", errors="replace").splitlines() if line.strip()]
    last = lines[-1] if lines else ""
    if ended.code == _REFUSED:
        raise UsageError(f"the evaluator could not be set up: {last}")
    if not ended.trouble and ended.code == 1 and last.startswith(_CANNOT_START):
        raise UsageError(
            f"the evaluator could not be started: {last} (see {log}). Does its Python have what the agent needs? "
            "Give it with --drive-b2d-python, without pytest with --python; `drive-robust doctor` says what is missing."
        )
