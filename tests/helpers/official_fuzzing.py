"""Strategies and the one thing that result files of any content must survive."""

from __future__ import annotations

import copy
import json
import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from official_records import official_totals

from pytest_drive_robust.bench2drive.results.motion_log import Comforts
from pytest_drive_robust.bench2drive.results.official_totals import score_results
from pytest_drive_robust.bench2drive.results.quirks import notes_on
from pytest_drive_robust.bench2drive.results.results_file import read_results
from pytest_drive_robust.bench2drive.results.results_source import ResultsSource
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.errors import UsageError

ANY = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from([10**400, -1, "../x", "Failed", "9" * 5000 + "%", "1e+400%", "x_y", "\ud800", [], {}]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=6,
)
FUZZ = settings(max_examples=800, deadline=None, suppress_health_check=list(HealthCheck))


def places(value: object, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the way to every value within a document."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path, *(place for key, item in inner for place in places(item, (*path, key)))]


def replaced(value: Any, place: tuple[Any, ...], new: object) -> Any:
    if not place:
        return new
    changed = copy.deepcopy(value)
    inner = changed
    for key in place[:-1]:
        inner = inner[key]
    if new is Ellipsis:
        del inner[place[-1]]
    else:
        inner[place[-1]] = new
    return changed


def try_everything(path: Path) -> None:
    """Score the file in both modes and make episodes of its records; refusals are fine."""
    try:
        results = read_results(path)
    except UsageError:
        return
    for mode in ("bench2drive", "fixed"):
        comforts = Comforts((results.folder,))
        try:
            score = score_results(results, comforts, mode=mode)
            notes_on(score, results, comforts)
        except UsageError:
            continue
        numbers = [score.ds, score.sr, score.efficiency, score.comfort]
        assert all(number is None or (math.isfinite(number) and number >= 0.0) for number in numbers)
        if mode == "bench2drive":
            ds, sr, _ = official_totals(json.loads(path.read_text())["_checkpoint"]["records"])
            assert (score.ds, score.sr) == (pytest.approx(ds, abs=1e-9), pytest.approx(sr, abs=1e-12))
    try:
        source = ResultsSource.read("clean", path)
    except UsageError:
        return
    for route in source.routes:
        for seed in sorted({seed for _, seed in source.records}):
            episode = Episode("driver", route.id, "clean", seed)
            try:
                source.episode(episode, route)
            except UsageError:
                continue
