"""The pictures of the site are what `docs/pictures.py` draws today."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from PIL import Image

ROOT = Path(__file__).parents[2]
PICTURES = ROOT / "docs" / "pictures"
_MOST_OFF = 6.0
"""Mean difference of a channel, of 255: what compression may cost."""


@pytest.fixture(scope="module")
def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("docs_pictures", ROOT / "docs" / "pictures.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def require_alike(name: str, drawn: np.ndarray) -> None:
    with Image.open(PICTURES / f"{name}.webp") as kept:
        shown = np.asarray(kept.convert("RGB"), np.float64)
    assert shown.shape == drawn.shape
    off = abs(shown - drawn).mean()
    assert off < _MOST_OFF, f"{name} is {off:.1f} off: run `python docs/pictures.py`, look at it, commit it"


@pytest.mark.parametrize("route", ["2801", "4101"])
def test_the_picture_of_a_scenario_is_what_the_world_shows(script: ModuleType, route: str) -> None:
    (drawn,) = script.resolve_routes(route)
    require_alike(f"scenarios/{drawn.scenario.type}", script.scenario(route))


@pytest.mark.slow
def test_the_picture_of_a_failure_is_what_the_film_shows(script: ModuleType) -> None:
    require_alike("failures/burst-frame-drop", script.failure(script.FAILURES["burst-frame-drop"]))


def test_every_picture_is_used_small_and_drawn_by_the_script(script: ModuleType) -> None:
    kept = {path.relative_to(PICTURES).as_posix(): path for path in PICTURES.rglob("*.*")}
    assert [name for name, path in kept.items() if path.stat().st_size >= 2_000_000] == []
    scenarios = {f"scenarios/{route.scenario.type}.webp" for route in script.resolve_routes("one-per-scenario")}
    failures = {f"failures/{name}.webp" for name in script.FAILURES}
    pages = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "docs").rglob("*.md"))
    others = {match for match in re.findall(r"pictures/([\w./-]+)", pages) if "/" not in match}
    assert set(kept) == scenarios | failures | others


def test_an_unknown_picture_is_named_before_any_is_drawn(
    script: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["pictures.py", "agents", "case-burst"])
    monkeypatch.setitem(script.DRAWN, "agents", lambda: pytest.fail("drawn"))
    with pytest.raises(SystemExit, match="2"):
        script.main()
    assert "there is no picture named 'case-burst'. Known: readme, tutorial," in capsys.readouterr().err
