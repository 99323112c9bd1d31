"""What a training prints."""

# ruff: noqa: E402 - without torch, which is an extra, these tests are skipped before the imports that need it

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")
from rich.console import Console

from drive_robust_agents.training.loop.progress import Display


def test_progress_is_told_in_lines_where_there_is_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    shown = Display(total=2, done=0, batch=8, console=Console(force_terminal=False, width=200))
    with shown:
        shown.step(1, {"loss": 2.0}, 1e-3)
        shown.step(2, {"loss": torch.tensor(1.0)}, 1e-3)
        shown.validated(2, {"loss": 0.25})
    told = capsys.readouterr().out
    assert "2/2 loss 1.000" in told
    assert "1/2" not in told  # half a minute is not over
    assert "step 2: validation loss 0.250" in told
