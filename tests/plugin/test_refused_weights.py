"""Weights of a learned agent that are not what their manifest says: exit code 4, every one told, nothing driven.

What is refused and why, case by case: `unit/agents/test_weight_loading.py`. ExpertMoment it is the run of a user.
"""

# ruff: noqa: E402 - without torch, which is an extra, these tests are skipped before the imports that need it

from __future__ import annotations

import functools
import hashlib
import itertools
import json
import os
import pickle
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

torch = pytest.importorskip("torch")

from drive_robust_agents.training.loop.export import write_weights
from drive_robust_agents.training.loop.trainer import TrainingOptions
from drive_robust_agents.training.recipes.recipe import RECIPES, recipe_of
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


def new_weights(agent: str, folder: Path, *, seed: int = 0) -> Path:
    """What a training that had no time would publish."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in published(agent, seed).items():
        (folder / name).write_bytes(content)
    return folder / f"{agent}.safetensors"


@functools.cache
def published(agent: str, seed: int) -> Mapping[str, bytes]:
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    options = TrainingOptions(agent, steps=1, batch=4, lr=1e-3, weight_decay=0.0, clip=1.0)
    with tempfile.TemporaryDirectory() as folder:
        write_weights(recipe_of(agent).make(), Path(folder), options=options, step=0)
        return {file.name: file.read_bytes() for file in Path(folder).iterdir()}


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


def spoil(file: Path, damage: str, trace: Path) -> str:
    """Damage new weights, and give what a run must say of them."""
    agent, content, sha256 = file.stem, file.read_bytes(), listed(file)["sha256"]
    if damage == "changed":
        file.write_bytes(content[:-7] + bytes([content[-7] ^ 1]) + content[-6:])
        return f"{file} has SHA-256 {hashlib.sha256(file.read_bytes()).hexdigest()}, the manifest says {sha256}"
    if damage == "truncated":
        file.write_bytes(content[:-100])
        return f"{file} has {len(content) - 100} bytes, expected {len(content)}"
    if damage == "of another":
        foreign = new_weights(OTHERS[agent], file.parent / "foreign")
        told = listed(foreign)
        relist(file, foreign.read_bytes(), architecture=told["architecture"], spec=told["spec"])
        expected: Any = default_registry().entry("agents", agent).load()
        own = expected.architecture.partition(":")[2]
        return f"{file} holds weights of {told['architecture']}, expected those of {own}"
    if damage.startswith("graph"):
        graph = file.with_suffix(".onnx")
        whole = graph.read_bytes()
        changed = whole[:-7] + bytes([whole[-7] ^ 1]) + whole[-6:]
        graph.write_bytes(whole[:-100] if damage == "graph truncated" else changed)
        return f"{graph} has {len(whole) - 100} bytes" if damage == "graph truncated" else f"{graph} has SHA-256"
    relist(file, pickle.dumps({"encoder": Trap(trace)}))
    return f"{file} is no safetensors file"


def stored(folder: Path) -> list[Path]:
    return [path for path in (folder / DEFAULT_STORE).rglob("*") if path.is_file()]


def test_what_is_not_as_its_manifest_says_is_refused_before_anything_is_driven(suite, driven, pytester) -> None:
    trace, sentences = pytester.path / "executed", {}
    for number, (agent, damage) in enumerate(itertools.product(sorted(RECIPES), DAMAGES)):
        file = new_weights(agent, pytester.path / str(number))
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
    for seed, episodes in ((0, 3), (1, 6)):
        new_weights("tcp", pytester.path / "mine", seed=seed)
        result = pytester.runpytest_subprocess("--drive-robust", *CANDIDATES)
        assert result.ret in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED)  # it never learnt anything
        assert len(driven()) == episodes
        assert len(stored(pytester.path)) >= episodes
