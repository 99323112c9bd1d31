"""Ctrl-C twice: the second one must not cut off the reports. Where SIGINT is ignored it stays ignored."""

from __future__ import annotations

import signal
from collections.abc import Iterator

import pytest

from pytest_drive_robust.plugin.interrupt import InterruptPlugin


@pytest.fixture(params=[signal.default_int_handler, signal.SIG_IGN], ids=["foreground", "background"])
def before(request: pytest.FixtureRequest) -> Iterator[object]:
    inherited = signal.signal(signal.SIGINT, request.param)
    yield request.param
    signal.signal(signal.SIGINT, inherited)


def test_the_second_one_is_left_out_and_the_third_interrupts(before):
    plugin = InterruptPlugin()
    plugin.pytest_keyboard_interrupt()
    plugin.pytest_keyboard_interrupt()
    signal.raise_signal(signal.SIGINT)
    if before is signal.SIG_IGN:
        signal.raise_signal(signal.SIGINT)
    else:
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    plugin.pytest_unconfigure()
    assert signal.getsignal(signal.SIGINT) is before
