# /// script
# dependencies = ["nox>=2024.10.9"]
# ///
"""What is tried beside the tests of a checkout: built wheels, versions of Python and pytest, the site, the benchmarks.

`nox -l` lists the sessions; `CONTRIBUTING.md` says when one runs which.
"""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
from pathlib import Path

import nox

nox.needs_version = ">=2024.10.9"
nox.options.default_venv_backend = "uv|virtualenv"

ROOT = Path(__file__).parent
PYTHONS = ["3.10", "3.11", "3.12", "3.13", "3.14"]
PYTEST = {"oldest": "pytest==8.1.*", "latest": "pytest"}
XDIST = {"off": ["-p", "no:xdist"], "on": ["-n", "2"]}
TOOLS = ["build", "check-wheel-contents", "twine"]
NEEDS = ["av>=13", "hypothesis>=6.100", "jsonschema>=4.20", "mpmath>=1.3", "pandas>=2", "pyarrow>=14", "pyyaml>=6"]
"""What the tests of `FOLDERS` import beside the wheels; torch is not among it."""
FOLDERS = ["tests/unit/options", "tests/unit/stats", "tests/unit/verdict", "tests/plugin", "tests/startup"]
"""What may depend on the versions of Python, pytest and pytest-xdist; others are given after `--`."""
LAID_OUT = ["tests", "suites", "conftest.py", "pyproject.toml", "action.yml", "README.md"]


@nox.session(python=PYTHONS, default=False)
@nox.parametrize("xdist", list(XDIST))
@nox.parametrize("pytest", list(PYTEST))
def tests(session: nox.Session, pytest: str, xdist: str) -> None:
    """Run tests on the built wheels, in a folder where the packages themselves are not."""
    session.install(*_wheels(session), PYTEST[pytest], *NEEDS)
    place = _outside()
    for name in LAID_OUT:
        source, target = ROOT / name, place / name
        if source.is_dir():
            shutil.copytree(source, target)
        else:
            shutil.copy(source, target)
    session.chdir(place)
    session.run("python", "-c", "import pytest_drive_robust as p; assert 'site-packages' in p.__file__, p.__file__")
    session.run("pytest", "-m", "not slow", *XDIST[xdist], *(session.posargs or FOLDERS))


@nox.session(python=PYTHONS)
def wheels(session: nox.Session) -> None:
    """Drive out of an environment that has the built wheels and nothing else, in an empty folder."""
    session.install(*_wheels(session))
    place = _outside()
    shutil.copytree(ROOT / "suites" / "smoke", place / "smoke")
    session.chdir(place)
    session.run("drive-robust", "--version")
    session.run("drive-robust", "init", "--suite", "minimal", "--ci", "github")
    executor = () if hasattr(os, "fork") else ("--drive-executor", "inline")
    session.run("pytest", "--drive-robust", "smoke", *executor)
    session.run("pytest", "--drive-robust", "robustness", *executor, "--drive-report", "drive-report")
    session.run("drive-robust", "replay", "601", "--agent", "blind", "--no-video")
    for agent in ("tcp", "simlingo", "uniad", "vad"):  # their weights travel with them
        session.run("drive-robust", "replay", "601", "--agent", agent, "--tick-cap", "60", "--no-video")


@nox.session(python="3.12")
def docs(session: nox.Session) -> None:
    """Build the site; a warning is an error."""
    session.install("-e", ".[docs]", "-e", "agents")
    session.run("sphinx-build", "-W", "-n", "-b", "html", "docs", "build/site", *session.posargs)


@nox.session(python="3.12", default=False)
def benchmarks(session: nox.Session) -> None:
    """Run the quick benchmarks; with `-- whole` those too that take minutes and want an idle machine."""
    session.install(*_wheels(session))
    scripts = ["ticks", "cameras"]
    if "whole" in session.posargs:
        scripts += ["verdicts", "engine", "regressions"]
    for name in scripts:
        session.run("python", ROOT / "benchmarks" / f"{name}.py")


def _outside() -> Path:
    """Return a new folder that is not below this repository, whose pyproject.toml and conftest.py pytest would find."""
    place = Path(tempfile.mkdtemp(prefix="drive-robust-"))
    atexit.register(shutil.rmtree, place, ignore_errors=True)
    return place


def _wheels(session: nox.Session) -> list[str]:
    """Return the wheels of both distributions: of $DRIVE_ROBUST_WHEELS, or else built and checked now, once a run."""
    given = os.environ.get("DRIVE_ROBUST_WHEELS")
    folder = Path(given).resolve() if given else _built(session)
    found = sorted(str(file) for file in folder.glob("*.whl"))
    if len(found) != 2:
        session.error(f"expected the wheels of both distributions in {folder}, found {found}")
    return found


_BUILT: list[Path] = []


def _built(session: nox.Session) -> Path:
    """Build both distributions into `build/wheels`, the wheel of each out of its sdist, and check what they hold."""
    if not _BUILT:
        folder = ROOT / "build" / "wheels"
        shutil.rmtree(folder, ignore_errors=True)
        session.run("python", "-m", "venv", "--clear", ROOT / "build" / "tools")
        tools = ROOT / "build" / "tools" / ("Scripts" if os.name == "nt" else "bin")
        session.run(tools / "python", "-m", "pip", "install", "-q", *TOOLS, external=True)
        for project in (".", "agents"):
            session.run(tools / "python", "-m", "build", "-q", "--outdir", folder, ROOT / project, external=True)
        session.run(tools / "twine", "check", "--strict", *folder.iterdir(), external=True)
        session.run(tools / "check-wheel-contents", *folder.glob("*.whl"), external=True)
        _BUILT.append(folder)
    return _BUILT[0]


if __name__ == "__main__":
    nox.main()
