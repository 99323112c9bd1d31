"""Which tests a session was asked for."""

from __future__ import annotations

import pytest

__all__ = ["everything_ran"]

_NARROWING = ("keyword", "markexpr", "deselect", "lf", "failedfirst", "stepwise")


def everything_ran(session: pytest.Session) -> bool:
    """True when the tests of the whole root folder, or of its `suites`, were selected and none was left out or cut off.

    Only then what did not happen says something.
    """
    config = session.config
    narrowed = any(config.getoption(name, None) for name in _NARROWING)
    stopped = session.shouldstop or session.shouldfail or session.exitstatus not in (0, 1)
    wide = {config.rootpath, config.rootpath / "suites"}
    places = {(config.invocation_params.dir / place).resolve() for place in config.args}
    return bool(wide & places) and not narrowed and not stopped
