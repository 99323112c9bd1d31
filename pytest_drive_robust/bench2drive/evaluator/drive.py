"""Drive one route in the official evaluator, again after harness errors."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pytest_drive_robust.bench2drive.asked_variables import PLANNER_TYPE, asked_variables
from pytest_drive_robust.bench2drive.evaluator.attempt import STOPPED, Attempt, Patience, attempt
from pytest_drive_robust.bench2drive.evaluator.checkout import Checkout
from pytest_drive_robust.bench2drive.evaluator.code_around import code_around
from pytest_drive_robust.bench2drive.evaluator.doctor import carla_version
from pytest_drive_robust.bench2drive.evaluator.ports import PORTS_PER_SLOT, TRAFFIC_OFFSET, held_ports
from pytest_drive_robust.bench2drive.evaluator.run_folder import RunFolder
from pytest_drive_robust.bench2drive.results.motion_log import TICK_S
from pytest_drive_robust.bench2drive.results.official_record import STATUSES, OfficialRecord
from pytest_drive_robust.bench2drive.results.results_file import read_results
from pytest_drive_robust.bench2drive.results.safe_json import shown
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.errors import PerturbationError, UsageError
from pytest_drive_robust.perturbations import BUILTIN, Setting
from pytest_drive_robust.store.reuse import RAN_OUT

_INJECT = Path(__file__).with_name("inject.py")
_INJECTED_LOG = "injected.jsonl"
"""The log of `inject.py` about the injection, beside the result of a try."""
_REFUSED = 78
_CANNOT_START = ("ModuleNotFoundError", "ImportError", "SyntaxError")
_SERVER_LOST = "while waiting for the simulator"
"""Part of the message of every call of CARLA's client when the server is gone."""
_RAN_OUT = re.compile(
    rf"(?:could not set up the required agent|the agent has crashed):.*?({'|'.join(RAN_OUT)})",
    re.IGNORECASE | re.DOTALL,
)
"""Matches the evaluator's report of an agent's exception that is about lack of resources."""


@dataclass(frozen=True, slots=True)
class EvaluatorSetup:
    """The drives to do: `agent` is the agent's file, `config` the text for its `setup`; `seed` also seeds traffic."""

    checkout: Checkout
    agent: Path
    config: str
    setting: Setting
    seed: int
    routes: Path
    port: int
    tries: int
    patience: Patience
    gpu: int = 0

    @property
    def identity(self) -> dict[str, str]:
        """Everything that decides the results, as text by name: drives that differ in one value must not be mixed.

        The configuration may name several files and folders, joined by `+`. The code in the folders of the agent and
        of its Python configuration files counts, and the checkout's own code. Packages in the agent's Python do not
        count, but the path and the version of this Python do.
        """
        checkout = self.checkout
        parts = [checkout.root / part for part in self.config.split("+") if part]
        around = [self.agent.parent, *(part.parent for part in parts if part.suffix == ".py")]
        return {
            "agent": str(self.agent),
            "agent file": _digest(self.agent),
            "config": self.config,
            "config files": "\n".join(map(_stamp, parts)),
            "code": code_around(
                dict.fromkeys((*around, checkout.root / "leaderboard", checkout.root / "scenario_runner"))
            ),
            "python": f"{checkout.python} {checkout.python_version}",
            "carla": carla_version(checkout.carla_root),
            "environment": json.dumps(_asked_environment(self)),
            "setting": str(self.setting),
            "seed": str(self.seed),
            "routes": f"{self.routes} {_digest(self.routes)}",
            "root": str(checkout.root),
        }


@dataclass(frozen=True, slots=True)
class DrivenRoute:
    """The result of a route. `record` is None when no try gave a score; `troubles` has a text for each failed try."""

    route: str
    record: OfficialRecord | None
    troubles: tuple[str, ...]
    injected: Mapping[str, object]
    wall_s: float


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
    finished = read_finished(run_folder, route, setup.setting) if reuse else None
    if finished is not None:
        return finished
    claim = run_folder.claim(route, stop)
    if claim is None:
        return DrivenRoute(route, None, (), {}, 0.0)
    with claim:
        # the former holder of the claim may have finished the route
        finished = read_finished(run_folder, route, setup.setting) if reuse else None
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
        record, trouble = _record_in(run_folder.work(route) / "result.json", route, ended)
        injected = _injected(run_folder.work(route) / _INJECTED_LOG)
        excuse = "" if record is None else _excuse(record, ended, log)
        if record is not None and excuse:
            trouble, record = f"{record.status}, {excuse}", None
        if record is not None and not _was_injected(setup.setting, record, injected):
            _refuse_unreached(setup.setting, injected)
            trouble, record = f"{record.status}, but nothing tells that {str(setup.setting)!r} was injected", None
        if record is not None:
            _keep(run_folder, route)
            shutil.rmtree(run_folder.work(route), ignore_errors=True)
            return DrivenRoute(route, record, tuple(troubles), injected, wall_s)
        _refuse_hopeless(ended, log)
        troubles.append(f"{trouble} (see {log})")
    shutil.rmtree(run_folder.work(route), ignore_errors=True)
    return DrivenRoute(route, None, tuple(troubles), {}, wall_s)


def read_finished(run_folder: RunFolder, route: str, setting: Setting) -> DrivenRoute | None:
    """Return an earlier run's result of a route, None if there is none. Raises `UsageError` for a damaged file."""
    path = run_folder.result(route)
    if not path.is_file():
        return None
    record, trouble = _record_in(path, route, Attempt(0, "", 0.0))
    injected = _injected(run_folder.injected(route))
    if record is not None and not _was_injected(setting, record, injected):
        told = f"{str(run_folder.injected(route))!r} does not tell that {str(setting)!r} was injected"
        trouble, record = told, None
    if record is None:
        raise UsageError(f"{str(path)!r} is not a finished result: {trouble}. Remove it to drive the route again.")
    return DrivenRoute(route, record, (), injected, record.wall_s)


def _digest(path: Path) -> str:
    return hashlib.blake2b(path.read_bytes(), digest_size=8).hexdigest()


def _stamp(path: Path) -> str:
    """Return size and time of a file, or of all files in a folder: weights are too large to read each time."""
    try:
        if path.is_dir():
            files = sorted(file for file in path.rglob("*") if file.is_file() and "__pycache__" not in file.parts)
            return "\n".join(f"{file.relative_to(path)}: {_stamp(file)}" for file in files)
        status = path.stat()
    except OSError:
        return ""
    return f"{status.st_size} bytes of {status.st_mtime_ns}" if path.is_file() else ""


def _asked_environment(setup: EvaluatorSetup) -> dict[str, str]:
    """Return our environment variables that the agent may read, without those that we set for the evaluator."""
    given = {*setup.checkout.environment({}), *_own_variables(setup, Path(), RunFolder(Path()))}
    asked = (asked_variables(setup.agent) | {PLANNER_TYPE}) - given
    return {name: os.environ.get(name, "") for name in sorted(asked)}


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
            _command(setup, route, work, port=port, traffic_port=traffic_port),
            environment={**setup.checkout.environment(os.environ), **_own_variables(setup, work, run_folder)},
            folder=setup.checkout.root,  # the evaluator reads files by paths relative to the checkout
            log=log,
            patience=setup.patience,
            stop=stop,
        )


def _command(setup: EvaluatorSetup, route: str, work: Path, *, port: int, traffic_port: int) -> list[str]:
    return [
        setup.checkout.python,
        str(_INJECT),
        str(setup.checkout.evaluator),
        f"--routes={setup.routes}",
        f"--routes-subset={route}",
        "--repetitions=1",
        "--track=SENSORS",
        f"--checkpoint={work / 'result.json'}",
        f"--debug-checkpoint={work / 'live.txt'}",
        f"--agent={setup.agent}",
        f"--agent-config={setup.config}",
        "--debug=0",
        "--record=",
        f"--port={port}",
        f"--traffic-manager-port={traffic_port}",
        f"--traffic-manager-seed={setup.seed}",
        f"--gpu-rank={setup.gpu}",
    ]


def _own_variables(setup: EvaluatorSetup, work: Path, run_folder: RunFolder) -> dict[str, str]:
    return {
        "CUDA_VISIBLE_DEVICES": str(setup.gpu),  # as the official script has it; CARLA gets --gpu-rank
        "PDR_SETTING": setting_as_json(setup.setting, seed=setup.seed, log=str(work / _INJECTED_LOG)),
        "PDR_LOG": "",
        "ROUTES": str(setup.routes),
        "TEAM_AGENT": str(setup.agent),
        "TEAM_CONFIG": setup.config,
        "CHECKPOINT_ENDPOINT": str(work / "result.json"),
        "SAVE_PATH": str(run_folder.results),
    }


def setting_as_json(setting: Setting, *, seed: int, log: str = "") -> str:
    """Return the value of `PDR_SETTING`, which `inject.py` reads in another Python.

    `log` is the file for the injected schedule, `""` for none. Raises `PerturbationError` for a perturbation that is
    not part of this package: the other Python does not know its code.
    """
    names = {cls: name for name, cls in BUILTIN.items()}
    foreign = [item for item in setting.perturbations if type(item) not in names]
    if foreign:
        raise PerturbationError(
            f"{str(foreign[0])!r} ({type(foreign[0]).__name__}) cannot be injected into the official evaluator, which "
            f"runs in another Python. The perturbations that can: {', '.join(sorted(BUILTIN))}."
        )
    stack = [{"name": names[type(item)], "parameters": item.parameters()} for item in setting.perturbations]
    document = {"seed": seed, "dt_s": TICK_S, "setting": str(setting), "log": log, "stack": stack}
    return json.dumps(document, allow_nan=False)


def _record_in(path: Path, route: str, ended: Attempt) -> tuple[OfficialRecord | None, str]:
    """Return the record and an empty text, or None and why there is no record that tells about the agent."""
    told = ended.trouble or f"the evaluator ended with exit code {ended.code}"
    if not path.is_file() or path.stat().st_size == 0:
        return None, f"{told} and wrote no result"
    try:
        records = [record for record in read_results(path).records if record.route == route]
    except UsageError as error:
        return None, f"{told}: {str(error).replace(shown(path), 'its result')}"  # that file is removed
    if len(records) != 1:
        return None, f"{told} with {len(records)} records of the route, expected one"
    (record,) = records
    if record.is_harness_error:
        return None, f"{told}: {record.status}"
    return record, ""


def _excuse(record: OfficialRecord, ended: Attempt, log: Path) -> str:
    """Return why an agent error says nothing about the agent; empty where it does.

    The agent called a dead server, or the machine ran out of memory, disk, files or threads.
    """
    if STATUSES[record.status][0] is not Outcome.AGENT_ERROR:
        return ""
    told = log.read_text(encoding="utf-8", errors="replace")
    found = _RAN_OUT.search(told)
    if found:
        return f"for want of memory, room on a disk, files or threads ({found[1]})"
    return "after the CARLA server was lost" if ended.trouble or _SERVER_LOST in told else ""


def _keep(run_folder: RunFolder, route: str) -> None:
    """Keep the files of a try. Move the result last: a route with a result counts as finished."""
    log = run_folder.work(route) / _INJECTED_LOG
    if log.is_file():
        os.replace(log, run_folder.injected(route))
    else:
        run_folder.injected(route).unlink(missing_ok=True)  # the log of the result that is replaced
    os.replace(run_folder.work(route) / "result.json", run_folder.result(route))


def _injected(path: Path) -> Mapping[str, object]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
        told = json.loads(lines[-1]) if lines else {}
    except (OSError, ValueError):
        return {}
    return told if isinstance(told, dict) else {}


def _was_injected(setting: Setting, record: OfficialRecord, injected: Mapping[str, object]) -> bool:
    """Return True if the setting is clean, or it reached the agent, or the agent broke, perhaps before a first tick."""
    broke = STATUSES[record.status][0] is Outcome.AGENT_ERROR
    return setting.is_clean or broke or bool(injected.get("injected_ticks"))


def _refuse_unreached(setting: Setting, injected: Mapping[str, object]) -> None:
    """Raise `UsageError` if the agent drove without the injection: another try would end the same."""
    if injected.get("ticks"):
        raise UsageError(
            f"the agent drove {injected['ticks']} ticks and read no sensors through the evaluator's SensorInterface: "
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
