"""Who imports whom in the room of perturbations, which contributors copy."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

from pytest_drive_robust import perturbations

_ROOM = Path(perturbations.__file__).parent


def test_perturbations_and_their_sentences_load_nothing_heavy() -> None:
    code = (
        "import sys, pytest_drive_robust.perturbations as p;"
        "s = p.Setting.parse('200 ms latency and occlusion 0.5 (fill=blur) and 1 s burst frame drop'); str(s);"
        "p.Setting.from_env({'ROBUSTNESS_ENABLE': '1'});"
        "heavy = {'numpy', 'cv2', 'torch', 'scipy', 'numba', 'gymnasium', 'highway_env', 'rich', 'pytest'};"
        "print(sorted(heavy & set(sys.modules)))"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, check=True, text=True)
    assert done.stdout.strip() == "[]"


def test_imports_form_a_straight_line_even_those_for_types_and_within_functions() -> None:
    graph = {path.stem: _imported(path) for path in _ROOM.glob("*.py") if path.stem != "__init__"}
    order = list(TopologicalSorter(graph).static_order())  # raises CycleError
    failures = {cls.__module__.rpartition(".")[2] for cls in perturbations.BUILTIN.values()}
    assert not {name for failure in failures for name in graph[failure]} & failures
    assert all(order.index("base") < order.index(failure) for failure in failures)


def _imported(path: Path) -> set[str]:
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    modules = {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)}
    own = f"{perturbations.__name__}."
    assert perturbations.__name__ not in modules, "a module of the room imports the room's door"
    return {module.removeprefix(own) for module in modules if module.startswith(own)}
