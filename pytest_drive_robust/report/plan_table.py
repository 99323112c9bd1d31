"""What `--drive-plan` shows: which episodes the selected tests have, which are stored, how long the rest takes."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from math import fsum

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.report.numbers import duration_text
from pytest_drive_robust.report.page import Page
from pytest_drive_robust.runner.plan import EpisodeRequest


def plan_text(
    requests: Iterable[EpisodeRequest],
    find: Callable[[str], EpisodeResult | None],
    *,
    likely: Collection[str],
    possible: Collection[str],
    slots: int,
    colour: bool,
) -> str:
    """Tell for each agent and setting what is left, and how long that takes when `slots` episodes are driven at a time.

    `likely` are the keys of the episodes that the verdicts probably take, `possible` those that they take at most:
    some verdicts may come early, some are in. The time rests on the stored episodes of the plan; where there are none
    it is not known.
    """
    counts: dict[tuple[str, str], list[int]] = {}
    walls: list[float] = []
    left = 0
    for request in requests:
        count = counts.setdefault((request.episode.agent, request.episode.setting), [0, 0, 0])
        count[0] += 1
        stored = find(request.key)
        if stored is not None:
            count[1] += 1
            walls.append(stored.wall_s)
        elif request.key in possible:
            count[2] += 1
            left += request.key in likely
    page = Page(colour=colour)
    rows = [(*names, *map(str, numbers)) for names, numbers in counts.items()]
    page.table(("episodes", "stored", "to drive"), rows, setting_width=48, verdicts=False)
    most = sum(to_drive for _, _, to_drive in counts.values())
    return f"{page.text}\n{_sentence(left, most, walls, slots)}"


def _sentence(left: int, most: int, walls: list[float], slots: int) -> str:
    if not most:
        return "Every verdict is in: nothing would be driven."
    driven = f"About {left} episodes would be driven (at most {most}: a verdict takes as many as it needs)"
    driven = f"{driven if left < most else f'{most} episodes would be driven'}, {slots} at a time"
    if not walls:
        return f"{driven}; how long that takes shows when the first ones are stored."
    return f"{driven}, in about {duration_text(left * fsum(walls) / len(walls) / slots)}."
