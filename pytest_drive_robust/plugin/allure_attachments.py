"""With allure-pytest, a broken requirement gets plots and the film of its worst route."""

from __future__ import annotations

import shlex
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import pytest

from pytest_drive_robust.metrics.episodes import route_and_seed
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.report.failure import replay_command, worst_episode
from pytest_drive_robust.report.numbers import legible
from pytest_drive_robust.report.plots import scores_svg, speeds_svg
from pytest_drive_robust.runner.campaign import Judgement


def attach(config: pytest.Config, judgement: Judgement, options: RunOptions, *, routes_spec: str) -> str:
    """Attach the plots and the film of the worst route to the current test, when allure-pytest writes a report.

    Returns `""`, or a line for the failure message that says why an attachment is missing: an error here must not hide
    the verdict.
    """
    try:
        _attach(config, judgement, options, routes_spec=routes_spec)
    except Exception as error:
        return f"\n  allure:  not all was attached: {type(error).__name__}: {error}"
    return ""


def _attach(config: pytest.Config, judgement: Judgement, options: RunOptions, *, routes_spec: str) -> None:
    """Attach plots, and the film that the replay command writes in its own process; no film for external episodes."""
    if not config.getoption("allure_report_dir", None) or not judgement.verdict.worst:
        return
    import allure  # here: an optional plugin

    put: Any = allure.attach  # without types in most versions
    kinds: Any = allure.attachment_type
    verdict, worst = judgement.verdict, judgement.verdict.worst[0]
    place, route = (worst.route_id, worst.seed), legible(worst.route_id)
    clean, perturbed = (
        {route_and_seed(result): result for result in results} for results in (judgement.clean, judgement.perturbed)
    )
    if clean:
        put(scores_svg(judgement.clean, judgement.perturbed), "driving scores", kinds.SVG)
    if place in clean:
        put(speeds_svg(clean[place], perturbed[place]), f"speed on {route}", kinds.SVG)
    if options.is_external:
        return
    command = replay_command(worst_episode(verdict), options, routes_spec=routes_spec)
    with tempfile.TemporaryDirectory() as folder:
        words = [*shlex.split(command)[1:], "--out", str(Path(folder) / "film.mp4")]
        told = subprocess.run(
            [sys.executable, "-m", "pytest_drive_robust.cli", *words],
            cwd=config.invocation_params.dir,
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            check=False,
        )
        for film in sorted(Path(folder).iterdir()):
            kind = kinds.MP4 if film.suffix == ".mp4" else kinds.PNG
            put.file(film, f"film of {route}", kind)
        put(told.stdout + told.stderr, "replay", kinds.TEXT)
