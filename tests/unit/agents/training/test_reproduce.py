"""`reproduce`: one command from nothing to weights, made of the commands that a user would give one by one."""

# ruff: noqa: E402 - without torch, which is an extra, these tests are skipped before the imports that need it

from __future__ import annotations

import argparse
import json
from pathlib import Path

import pytest

torch = pytest.importorskip("torch")
from drive_robust_agents._nets.tcp import TcpNet
from drive_robust_agents._nets.torch_weights import load
from drive_robust_agents.training.__main__ import main
from drive_robust_agents.training.reproduce import CURRICULA, add_arguments, commands


def asked(*arguments: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return parser.parse_args(["--agent", "tcp", *arguments])


def evaluated(run: Path, best: int) -> None:
    run.mkdir(parents=True)
    files = [f"weights/{step}/tcp.safetensors" for step in (6, 8, 10)]
    (run / "evaluation.json").write_text(json.dumps({"best": best, "candidates": [{"file": file} for file in files]}))


def test_a_round_of_dagger_begins_with_what_drove_best_and_learns_from_all_frames(tmp_path: Path) -> None:
    steps = commands(asked("--out", str(tmp_path), "--workers", "3"))
    first = [next(steps) for _ in range(3)]
    assert [step[0] for step in first] == ["collect", "train", "evaluate"]
    assert first[0][first[0].index("--routes") + 1] == "440"
    evaluated(tmp_path / "run0", best=1)
    collect, train, _ = steps
    best = str(tmp_path / "run0" / "weights" / "8" / "tcp.safetensors")
    assert collect[collect.index("--dagger") + 1] == train[train.index("--start") + 1] == best
    assert train[train.index("--frames") + 1 : train.index("--visits")] == [
        str(tmp_path / "expert"), str(tmp_path / "dagger1")
    ]  # fmt: skip


def test_the_curriculum_is_the_one_that_the_manifest_of_the_shipped_weights_tells() -> None:
    """Steps, rate and number of folders of the last round."""
    _, entry = load("tcp", TcpNet.build)
    told, last = entry.provenance["trainer"], CURRICULA["tcp"].rounds[-1]
    assert told["steps"] == round(last.visits / told["batch"])
    assert told["lr"] == last.lr
    assert len(told["frames"]) == 1 + len(CURRICULA["tcp"].rounds)


def test_a_share_that_is_none_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main(["reproduce", "--agent", "tcp", "--out", str(tmp_path), "--share", "0"])
    assert left.value.code == 4
    assert "--share is 0.0, expected more than 0" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.usefixtures("whole_study")
def test_one_command_makes_weights_that_drive(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--agent", "tcp", "--out", str(tmp_path), "--share", "0.0035", "--routes", "901", "--workers", "1"]
    assert main(["reproduce", *arguments]) == 0
    said = capsys.readouterr().out
    best = Path(said.rpartition("the best weights: ")[2].strip())
    assert best.is_relative_to(tmp_path / "run1")
    _, entry = load("tcp", TcpNet.build, weights=best)
    told = entry.provenance["trainer"]
    assert told["frames"] == ["expert", "dagger1"]
    seeds = [(drawn["route_seed"], drawn["data_seed"], drawn["expert_share"]) for drawn in told["drawn"]]
    assert seeds == [(1, 0, 1.0), (2, 0, 0.5)]
    assert str(tmp_path) not in str(entry.provenance)
    before = best.read_bytes()
    assert main(["reproduce", *arguments]) == 0
    assert best.read_bytes() == before
