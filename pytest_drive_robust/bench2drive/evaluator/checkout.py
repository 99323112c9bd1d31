"""The user's Bench2Drive checkout and CARLA: where everything is, and the environment that evaluators expect."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pytest_drive_robust.errors import UsageError

_EVALUATOR = Path("leaderboard/leaderboard/leaderboard_evaluator.py")
_ROUTES = Path("leaderboard/data/bench2drive220.xml")
_SERVER = "CarlaUE4.sh"


@dataclass(frozen=True, slots=True)
class Checkout:
    """Absolute paths. `python` is the interpreter that the agent's environment has, not necessarily ours."""

    root: Path
    carla_root: Path
    python: str = sys.executable

    @classmethod
    def find(cls, root: Path, *, carla_root: Path | None = None, python: str = "") -> Checkout:
        """Return the checkout in `root`, with the CARLA in `carla_root` or the variable `CARLA_ROOT`.

        Raises `UsageError` that says what is missing.
        """
        if not (root / _EVALUATOR).is_file():
            raise UsageError(
                f"{str(root)!r} is no Bench2Drive checkout: there is no {_EVALUATOR}. Expected a clone of "
                "github.com/Thinklab-SJTU/Bench2Drive."
            )
        given = carla_root or (Path(os.environ["CARLA_ROOT"]) if os.environ.get("CARLA_ROOT") else None)
        if given is None:
            raise UsageError("Where is CARLA? Set CARLA_ROOT or give --carla-root: the folder that holds CarlaUE4.sh.")
        if not (given / _SERVER).is_file():
            raise UsageError(f"{str(given)!r} is no CARLA: there is no {_SERVER}. Bench2Drive needs CARLA 0.9.15.")
        return cls(root.resolve(), given.resolve(), python or sys.executable)

    @property
    def evaluator(self) -> Path:
        """The script that drives routes."""
        return self.root / _EVALUATOR

    @property
    def routes(self) -> Path:
        """The official 220 routes."""
        return self.root / _ROUTES

    @property
    def eggs(self) -> tuple[Path, ...]:
        """CARLA's own client packages, beside which an installed wheel is needed by nobody."""
        return tuple(sorted((self.carla_root / "PythonAPI" / "carla" / "dist").glob("carla-*linux*.egg")))

    def environment(self, inherited: Mapping[str, str]) -> dict[str, str]:
        """Return what the official start script exports, on top of `inherited` (Bench2Drive `run_evaluation.sh`).

        Its `PYTHONPATH` begins with an empty entry, which is the root: agents import `Bench2DriveZoo` and `TCP` there.
        """
        api = self.carla_root / "PythonAPI"
        paths = [self.root, api, api / "carla", *self.eggs]
        paths += [self.root / name for name in ("leaderboard", "leaderboard/team_code", "team_code", "scenario_runner")]
        before = inherited.get("PYTHONPATH", "")
        return {
            **inherited,
            "CARLA_ROOT": str(self.carla_root),
            "CARLA_SERVER": str(self.carla_root / _SERVER),
            "LEADERBOARD_ROOT": str(self.root / "leaderboard"),
            "SCENARIO_RUNNER_ROOT": str(self.root / "scenario_runner"),
            "CHALLENGE_TRACK_CODENAME": "SENSORS",
            "IS_BENCH2DRIVE": "True",
            "PYTHONPATH": os.pathsep.join([*([before] if before else []), *map(str, paths)]),
            "PYTHONUNBUFFERED": "1",
        }
