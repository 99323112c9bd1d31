"""What the executor of this process says before its first episode."""

from __future__ import annotations

import pytest

from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.runner.executors import InlineExecutor
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import compiling


@pytest.mark.parametrize(("simulator", "said"), [("embedded", (0, 7)), ("gymnasium:highway-v0", (0, 0))])
def test_it_says_how_many_functions_the_embedded_world_lacks(
    simulator: str, said: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compiling, "missing_functions", lambda: 7)
    options = SimulatorOptions()
    inline = InlineExecutor(default_registry(), simulator=simulator, options=options, ticked=lambda: None)
    assert inline.compiling == said
