"""Whether a plan moves as instructed, and the table of that."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

torch = pytest.importorskip("torch")


from drive_robust_agents._nets.manifest import read_manifest  # noqa: E402
from drive_robust_agents._nets.prompts import Instruction, Kind  # noqa: E402
from drive_robust_agents._nets.weights import SHIPPED  # noqa: E402
from drive_robust_agents.tcp import CAMERAS as TCP_CAMERAS  # noqa: E402
from drive_robust_agents.training.__main__ import main  # noqa: E402
from drive_robust_agents.training.instructions import InstructionScore, obeys, table  # noqa: E402


def plans(waypoint_m: float, aside_m: float = 0.0) -> tuple[NDArray[Any], NDArray[Any]]:
    """A straight path that ends so far to the right, and waypoints so many metres apart."""
    path = np.stack([np.arange(1.0, 21.0), aside_m * np.arange(1.0, 21.0) / 20.0], axis=1)
    return path, np.stack([waypoint_m * np.arange(1.0, 11.0), np.zeros(10)], axis=1)


@pytest.mark.parametrize(
    ("told", "after", "right"),
    [
        (Instruction(Kind.FASTER), plans(2.1), True),
        (Instruction(Kind.FASTER), plans(2.04), False),
        (Instruction(Kind.SLOWER), plans(1.9), True),
        (Instruction(Kind.SLOWER), plans(2.1), False),
        (Instruction(Kind.STOP), plans(0.1), True),
        (Instruction(Kind.STOP), plans(0.5), False),
        (Instruction(Kind.SPEED, mps=12.0), plans(2.5), True),
        (Instruction(Kind.SPEED, mps=4.0), plans(2.5), False),
        (Instruction(Kind.LEFT), plans(2.0, -3.0), True),
        (Instruction(Kind.LEFT), plans(2.0, 3.0), False),
        (Instruction(Kind.RIGHT), plans(2.0, 3.0), True),
        (Instruction(Kind.RIGHT), plans(2.0, 0.5), False),
    ],
)
def test_what_counts_as_obeying(told: Instruction, after: tuple[NDArray[Any], NDArray[Any]], right: bool) -> None:
    assert obeys(told, plans(2.0), after) is right


def test_the_table_says_when_there_was_nothing_to_see() -> None:
    assert table([InstructionScore("faster", 0, 0, math.nan, math.nan)]).splitlines()[1].split() == [
        "faster",
        "0",
        "0",
        "-",
        "-",
    ]


@pytest.mark.parametrize("of", [slice(1, 2), slice(None, None, -1)], ids=["the second alone", "the other way round"])
def test_folders_of_a_training_are_given_in_its_order_or_its_frames_would_pass_for_held_out(
    of: slice, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trained = read_manifest(SHIPPED, "simlingo").provenance["trainer"]["frames"]
    assert len(trained) > 1
    folders = [str(tmp_path / name) for name in trained]

    def said(*arguments: str) -> str:
        with pytest.raises(SystemExit) as ended:
            main(["instructions", *arguments])
        assert ended.value.code == 4
        return capsys.readouterr().err

    assert f"learnt from {', '.join(trained)}, and what it held out of them follows" in said(*folders[of])
    for usable in (folders, folders[:1], ["--all", *folders[of]]):
        assert "no complete shards" in said(*usable)


def test_without_frames_the_command_says_how_to_collect_some(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["instructions", str(tmp_path)])
    assert ended.value.code == 4
    assert "collect --agent NAME" in capsys.readouterr().err


def test_frames_that_training_refuses_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def said(*arguments: str) -> str:
        with pytest.raises(SystemExit) as ended:
            main(["instructions", str(tmp_path), *arguments])
        assert ended.value.code == 4
        return capsys.readouterr().err

    assert said("--scenes", "0").startswith("--scenes is 0, expected a number above 0")
    of_tcp = {"agent": "tcp", "cameras": [asdict(camera) for camera in TCP_CAMERAS]}
    asked = {"agent": "simlingo", "beta": 0.5, "dagger": None, "per_type": 1, "routes": 1}
    for other, why in (
        ({"simulator": "2"}, "was collected in embedded 2, and the world is"),
        (of_tcp, "was collected for 'tcp', whose cameras are not those of 'simlingo'"),
        ({}, "holds 0 of the 1 shards that were asked for"),
    ):
        (tmp_path / "collect.json").write_text(json.dumps(asked | other))
        assert why in said("--all")
