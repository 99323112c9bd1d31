from __future__ import annotations

import os
from pathlib import Path

import pytest

from pytest_drive_robust.options import cores

pytestmark = pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="every core is ours there")


@pytest.fixture
def groups(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A machine of 64 cores and its control groups."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: set(range(64)))
    monkeypatch.setattr(cores, "_OWN_GROUP", tmp_path / "cgroup")
    monkeypatch.setattr(cores, "_GROUPS", tmp_path / "groups")
    (tmp_path / "groups").mkdir()
    return tmp_path / "groups"


def write(groups: Path, own: str, **limits: str) -> None:
    groups.with_name("cgroup").write_text(f"1:cpu:/elsewhere\n0::{own}\n")
    for name, limit in limits.items():
        folder = groups / name.replace("_", "/") if name != "root" else groups
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "cpu.max").write_text(limit)


def test_only_the_cores_that_this_process_may_run_on_count(groups: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert cores.available_cores() == 64
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {3, 5, 7})
    assert cores.available_cores() == 3


@pytest.mark.parametrize(
    ("own", "limits", "expected"),
    [
        ("/", {"root": "200000 100000\n"}, 2),
        ("/", {"root": "150000 100000\n"}, 2),
        ("/", {"root": "20000 100000\n"}, 1),
        ("/", {"root": "max 100000\n"}, 64),
        ("/pod/box", {"pod": "300000 100000\n", "pod_box": "max 100000\n"}, 3),
        ("/pod/box", {"other": "100000 100000\n"}, 64),
        ("/pod", {"pod": "no number\n"}, 64),
    ],
    ids=str,
)
def test_a_container_counts_as_many_cores_as_it_is_given_time_on(
    groups: Path, own: str, limits: dict[str, str], expected: int
) -> None:
    write(groups, own, **limits)
    assert cores.available_cores() == expected


@pytest.mark.parametrize(("quota", "expected"), [("250000", 3), ("-1", 64)])
def test_control_groups_of_version_1_limit_the_cores_too(groups: Path, quota: str, expected: int) -> None:
    (groups / "cpu").mkdir()
    (groups / "cpu" / "cpu.cfs_quota_us").write_text(f"{quota}\n")
    (groups / "cpu" / "cpu.cfs_period_us").write_text("100000\n")
    assert cores.available_cores() == expected
