"""What people get: the sdists and wheels of both distributions, and a drive with them alone, outside the repository.

The dependencies come of the environment of these tests; `nox -s wheels` does it in an empty one.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tarfile
import venv
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from email.parser import HeaderParser
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROJECTS = {"pytest_drive_robust": ROOT, "drive_robust_agents": ROOT / "agents"}
pytestmark = pytest.mark.slow


@dataclass(frozen=True)
class Built:
    """What a project became: the names in its sdist and its wheel, without the top folder of the sdist."""

    wheel: Path
    in_sdist: frozenset[str]
    in_wheel: frozenset[str]
    metadata: str

    @property
    def version(self) -> str:
        return str(HeaderParser().parsestr(self.metadata)["Version"])


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Built]:
    folder = tmp_path_factory.mktemp("dist")
    return {name: build(name, project, folder / name) for name, project in PROJECTS.items()}


def build(name: str, project: Path, folder: Path) -> Built:
    done = subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-d", str(folder)],
        cwd=project, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    (wheel,), (sdist,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        in_sdist = frozenset(member.name.partition("/")[2] for member in archive if member.isfile())
    with zipfile.ZipFile(wheel) as archive:
        in_wheel = frozenset(archive.namelist())
        about = next(name for name in in_wheel if name.endswith(".dist-info/METADATA"))
        return Built(wheel, in_sdist, in_wheel, archive.read(about).decode())


@pytest.fixture(scope="module")
def elsewhere(built: dict[str, Built], tmp_path_factory: pytest.TempPathFactory) -> Callable[..., str]:
    """Run a command of an environment that has the wheels, in a folder far from the repository; return its output."""
    home = tmp_path_factory.mktemp("environment")
    venv.create(home, with_pip=False)
    bin_folder = home / ("Scripts" if os.name == "nt" else "bin")
    packages = next(home.glob("**/site-packages"))
    dependencies = [path for path in sys.path if Path(path).name in ("site-packages", "dist-packages")]
    # Where a .pth file names a folder, the .pth files there are not read: our editable install is not found.
    (packages / "dependencies.pth").write_text("\n".join(dependencies) + "\n")
    wheels = [str(item.wheel) for item in built.values()]
    installing = [sys.executable, "-m", "pip", "--python", str(bin_folder / "python"), "install", "-q", "--no-deps"]
    subprocess.run([*installing, "--no-index", *wheels], check=True)
    place = tmp_path_factory.mktemp("place")
    left_out = ("PYTEST_", "COV_", "PYTHONPATH", "GITHUB_")
    environ = {name: value for name, value in os.environ.items() if not name.startswith(left_out)}

    def run(program: str, *words: str) -> str:
        # The scripts of the dependencies name another Python.
        command = [bin_folder / "python", "-m", "pytest"] if program == "pytest" else [bin_folder / program]
        done = subprocess.run([*command, *words], cwd=place, env=environ, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    return run


@pytest.mark.parametrize("name", PROJECTS)
def test_a_wheel_has_all_of_the_package_and_nothing_else(name: str, built: dict[str, Built]) -> None:
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard", name],
        cwd=PROJECTS[name], capture_output=True, text=True, check=False,
    )  # fmt: skip
    files = set(listed.stdout.split("\n")) - {""} or {
        path.relative_to(PROJECTS[name]).as_posix()
        for path in (PROJECTS[name] / name).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    packed = {path for path in built[name].in_wheel if not path.startswith(f"{name}-")}
    assert packed == files
    assert {path for path in built[name].in_sdist if path.startswith(f"{name}/")} == files
    assert {Path(path).name for path in built[name].in_wheel if ".dist-info/licenses/" in path} == {"LICENSE"}


def test_an_sdist_has_beside_the_package_what_one_builds_and_reads(built: dict[str, Built]) -> None:
    beside = {name: {p for p in item.in_sdist if not p.startswith(f"{name}/")} for name, item in built.items()}
    both = {".gitignore", "LICENSE", "PKG-INFO", "README.md", "pyproject.toml"}
    assert beside["pytest_drive_robust"] == {*both, "CHANGELOG.md", "CITATION.cff"}
    assert beside["drive_robust_agents"] == both


def test_both_distributions_have_one_version(built: dict[str, Built], elsewhere: Callable[..., str]) -> None:
    (version,) = {item.version for item in built.values()}
    assert elsewhere("drive-robust", "--version").split() == ["drive-robust", version]
    assert f"drive-robust-agents {version}" in elsewhere("drive-robust", "list", "agents")


def test_the_smoke_suite_and_a_starter_suite_drive_outside(elsewhere: Callable[..., str]) -> None:
    place = Path(elsewhere("python", "-c", "import os; print(os.getcwd())").strip())
    shutil.copytree(ROOT / "suites" / "smoke", place / "smoke")
    elsewhere("drive-robust", "init", "--suite", "minimal")
    asked = "import pytest_drive_robust as p, drive_robust_agents as a; print(p.__file__, a.__file__)"
    assert str(ROOT) not in elsewhere("python", "-c", asked)
    point = ("--drive-robust", "--drive-verdict=point", "--drive-routes=601")
    assert "4 passed" in elsewhere("pytest", *point, "smoke")
    # with weights, and with the pages of a report
    assert "3 passed" in elsewhere("pytest", *point, "robustness", "--drive-agent=tcp", "--drive-report=report")
    assert (place / "report" / "index.html").is_file()
