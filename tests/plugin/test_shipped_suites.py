"""The suites that ship, as a user's pytest finds them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from pytest_drive_robust.options.run import RunOptions

ROOT = Path(__file__).parents[2]


def collected(*args: str) -> list[str]:
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", *args]
    output = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return [line.partition("::")[0] for line in output.splitlines() if "::" in line]


def test_smoke_comes_before_paper() -> None:
    modules = list(dict.fromkeys(collected("suites/")))
    assert modules == ["suites/smoke/test_smoke.py", "suites/paper/test_paper.py"]


def test_one_suite_alone_is_collected_alone() -> None:
    assert set(collected("suites/paper")) == {"suites/paper/test_paper.py"}


def test_our_own_ini_judges_as_everybody_s_does() -> None:
    ini = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert not any(name in ini for name in ("drive_verdict", "drive_margin", "drive_alpha", "drive_routes"))
    assert RunOptions().verdict_rule.for_routes(44).kind == "evidence"
