from __future__ import annotations

import importlib
import sys

import pytest

from pytest_drive_robust.runner.cache_key import distributions


@pytest.fixture
def module(tmp_path, monkeypatch):
    """Write modules and import them anew: `module(name, text)`."""
    monkeypatch.syspath_prepend(tmp_path)
    written = []

    def write(name: str, text: str):
        path = tmp_path / f"{name.replace('.', '/')}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        written.append(name)
        for known in list(sys.modules):
            if known.partition(".")[0] in {name.partition(".")[0] for name in written}:
                del sys.modules[known]
        importlib.invalidate_caches()
        return importlib.import_module(name)

    yield write
    for known in list(sys.modules):
        if known.partition(".")[0] in {name.partition(".")[0] for name in written}:
            del sys.modules[known]


@pytest.fixture
def other_versions(monkeypatch):
    """Return what pretends that Python and all installed libraries have other versions."""

    def pretend() -> None:
        monkeypatch.setattr(distributions, "version_of", lambda top, origin: f"another {top}")
        monkeypatch.setattr(distributions, "python_version", lambda: {"python": "4.0"})

    return pretend
