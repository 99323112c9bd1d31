"""One sorted public API that costs nothing to import."""

from __future__ import annotations

import importlib
import subprocess
import sys
from types import FunctionType

import pytest

import pytest_drive_robust

HEAVY = ["cv2", "gymnasium", "highway_env", "matplotlib", "numba", "numpy", "pandas", "rich", "scipy", "torch"]


def test_the_names_are_sorted_and_each_is_there_once() -> None:
    names = pytest_drive_robust.__all__
    assert names == sorted(set(names))


@pytest.mark.parametrize("name", pytest_drive_robust.__all__)
def test_every_public_name_resolves_and_is_listed_by_dir(name: str) -> None:
    assert getattr(pytest_drive_robust, name) is not None
    assert name in dir(pytest_drive_robust)


def test_every_public_object_is_public_at_its_home_too() -> None:
    for name in pytest_drive_robust.__all__:
        target = getattr(pytest_drive_robust, name)
        if name != "__version__":
            assert getattr(importlib.import_module(target.__module__), name) is target


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'Cntrol'"):
        pytest_drive_robust.Cntrol  # noqa: B018


def test_requirements_stays_the_function_after_its_subpackage_was_imported() -> None:
    importlib.import_module("pytest_drive_robust.verdict.sentences")
    assert isinstance(pytest_drive_robust.requirement, FunctionType)


@pytest.mark.parametrize(
    "statement",
    [
        "import pytest_drive_robust",
        "from pytest_drive_robust import *",
        "import pytest_drive_robust.registry.registry as r; r.default_registry().perturbations()",
        "import pytest_drive_robust.hookspecs",
        "from pytest_drive_robust import requirements; requirements('RD under 200 ms latency <= 0.30')",
    ],
)
def test_importing_loads_nothing_heavy(statement: str) -> None:
    program = f"import sys\n{statement}\nprint(sorted(set(sys.modules) & set({HEAVY})))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[]"


def test_the_version_is_text() -> None:
    assert isinstance(pytest_drive_robust.__version__, str)
    assert pytest_drive_robust.__version__[0].isdigit()
