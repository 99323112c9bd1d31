"""What the evaluator gets from us: paths, variables, and the client of CARLA that fits its Python."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from fake_bench2drive import make

from pytest_drive_robust.bench2drive.evaluator.checkout import Checkout
from pytest_drive_robust.bench2drive.evaluator.doctor import examine
from pytest_drive_robust.errors import UsageError

EGGS = ("carla-0.9.15-py2.7-linux-x86_64.egg", "carla-0.9.15-py3.7-linux-x86_64.egg")


def interpreter(folder: Path, version: str) -> Path:
    """Write what answers like a Python of this version: `"3 7"`."""
    path = folder / f"python{version.replace(' ', '.')}"
    path.write_text(f"#!/bin/sh\necho {version}\n")
    path.chmod(0o755)
    return path


pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="CARLA's evaluator is started on Linux")


def test_without_a_carla_the_advice_can_be_followed_in_pytest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CARLA_ROOT", raising=False)
    with pytest.raises(
        UsageError, match=r"CARLA_ROOT is not set\. Set it to the folder of CARLA.* also takes --carla-root"
    ):
        Checkout.find(make(tmp_path)[0])


@pytest.mark.parametrize("name", ["my games", "carla (0.9.15)", "it's"])
def test_a_carla_that_the_evaluators_shell_would_not_find_is_refused(tmp_path: Path, name: str) -> None:
    root, carla, _ = make(tmp_path)
    carla = carla.rename(tmp_path / name)
    told = "the evaluator starts CARLA by a shell, which breaks"
    with pytest.raises(UsageError, match=f"{told}.*Move CARLA"):
        Checkout.find(root, carla_root=carla)
    (server,) = (check for check in examine(root, carla_root=carla) if check.name == "server")
    assert server.ok is False
    assert told in server.found


@pytest.mark.parametrize(
    ("version", "eggs"), [("3 7", EGGS[1:]), ("3 8", EGGS[1:]), ("3 10", ()), ("2 7", ()), ("no version", ())]
)
def test_only_the_egg_that_fits_the_evaluators_python_is_on_its_path(
    tmp_path: Path, version: str, eggs: tuple[str, ...]
) -> None:
    root, carla, _ = make(tmp_path)
    dist = carla / "PythonAPI/carla/dist"
    dist.mkdir(parents=True)
    for name in EGGS:
        (dist / name).write_text("")
    checkout = Checkout.find(root, carla_root=carla, python=str(interpreter(tmp_path, version)))
    path = checkout.environment({})["PYTHONPATH"].split(os.pathsep)
    assert [Path(entry).name for entry in path if entry.endswith(".egg")] == list(eggs)


@pytest.mark.parametrize(
    ("version", "parser", "message"),
    [
        ("3 8", "for item in scenario.getchildren():", ""),
        ("3 9", "for item in list(scenario):", ""),
        ("3 9", "for item in scenario.getchildren():", "Python 3.9, but .*route_parser.py.* calls getchildren"),
        ("no version", "", "--drive-b2d-python is .* does not start as a Python"),
    ],
)
def test_a_python_that_the_checkout_cannot_run_in_is_refused(
    tmp_path: Path, version: str, parser: str, message: str
) -> None:
    root, carla, _ = make(tmp_path)
    (root / "leaderboard/leaderboard/utils").mkdir()
    (root / "leaderboard/leaderboard/utils/route_parser.py").write_text(parser)
    checkout = Checkout.find(root, carla_root=carla, python=str(interpreter(tmp_path, version)))
    if message:
        with pytest.raises(UsageError, match=message):
            checkout.require_python("--drive-b2d-python")
    else:
        checkout.require_python("--drive-b2d-python")


def test_the_interpreter_of_an_environment_is_found_from_any_folder_and_stays_a_link(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root, carla, _ = make(tmp_path)
    (tmp_path / "env").mkdir()
    link = tmp_path / "env" / "python"
    link.symlink_to(interpreter(tmp_path, "3 7"))
    monkeypatch.chdir(tmp_path)
    assert Checkout.find(root, carla_root=carla, python="env/python").python == str(link)
    monkeypatch.setenv("PATH", str(tmp_path / "env"), prepend=os.pathsep)
    assert Checkout.find(root, carla_root=carla, python="python").python == str(link)
