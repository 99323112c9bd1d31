"""What the evaluator gets from us: paths, variables, and the client of CARLA that fits its Python."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from fake_bench2drive import make

from pytest_drive_robust.bench2drive.evaluator.checkout import Checkout

EGGS = ("carla-0.9.15-py2.7-linux-x86_64.egg", "carla-0.9.15-py3.7-linux-x86_64.egg")


def interpreter(folder: Path, version: str) -> Path:
    """Write what answers like a Python of this version: `"3 7"`."""
    path = folder / f"python{version.replace(' ', '.')}"
    path.write_text(f"#!/bin/sh\necho {version}\n")
    path.chmod(0o755)
    return path


@pytest.mark.skipif(sys.platform == "win32", reason="CARLA's evaluator is started on Linux")
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
