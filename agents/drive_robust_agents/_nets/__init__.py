"""Networks of the learned agents and what runs them: ONNX Runtime, or torch where it is asked for."""

from __future__ import annotations

from importlib.util import find_spec

from pytest_drive_robust.errors import UsageError

__all__ = ["require"]


def require(*modules: str, extra: str) -> None:
    """Raise `UsageError` with the command that installs them when modules of an extra of ours are missing."""
    missing = [name for name in modules if find_spec(name) is None]
    if missing:
        raise UsageError(
            f"the learned agents (tcp, uniad, vad, simlingo) need {' and '.join(missing)} for this, which is not "
            f"installed: pip install 'drive-robust-agents[{extra}]'"
        )
