"""What `--drive-plan` shows: which episodes the selected tests have, which are stored, how long the rest takes."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterable
from math import fsum
from statistics import fmean

from pytest_drive_robust.report.numbers import duration_text
from pytest_drive_robust.report.page import WIDTH, Page
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.store.base import Find


def plan_text(
    requests: Iterable[EpisodeRequest],
    find: Find,
    *,
    likely: Collection[str],
    possible: Collection[str],
    slots: int,
    together: Callable[[str], int] = lambda agent: 1,
    colour: bool,
    width: int = WIDTH,
) -> str:
    """Tell for each agent and setting what is left, and how long that takes when `slots` episodes are driven at a time.

    `likely` are the keys of the episodes that the verdicts probably take, `possible` those that they take at most:
    some verdicts may come early, some are in. The time rests on the stored episodes of the same agent; of one without
    any it is not known, as agents differ by a factor of a hundred. An episode holds its slot `together(agent)` times
    its own seconds.
    """
    counts: dict[tuple[str, str], list[int]] = {}
    walls_s: dict[str, list[float]] = defaultdict(list)
    left: Counter[str] = Counter()
    for request in requests:
        agent = request.episode.agent
        count = counts.setdefault((agent, request.episode.setting), [0, 0, 0])
        count[0] += 1
        stored = find(request.key)
        if stored is not None:
            count[1] += 1
            walls_s[agent].append(stored.wall_s)
        elif request.key in possible:
            count[2] += 1
            left[agent] += request.key in likely
    page = Page(colour=colour, width=width)
    rows = [(*names, *map(str, numbers)) for names, numbers in counts.items()]
    page.table(("episodes", "stored", "to drive"), rows, setting_width=48, verdicts=False)
    waiting = {agent: count * together(agent) for agent, count in left.items() if count}
    held_s = [count * fmean(walls_s[agent]) for agent, count in waiting.items() if walls_s[agent]]
    unknown = [agent for agent in waiting if not walls_s[agent]]
    most = sum(to_drive for _, _, to_drive in counts.values())
    return f"{page.text}\n{_sentence(left.total(), most, held_s, unknown, slots)}"


def _sentence(left: int, most: int, held_s: list[float], unknown: list[str], slots: int) -> str:
    if not most:
        return "Every verdict is in: nothing would be driven."
    driven = f"About {left} episodes would be driven (at most {most}: a verdict takes as many as it needs)"
    driven = f"{driven if left < most else f'{most} episodes would be driven'}, {slots} at a time"
    if not held_s:
        return f"{driven}; how long that takes shows when the first ones are stored."
    beside = f" and what those of {' and '.join(unknown)} take, of which none is stored yet" if unknown else ""
    return f"{driven}, in about {duration_text(fsum(held_s) / slots)}{beside}."
