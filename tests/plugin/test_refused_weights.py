"""Weights of a learned agent that are not what their manifest says: exit code 4, every one told, nothing driven.

What is refused and why, case by case: `unit/agents/test_weight_loading.py`. ExpertMoment it is the run of a user.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import os
import pickle
import shutil
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("torch")

import drive_robust_agents
from drive_robust_agents.training.recipes.recipe import RECIPES
from pytest_drive_robust.options.run import DEFAULT_STORE
from pytest_drive_robust.registry.registry import default_registry

CANDIDATES = ("-p", "drive_robust_agents.training.candidates")
TESTS = """
import pytest
from pytest_drive_robust import requirement

AGENTS = {agents}


@pytest.mark.parametrize("agent", [pytest.param(one, marks=pytest.mark.drive_robust(agent=one)) for one in AGENTS])
def test_it(drive, agent):
    drive.check(requirement("DS") >= 1)
"""
DAMAGES = ("changed", "truncated", "of another", "a pickle", "graph changed", "graph truncated")
OTHERS = {"simlingo": "tcp", "tcp": "simlingo", "uniad": "tcp", "vad": "tcp"}


def weights_of(agent: str, folder: Path) -> Path:
    """Weights that are right: those that ship."""
    folder.mkdir(parents=True, exist_ok=True)
    shipped = Path(drive_robust_agents.__file__).parent / "weights" / f"{agent}.safetensors"
    entry = listed(shipped)
    for name in (entry["file"], *(graph["file"] for graph in entry["graphs"].values())):
        shutil.copy(shipped.parent / name, folder)
    (folder / "manifest.json").write_text(json.dumps({agent: entry}))
    return folder / shipped.name


def listed(file: Path) -> dict[str, Any]:
    entry: dict[str, Any] = json.loads((file.parent / "manifest.json").read_text())[file.stem]
    return entry


def relist(file: Path, content: bytes, **changes: str | dict[str, Any]) -> None:
    """Other content, on which the manifest agrees."""
    facts = {"sha256": hashlib.sha256(content).hexdigest(), "size_bytes": len(content)}
    (file.parent / "manifest.json").write_text(json.dumps({file.stem: listed(file) | facts | changes}))
    file.write_bytes(content)


class Trap:
    """Leaves a trace when it is unpickled."""

    def __init__(self, trace: Path) -> None:
        self.trace = trace

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, (str(self.trace),)


def changed(content: bytes) -> bytes:
    """The same but for one bit, near the end."""
    return content[:-7] + bytes([content[-7] ^ 1]) + content[-6:]


def spoil(file: Path, damage: str, trace: Path) -> str:
    """Damage new weights, and give what a run must say of them."""
    agent, content, sha256 = file.stem, file.read_bytes(), listed(file)["sha256"]
    if damage == "changed":
        file.write_bytes(changed(content))
        return f"{file} has SHA-256 {hashlib.sha256(file.read_bytes()).hexdigest()}, the manifest says {sha256}"
    if damage == "truncated":
        file.write_bytes(content[:-100])
        return f"{file} has {len(content) - 100} bytes, expected {len(content)}"
    if damage == "of another":
        foreign = weights_of(OTHERS[agent], file.parent / "foreign")
        told = listed(foreign)
        relist(file, foreign.read_bytes(), architecture=told["architecture"], spec=told["spec"])
        expected: Any = default_registry().entry("agents", agent).load()
        own = expected.network_class.partition(":")[2]
        return f"{file} holds weights of {told['architecture']}, expected those of {own}"
    if damage.startswith("graph"):
        graph = file.with_suffix(".onnx")
        whole = graph.read_bytes()
        graph.write_bytes(whole[:-100] if damage == "graph truncated" else changed(whole))
        return f"{graph} has {len(whole) - 100} bytes" if damage == "graph truncated" else f"{graph} has SHA-256"
    relist(file, pickle.dumps({"encoder": Trap(trace)}))
    return f"{file} is no safetensors file"


def stored(folder: Path) -> list[Path]:
    return [path for path in (folder / DEFAULT_STORE).rglob("*") if path.is_file()]


def test_what_is_not_as_its_manifest_says_is_refused_before_anything_is_driven(suite, driven, pytester) -> None:
    trace, sentences = pytester.path / "executed", {}
    for number, (agent, damage) in enumerate(itertools.product(sorted(RECIPES), DAMAGES)):
        file = weights_of(agent, pytester.path / str(number))
        sentences[f"candidate:{agent}={number}/{file.name}"] = spoil(file, damage, trace)
    suite(test=TESTS.format(agents=["steady", *sentences]))
    result = pytester.runpytest_subprocess("--drive-robust", "--drive-json=run.json", *CANDIDATES)
    output = " ".join((result.stdout.str() + result.stderr.str()).split())
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    assert "Traceback" not in output
    for name, sentence in sentences.items():
        told = output.partition(f"test_it[{name}]")[2].partition("test_suite.py::")[0]
        assert sentence in told, name
        assert "give weights of your own with their manifest.json" in told
    assert not trace.exists()
    assert driven() == []
    assert not (pytester.path / "run.json").exists()
    assert stored(pytester.path) == []


def test_weights_that_are_right_are_driven_and_driven_again_when_they_change(suite, driven, pytester) -> None:
    suite(test=TESTS.format(agents=["candidate:tcp=mine/tcp.safetensors"]))
    file = weights_of("tcp", pytester.path / "mine")
    for episodes in (3, 6):
        result = pytester.runpytest_subprocess("--drive-robust", *CANDIDATES)
        assert result.ret in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED)  # it never learnt this world
        assert len(driven()) == episodes
        assert len(stored(pytester.path)) >= episodes
        relist(file, changed(file.read_bytes()))
