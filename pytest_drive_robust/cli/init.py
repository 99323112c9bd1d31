"""`drive-robust init`: write a starter suite, its limits and a workflow into somebody's own repository."""

from __future__ import annotations

import argparse
from importlib.resources import files
from pathlib import Path

from pytest_drive_robust.cli.tables import say
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.store.whole_file import refusing_unwritable, write_whole

_FOLDER = "robustness"
_SUITES = ("paper", "minimal")
_WORKFLOWS = {"github": ".github/workflows/robustness.yml", "gitlab": ".gitlab-ci.yml"}
_DESCRIPTION = """Writes robustness/test_robustness.py with its limits.txt into the current folder, and with --ci the
workflow that drives them. A file that exists is never written over: then nothing is written."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `init`."""
    parser.description = _DESCRIPTION
    parser.add_argument(
        "--suite",
        choices=_SUITES,
        default=_SUITES[0],
        help="paper: the paper's eleven settings; minimal: one setting of each family of failures; default: paper",
    )
    parser.add_argument("--ci", choices=tuple(_WORKFLOWS), help="also write the workflow of this service")
    parser.set_defaults(command=_init)


def _init(options: argparse.Namespace) -> int:
    starter = files(__package__) / "starter"
    wanted = {Path(_FOLDER, "test_robustness.py"): "suite.txt", Path(_FOLDER, "limits.txt"): f"{options.suite}.txt"}
    if options.ci:
        wanted[Path(_WORKFLOWS[options.ci])] = f"{options.ci}.yml"
    there = [str(path) for path in wanted if path.exists() or path.is_symlink()]
    if there:
        raise UsageError(
            f"already here and not written over: {', '.join(there)}. Move what is there, or run in another folder."
        )
    for path in wanted:  # before the first file: after an error here, a written file would stop the next try
        with refusing_unwritable(path):
            path.parent.mkdir(parents=True, exist_ok=True)
    for path, name in wanted.items():
        with refusing_unwritable(path):
            write_whole(path, (starter / name).read_text(encoding="utf-8"))
        say(f"{path}: written")
    if options.ci:
        say("the workflow drives the agent of drive_agent in pytest.ini or pyproject.toml, else the default agent")
        _say_where_it_is_read(Path(_WORKFLOWS[options.ci]))
    say(f"next: pytest --drive-robust {_FOLDER} --drive-agent my_agent:MyAgent --drive-verdict point --drive-save")
    say("then: drive-robust limits --agent my_agent:MyAgent proposes limits that your agent meets, for review")
    return 0


def _say_where_it_is_read(workflow: Path) -> None:
    """Tell somebody who is below the root of a repository that its workflows are read in the root only."""
    here = Path.cwd()
    root = next((folder for folder in (here, *here.parents) if (folder / ".git").exists()), here)
    if root != here:
        say(f"{workflow} is read at the root of the repository only: move it to {root / workflow}")
        say(f"and let its commands run in {here.relative_to(root).as_posix()}, where its paths start")
