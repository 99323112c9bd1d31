"""The table of `--drive-plan`: all episodes of the selected tests, the stored episodes, and the time for the rest."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterable, Sequence
from math import fsum
from statistics import fmean

from pytest_drive_robust.errors import first_few
from pytest_drive_robust.report.numbers import counted, duration_text
from pytest_drive_robust.report.page import WIDTH, Page
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.store.base import Find


def plan_text(
    requests: Iterable[EpisodeRequest],
    find: Find,
    *,
    likely: Collection[str],
    possible: Collection[str],
    unplanned: Sequence[str] = (),
    slots: int,
    together: Callable[[str], int] = lambda agent: 1,
    colour: bool,
    width: int = WIDTH,
) -> str:
    """Return a table of the episodes left for each agent and setting, and the time to drive them, `slots` at a time.

    `likely` are the keys of the episodes that the verdicts probably read, `possible` the keys that the verdicts may
    read at most: some verdicts may come early, some are reached already. The time is estimated from stored episodes of
    the same agent; for an agent without stored episodes the time is unknown, because agents differ by a factor of a
    hundred. An episode holds its slot `together(agent)` times its own seconds. `unplanned` are the tests that state no
    requirement as a parameter: what their bodies ask for is not known.
    """
    asked: Counter[tuple[str, str]] = Counter()
    stored: Counter[tuple[str, str]] = Counter()
    to_drive: Counter[tuple[str, str]] = Counter()
    walls_s: dict[str, list[float]] = defaultdict(list)
    left: Counter[str] = Counter()
    for request in requests:
        agent = request.episode.agent
        row = agent, request.episode.setting
        asked[row] += 1
        result = find(request.key)
        if result is not None:
            stored[row] += 1
            walls_s[agent].append(result.wall_s)
        elif request.key in possible:
            to_drive[row] += 1
            left[agent] += request.key in likely
    page = Page(colour=colour, width=width)
    rows = [(*row, str(count), str(stored[row]), str(to_drive[row])) for row, count in asked.items()]
    page.table(("episodes", "stored", "to drive"), rows, setting_width=48, verdicts=False)
    waiting = {agent: count * together(agent) for agent, count in left.items() if count}
    held_s = [count * fmean(walls_s[agent]) for agent, count in waiting.items() if walls_s[agent]]
    unknown = [agent for agent in waiting if not walls_s[agent]]
    lines = [page.text]
    if to_drive or not unplanned:
        lines.append(_sentence(left.total(), to_drive.total(), held_s, unknown, slots))
    elif asked:
        lines.append("Every episode of the requirements that are parameters is stored.")
    if unplanned:
        told = first_few(unplanned, 1)
        lines.append(f"Not counted is what tests without a requirement as a parameter ask for in their bodies: {told}.")
    return "\n".join(lines)


def _sentence(left: int, most: int, held_s: list[float], unknown: list[str], slots: int) -> str:
    if not most:
        return "Every episode that the verdicts need is stored: nothing would be driven."
    driven = f"{counted(most, 'episode')} would be driven"
    if left < most:
        driven = f"About {left} episodes would be driven (at most {most}: a verdict takes as many as it needs)"
    driven += f", {slots} at a time"
    if not held_s:
        return f"{driven}; how long that takes shows when the first ones are stored."
    beside = f" and what those of {' and '.join(unknown)} take, of which none is stored yet" if unknown else ""
    return f"{driven}, in about {duration_text(fsum(held_s) / slots)}{beside}."
