"""What `benchmarks/same_bits.py` keeps, and what it counts."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from pretended_machines import MACHINES, PLAIN, gathered

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "same_bits.py"


@pytest.fixture(scope="module")
def same_bits() -> Iterator[ModuleType]:
    spec = importlib.util.spec_from_file_location("same_bits_benchmark", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    yield module
    del sys.modules[spec.name]


def line(label: str, digest: str = "aa", **more: object) -> dict[str, Any]:
    return {"label": label, "digest": digest, "score": 100.0, **more}


def test_what_was_driven_is_found_again_without_the_line_that_was_cut(same_bits: ModuleType, tmp_path: Path) -> None:
    row, other = same_bits.Row(PLAIN), same_bits.Row(MACHINES[0])
    drives = same_bits.Drives(tmp_path, ticks=None)
    drives.add(row, line("expert | 1 | clean"))
    (file,) = tmp_path.glob("*.jsonl")
    file.write_text(file.read_text() + '\n{"label": "expert | 2')
    drives.add(row, line("expert | 3 | clean"))
    again = same_bits.Drives(tmp_path, ticks=None)
    assert [found["label"] for found in again.lines(row)] == ["expert | 1 | clean", "expert | 3 | clean"]
    assert again.lines(other) == []


def test_episodes_of_other_code_are_not_gone_on_with(
    same_bits: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    same_bits.Drives(tmp_path, ticks=None)
    with pytest.raises(SystemExit, match="other code or other --ticks"):
        same_bits.Drives(tmp_path, ticks=5)
    monkeypatch.setattr(same_bits, "code_of_checkout", lambda: "another")
    with pytest.raises(SystemExit, match="other code or other --ticks"):
        same_bits.Drives(tmp_path, ticks=None)


def test_only_what_is_left_of_a_row_is_driven(
    same_bits: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    order = {"agents": ["expert"], "routes": "dev10", "every": 5, "settings": ["clean", "GPS noise 5 m"]}
    labels = same_bits.labels_of(order)
    asked: list[list[str]] = []

    def lines_on(machine: object, given: dict[str, list[str]], python: str) -> Iterator[dict[str, Any]]:
        asked.append(given["labels"])
        yield from map(line, given["labels"])
        yield {"libraries": {"libm": "1"}}

    monkeypatch.setattr(same_bits, "lines_on", lines_on)
    drives, row = same_bits.Drives(tmp_path, ticks=None), same_bits.Row(PLAIN)
    drives.add(row, line(labels[1]))
    counted: list[int] = []

    def advance() -> None:
        counted.append(1)

    driven = same_bits.drive_row(row, order, drives, workers=2, advance=advance)
    assert sorted(label for share in asked for label in share) == sorted({*labels} - {labels[1]})
    assert len(labels) == len(counted) == len(driven.digests) == 4
    same_bits.drive_row(row, order, drives, workers=2, advance=advance)
    assert len(asked) == 2


def test_digests_that_differ_are_counted_by_agent(same_bits: ModuleType) -> None:
    again = "stored controls of network | 1 | clean"
    first = gathered([line("expert | 1 | clean"), line("network | 1 | clean", stored="episode")])
    other = gathered([line("expert | 1 | clean", "bb"), line("network | 1 | clean"), {"label": again, "digest": "x_m"}])
    compared, differ, moved = same_bits.counted(first, other)
    assert compared == {"expert": 1, "network": 1, "stored controls of network": 1}
    assert (differ["expert"], differ["network"], differ["stored controls of network"], moved) == (1, 0, 1, 0.0)
