"""Shrinks a stack of failures under which an agent fails to a small stack under which the agent still fails.

Verdicts on driving are noisy; a shrinker that trusts every verdict ends at a stack that does not fail. So a failure is
left out, or made milder, only when the remaining stack was judged `"fail"`; an inconclusive verdict keeps the failure.
The shrinker of hypothesis takes one answer for the truth and is therefore not used here.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import ComparisonError, PerturbationError
from pytest_drive_robust.perturbations.base import Perturbation, Setting
from pytest_drive_robust.perturbations.ladder import Ladder, ladder_of
from pytest_drive_robust.verdict.evaluate import Decide
from pytest_drive_robust.verdict.requirement import Requirement

Fails = Callable[[Setting], "bool | str"]
"""Returns True or `"fail"` when the agent fails under a setting; any other value, also `"inconclusive"`, is no fail."""

_TICK_S = 0.05


@dataclass(frozen=True)
class MinimalFailure:
    """The smallest failing `setting` found: no failure in it could be shown to be superfluous.

    `given` is the setting that was shrunk, `asked` every (setting, answer) that was judged on the way. `str()` returns
    the summary and a test case to keep.
    """

    setting: Setting
    given: Setting
    asked: tuple[tuple[str, str], ...]
    sentence: str = "RD under {setting} <= 0.30"

    def __str__(self) -> str:
        return f"{self.summary}\n\n{self.case}"

    @property
    def summary(self) -> str:
        """The setting, the given setting and the number of verdicts, in one line."""
        verdicts = "1 verdict" if len(self.asked) == 1 else f"{len(self.asked)} verdicts"
        return f"smallest setting that fails: {self.setting} (from {self.given}, {verdicts})"

    @property
    def case(self) -> str:
        """A pytest case that checks the setting again."""
        sentence = self.sentence.format(setting=self.setting).replace("\\", "\\\\").replace('"', '\\"')
        name = re.sub(r"[^a-z0-9]+", "_", str(self.setting).lower()).strip("_")
        return f'def test_{name}(drive):\n    drive.check(requirements("{sentence}")[0])\n'


def minimal_failure(
    requirement: Requirement, decide: Decide, *, verdict_rule: VerdictRule, dt_s: float
) -> MinimalFailure | None:
    """Return the smallest setting under which `requirement` fails, or None when `requirement` does not fail as given.

    The smallest setting is `clean` when the agent fails without any failure. Verdicts during the search are stricter
    than a single verdict: they share alpha, about two verdicts for each failure in the stack.
    """
    setting = requirement.setting
    if decide(requirement, verdict_rule).decision != "fail":
        return None
    strict = replace(verdict_rule, alpha=verdict_rule.alpha / (2.0 * max(1, len(setting.perturbations))))

    def fails(candidate: Setting) -> str:
        asked = Requirement(requirement.metric, candidate, requirement.comparison, requirement.limit)
        return decide(asked, verdict_rule if candidate == setting else strict).decision

    limit = requirement.metric.format_limit(requirement.limit)
    sentence = f"{requirement.metric} under {{setting}} {requirement.comparison} {limit}"
    if not requirement.needs_clean and fails(Setting.CLEAN) == "fail":  # no failure in the stack is to blame
        asked = {str(given): "fail" for given in (setting, Setting.CLEAN)}
        return MinimalFailure(Setting.CLEAN, setting, tuple(asked.items()), sentence)
    return minimal_failing(setting, fails, dt_s=dt_s, sentence=sentence)


def minimal_failing(
    setting: Setting | Perturbation,
    fails: Fails,
    *,
    dt_s: float = _TICK_S,
    sentence: str = "RD under {setting} <= 0.30",
) -> MinimalFailure:
    """Leave out failures one at a time, mildest first, then make the rest milder along their ladders.

    `fails` judges a setting; each setting is judged once. `dt_s` is the length of a tick in seconds. `sentence` is the
    requirement behind `fails`, for the test case.

    Raises `ComparisonError` when `setting` itself does not fail.
    """
    given = Setting.of(setting) if isinstance(setting, Perturbation) else setting
    asked: dict[str, str] = {}

    def still_fails(candidate: Setting) -> bool:
        key = str(candidate)
        if key not in asked:
            answer = fails(candidate)
            asked[key] = answer if isinstance(answer, str) else "fail" if answer else "pass"
        return asked[key] == "fail"

    if not still_fails(given):
        raise ComparisonError(f"{given} does not fail (it is {asked[str(given)]!r}), so there is nothing to shrink.")
    smallest = _soften(_drop(given, still_fails, dt_s), still_fails, dt_s)
    return MinimalFailure(smallest, given, tuple(asked.items()), sentence)


def _drop(setting: Setting, still_fails: Callable[[Setting], bool], dt_s: float) -> Setting:
    """Leave out failures while the rest still fails, the mildest first, because it is the least likely culprit."""
    while len(setting.perturbations) > 1:
        stack = setting.perturbations
        heights = [_height(item, dt_s) for item in stack]
        order = sorted(range(len(stack)), key=heights.__getitem__)  # by place, as one object may occur twice
        smaller = (Setting(stack[:place] + stack[place + 1 :]) for place in order)
        found = next((candidate for candidate in smaller if still_fails(candidate)), None)
        if found is None:
            break
        setting = found
    return setting


def _soften(setting: Setting, still_fails: Callable[[Setting], bool], dt_s: float) -> Setting:
    """Return the setting with the mildest severity of each failure that still fails, found by bisection."""
    for place, item in enumerate(setting.perturbations):
        ladder = _ladder(item, dt_s)
        if ladder is None:
            continue
        own = ladder.severity(ladder.level_of(item))
        milder = [level for level in ladder.levels if ladder.severity(level) < own]
        below, above = -1, len(milder)
        while above - below > 1:
            middle = (below + above) // 2
            candidate = _with(setting, place, ladder.at(milder[middle]))
            if still_fails(candidate):
                above = middle
            else:
                below = middle
        if above < len(milder):
            setting = _with(setting, place, ladder.at(milder[above]))
    return setting


def _with(setting: Setting, place: int, item: Perturbation) -> Setting:
    return Setting((*setting.perturbations[:place], item, *setting.perturbations[place + 1 :]))


def _height(item: Perturbation, dt_s: float) -> float:
    """Return the share of the ladder's levels up to the failure's severity, or 2 without a ladder, to be tried last."""
    ladder = _ladder(item, dt_s)
    if ladder is None:
        return 2.0
    own = ladder.severity(ladder.level_of(item))
    return sum(ladder.severity(level) <= own for level in ladder.levels) / len(ladder.levels)


def _ladder(item: Perturbation, dt_s: float) -> Ladder | None:
    try:
        ladder = ladder_of(item, dt_s=dt_s)
        ladder.level_of(item)
    except PerturbationError:  # no ladder, or no severity at all: measured latency
        return None
    return ladder
