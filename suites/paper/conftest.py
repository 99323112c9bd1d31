"""Which reading of the paper's failures runs, the default one unless the other is chosen, and whose limits it asks for.

Both together take nearly twice the time, and the first command should stay short. So the tests of a reading run when
`--drive-reading` (or `drive_reading`) asks for it, which is `paper` where nobody asks, or when `-k` or the name of a
test on the command line names one: `-k released`, `-k reading` for both.
"""

from __future__ import annotations

from pathlib import Path

import pytest

_HERE = Path(__file__).parent
_LEFT_OUT = pytest.StashKey[int]()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    words = " ".join([config.getoption("keyword"), *(place.partition("::")[2] for place in config.args)])
    if "reading" in words or "released" in words:
        return
    chosen = _chosen(config)
    left_out = [item for item in items if _HERE in item.path.parents and f"test_{chosen}_reading" not in item.nodeid]
    items[:] = [item for item in items if item not in left_out]
    config.stash[_LEFT_OUT] = len(left_out)
    if left_out:
        config.hook.pytest_deselected(items=left_out)


def pytest_report_collectionfinish(config: pytest.Config, items: list[pytest.Item]) -> list[str]:
    """Tell whose limits are asked for, and which requirements are left out."""
    stated = [item.callspec.params["requirement"].written for item in items if item.path == _HERE / "test_paper.py"]
    files = dict.fromkeys(written.path.relative_to(_HERE).as_posix() for written in stated)
    told = [f"suites/paper: the limits are those of {' and '.join(files)}"] if files else []
    count = config.stash.get(_LEFT_OUT, 0)
    if count:
        other = "released" if _chosen(config) == "paper" else "paper"
        told.append(
            f"suites/paper: {count} requirements in the reading {other} are left out; --drive-reading {other} runs them"
        )
    return told


def _chosen(config: pytest.Config) -> str:
    return config.getoption("drive_reading") or config.getini("drive_reading") or "paper"
