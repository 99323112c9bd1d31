"""Checks whether a setting changed any observation or control, and whether the agent uses the changed signals."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pytest_drive_robust.domain.result import CONTROL, EpisodeResult, Reception
from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.perturbations.base import Perturbation, Setting


def require_touched(setting: Setting, results: Sequence[EpisodeResult]) -> None:
    """Raise `ComparisonError` when `setting` changed no observation and no control in any of its episodes.

    A rare failure may miss single episodes, but not all. Episodes without a recorded `reception` are trusted, and the
    clean baseline settings are not checked.
    """
    if setting == setting.baseline:
        return
    driven = [result for result in results if result.ticks > 0]
    receptions = [result.reception for result in driven if result.reception is not None]
    if not driven or len(receptions) < len(driven) or any(item.touched for item in receptions):
        return
    dt_s, seen = driven[0].dt_s, receptions[0]
    reasons = [f"{item}: {_idle_reason(item, seen, dt_s).rstrip('.')}." for item in setting.perturbations]
    episodes = "the only episode" if len(driven) == 1 else f"all {len(driven)} episodes"
    raise ComparisonError(
        "\n  ".join(
            [
                f"{setting} changed nothing in {episodes} of agent {driven[0].episode.agent!r}, "
                "so its numbers would be those of clean driving under another name.",
                *reasons,
                _declared(seen),
            ]
        )
    )


def immunity(results: Sequence[EpisodeResult]) -> str:
    """Return a sentence when the setting changed only signals that the agent does not use, so robustness is not tested.

    `results` are episodes of one setting. Returns an empty string when the setting changed a control or a signal in
    use, and when nothing was recorded.
    """
    receptions = [result.reception for result in results if result.reception is not None]
    touched = {touch.signal: None for item in receptions for touch in item.touched}
    if not touched or CONTROL in touched:
        return ""
    used = {name for item in receptions for name in _used(item)}
    if used & touched.keys():
        return ""
    episode = results[0].episode
    changed, declared = ", ".join(touched), _declared(receptions[0])
    return f"{episode.setting} changed {changed}, which {episode.agent} does not use: {declared}"


def _idle_reason(perturbation: Perturbation, seen: Reception, dt_s: float) -> str:
    """Return the failure's reason for having changed nothing; an error of `idle_reason` is returned as text."""
    try:
        return perturbation.idle_reason(seen.cameras, dt_s)
    except Exception as error:
        return f"its idle_reason raised {type(error).__name__}: {error}"


def _used(reception: Reception) -> Iterable[str]:
    for name in reception.consumes:
        yield from reception.cameras if name == "cameras" else (name,)


def _declared(reception: Reception) -> str:
    cameras = f"cameras {', '.join(reception.cameras)}" if reception.cameras else "no camera"
    return f"the agent has {cameras}; of its sensors it declares to use {', '.join(reception.consumes) or 'none'}."
