from __future__ import annotations

import pytest

from pytest_drive_robust.registry.entries import Entry


def test_ctrl_c_while_an_entry_loads_ends_the_run_and_blames_no_distribution() -> None:
    def interrupted() -> object:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Entry("agents", "slow", "slow-agents 1.0", interrupted).load()
