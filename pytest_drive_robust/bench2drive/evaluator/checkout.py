"""The user's Bench2Drive checkout and CARLA: where everything is, and the environment that evaluators expect."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from pytest_drive_robust.errors import UsageError

EVALUATOR = Path("leaderboard/leaderboard/leaderboard_evaluator.py")
_ROUTES = Path("leaderboard/data/bench2drive220.xml")
SERVER = "CarlaUE4.sh"
_EGG_PYTHONS = ((3, 7), (3, 8))
_GETCHILDREN = ".getchildren("
NO_GETCHILDREN = (3, 9)
"""The first Python whose XML elements lack `getchildren()`."""
_TIMEOUT_S = 60.0


@dataclass(frozen=True, slots=True)
class Checkout:
    """Absolute paths of a checkout. `python` is the interpreter of the agent's environment, not necessarily ours."""

    root: Path
    carla_root: Path
    python: str = sys.executable

    @classmethod
    def find(cls, root: Path, *, carla_root: Path | None = None, python: str = "") -> Checkout:
        """Return the checkout in `root`, with the CARLA in `carla_root` or the variable `CARLA_ROOT`.

        Raises `UsageError` that says what is missing.
        """
        if not (root / EVALUATOR).is_file():
            raise UsageError(
                f"{str(root)!r} is no Bench2Drive checkout: there is no {EVALUATOR}. Expected a clone of "
                "github.com/Thinklab-SJTU/Bench2Drive."
            )
        given = carla_root or named_carla()
        if given is None:
            raise UsageError(
                "CARLA_ROOT is not set. Set it to the folder of CARLA, which holds CarlaUE4.sh; a command line without "
                "pytest also takes --carla-root."
            )
        if not (given / SERVER).is_file():
            raise UsageError(f"{str(given)!r} is no CARLA: there is no {SERVER}. Bench2Drive needs CARLA 0.9.15.")
        told = shell_trouble(given)
        if told:
            raise UsageError(f"{told}. Move CARLA to a folder whose path has no such character.")
        return cls(root.resolve(), given.resolve(), _absolute(python) if python else sys.executable)

    @property
    def evaluator(self) -> Path:
        """The script that drives routes."""
        return self.root / EVALUATOR

    @property
    def routes(self) -> Path:
        """The official 220 routes."""
        return self.root / _ROUTES

    @property
    def python_version(self) -> tuple[int, int] | None:
        """The version of `python`, as in (3, 7); None when `python` cannot be started."""
        return _version_of(self.python)

    @property
    def getchildren_files(self) -> tuple[Path, ...]:
        """The files of the leaderboard that call `getchildren()`, which Python 3.9 removed from XML elements."""
        files = sorted((self.root / "leaderboard" / "leaderboard").rglob("*.py"))
        return tuple(file for file in files if _GETCHILDREN in file.read_text(encoding="utf-8", errors="replace"))

    def require_python(self, flag: str) -> None:
        """Raise `UsageError` when `python`, which the option `flag` names, cannot run the evaluator."""
        version = self.python_version
        if version is None:
            raise UsageError(
                f"{flag} is {self.python!r}, which does not start as a Python; expected the interpreter of the agent's "
                f"environment, as in {flag} ENV/bin/python."
            )
        if version >= NO_GETCHILDREN and self.getchildren_files:
            raise UsageError(
                f"the evaluator would run in {self.python!r}, Python {version[0]}.{version[1]}, but "
                f"{str(self.getchildren_files[0])!r} calls getchildren(), which Python 3.9 removed. Give {flag} a "
                "Python 3.7 or 3.8, or replace x.getchildren() by list(x) in the checkout."
            )

    @property
    def eggs(self) -> tuple[Path, ...]:
        """The eggs of CARLA's own client for the evaluator's Python; empty where a wheel has to be installed.

        CARLA also ships eggs for other versions, such as Python 2.7. On the path, such an egg would hide every client
        that works. The official scripts use the egg for 3.7 with 3.8 as well.
        """
        if self.python_version not in _EGG_PYTHONS:
            return ()
        return tuple(sorted((self.carla_root / "PythonAPI" / "carla" / "dist").glob("carla-*-py3.7-linux*.egg")))

    def environment(self, inherited: Mapping[str, str]) -> dict[str, str]:
        """Return `inherited` with the variables of the official start script (Bench2Drive `run_evaluation.sh`).

        The script's `PYTHONPATH` begins with an empty entry, which means the root: agents import `Bench2DriveZoo` and
        `TCP` from there.
        """
        api = self.carla_root / "PythonAPI"
        paths = [self.root, api, api / "carla", *self.eggs]
        paths += [self.root / name for name in ("leaderboard", "leaderboard/team_code", "team_code", "scenario_runner")]
        before = inherited.get("PYTHONPATH", "")
        return {
            **inherited,
            "CARLA_ROOT": str(self.carla_root),
            "CARLA_SERVER": str(self.carla_root / SERVER),
            "LEADERBOARD_ROOT": str(self.root / "leaderboard"),
            "SCENARIO_RUNNER_ROOT": str(self.root / "scenario_runner"),
            "CHALLENGE_TRACK_CODENAME": "SENSORS",
            "IS_BENCH2DRIVE": "True",
            "PYTHONPATH": os.pathsep.join([*([before] if before else []), *map(str, paths)]),
            "PYTHONUNBUFFERED": "1",
        }


def shell_trouble(carla_root: Path) -> str:
    """Return in a clause why a shell, which gets this path unquoted, cannot start the server there; else empty."""
    folder = str(carla_root.resolve())
    found = re.search(r"[^\w@%+=:,./-]", folder)
    return f"the evaluator starts CARLA by a shell, which breaks {folder!r} at {found[0]!r}" if found else ""


def named_carla() -> Path | None:
    """Return the folder that the variable `CARLA_ROOT` names, None where it is unset or empty."""
    return Path(os.environ["CARLA_ROOT"]) if os.environ.get("CARLA_ROOT") else None


def _absolute(python: str) -> str:
    """Return the absolute path of an interpreter or of a command on `PATH`: the evaluator runs in another folder.

    Links are not resolved: by the link in a virtual environment, Python finds the packages of this environment.
    """
    found = shutil.which(python) or python
    return os.path.abspath(found) if os.path.dirname(found) else found


@cache
def _version_of(python: str) -> tuple[int, int] | None:
    """Return the version of an interpreter, None if it does not start. Cached: it is started once for the whole run."""
    if python == sys.executable:
        return sys.version_info[:2]
    try:
        told = subprocess.run(
            [python, "-c", "import sys; print(*sys.version_info[:2])"],
            stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=_TIMEOUT_S, check=True,
        ).stdout.split()  # fmt: skip
        major, minor = (int(word) for word in told[-2:])
    except (OSError, subprocess.SubprocessError, ValueError):
        return None
    return major, minor
