"""Which files count as the code around an agent."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_drive_robust.bench2drive.evaluator.code_around import code_around


@pytest.mark.parametrize(
    ("changed", "counts"),
    [
        ("agent.py", True),
        ("nets/deep/model.py", True),
        ("linked/planner.py", True),
        ("notes.txt", False),
        (".cache/model.py", False),
        ("nets/__pycache__/model.py", False),
        ("env/lib/model.py", False),
        ("results/config.py", False),
    ],
)
def test_python_files_below_the_folder_count(changed: str, counts: bool, tmp_path: Path) -> None:
    folder, elsewhere = tmp_path / "team", tmp_path / "elsewhere"
    elsewhere.mkdir()
    for name in ("env/pyvenv.cfg", "results/drive_robust.planned", changed.replace("linked", "../elsewhere")):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("GAIN = 1\n")
    (folder / "linked").symlink_to(elsewhere)
    (elsewhere / "back").symlink_to(folder)  # goes round
    (folder / "nowhere.py").symlink_to(tmp_path / "gone.py")
    before = code_around([folder])
    assert code_around([folder]) == before
    (folder / changed).write_text("GAIN = 1.5\n")
    assert (code_around([folder]) != before) is counts


def test_a_new_file_and_another_name_count(tmp_path: Path) -> None:
    (tmp_path / "one.py").write_text("")
    seen = {code_around([tmp_path])}
    (tmp_path / "two.py").write_text("")
    seen.add(code_around([tmp_path]))
    (tmp_path / "two.py").rename(tmp_path / "three.py")
    seen.add(code_around([tmp_path]))
    assert len(seen) == 3


def test_a_folder_that_is_not_there_has_no_code(tmp_path: Path) -> None:
    assert code_around([tmp_path / "gone"]) == code_around([])
