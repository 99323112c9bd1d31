from __future__ import annotations

import importlib
import sys

import pytest


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
