"""How the official evaluator is started: its command, its environment, and everything that decides its results."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass
from pathlib import Path

from pytest_drive_robust.bench2drive.asked_variables import PLANNER_TYPE, asked_variables
from pytest_drive_robust.bench2drive.evaluator.attempt import Patience
from pytest_drive_robust.bench2drive.evaluator.checkout import Checkout
from pytest_drive_robust.bench2drive.evaluator.code_around import code_around
from pytest_drive_robust.bench2drive.evaluator.doctor import carla_version
from pytest_drive_robust.bench2drive.evaluator.run_folder import RunFolder
from pytest_drive_robust.bench2drive.results.motion_log import TICK_S
from pytest_drive_robust.errors import PerturbationError
from pytest_drive_robust.perturbations import BUILTIN, Setting

_INJECT = Path(__file__).with_name("inject.py")
INJECTED_LOG = "injected.jsonl"
"""The log of `inject.py` about the injection, beside the result of a try."""


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


def evaluator_command(setup: EvaluatorSetup, route: str, work: Path, *, port: int, traffic_port: int) -> list[str]:
    """Return the command that drives one route; `work` is the folder of its result."""
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


def own_variables(setup: EvaluatorSetup, work: Path, run_folder: RunFolder) -> dict[str, str]:
    """Return the environment variables that tell the evaluator, the agent and `inject.py` what to do."""
    return {
        "CUDA_VISIBLE_DEVICES": str(setup.gpu),  # as the official script has it; CARLA gets --gpu-rank
        "PDR_SETTING": setting_as_json(setup.setting, seed=setup.seed, log=str(work / INJECTED_LOG)),
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
    given = {*setup.checkout.environment({}), *own_variables(setup, Path(), RunFolder(Path()))}
    asked = (asked_variables(setup.agent) | {PLANNER_TYPE}) - given
    return {name: os.environ.get(name, "") for name in sorted(asked)}
