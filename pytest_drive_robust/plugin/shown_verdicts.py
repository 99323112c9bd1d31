"""Shows the verdict on a requirement in its test, which then passes, fails, is skipped or becomes an xfail."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import pytest

from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.plugin.allure_attachments import attach
from pytest_drive_robust.plugin.requirement_place import place_of
from pytest_drive_robust.plugin.verdict_errors import INCONCLUSIVE, RAISED, WAIVED, BrokenRequirementError
from pytest_drive_robust.regression.waivers import Waivers
from pytest_drive_robust.report.failure import failure_text
from pytest_drive_robust.report.numbers import legible
from pytest_drive_robust.runner.campaign import Judgement
from pytest_drive_robust.verdict.requirement import Requirement


class ShownVerdicts(NamedTuple):
    """Shows the verdicts in one test, `item`, on the routes of `routes_spec`.

    `reach` returns a line about a broken requirement: how far the agent gets, if the requirement asks for that.
    """

    item: pytest.Item
    options: RunOptions
    waivers: Waivers
    routes_spec: str
    reach: Callable[[Requirement], str]

    def show(self, judgement: Judgement) -> None:
        """Add the verdict to the test's properties; fail or skip the test as the verdict and the options say."""
        __tracebackhide__ = True
        self._record(judgement)
        if judgement.verdict.decision == "inconclusive":
            self.leave_open(judgement)
        elif not judgement.verdict.passed:
            self._fail(judgement)

    def _record(self, judgement: Judgement) -> None:
        """Add the verdict to the test's properties, as finite Python numbers: pytest-xdist and JUnit take no others."""
        verdict = judgement.verdict
        numbers = {
            "drive_value": float(verdict.value),
            "drive_limit": float(verdict.requirement.limit),
            "drive_low": float(verdict.low),
            "drive_high": float(verdict.high),
            "drive_episode_seconds": float(judgement.episode_s),
        }
        self.item.user_properties += [
            ("drive_requirement", str(verdict.requirement)),
            ("drive_agent", verdict.agent),
            ("drive_verdict", verdict.decision),
            *((name, number) for name, number in numbers.items() if math.isfinite(number)),
        ]

    def _fail(self, judgement: Judgement) -> None:
        """Raise `BrokenRequirementError`; only note the waiver of a waived requirement, so that later checks run."""
        __tracebackhide__ = True
        verdict = judgement.verdict
        waiver = self.waivers.find(str(verdict.requirement), self.item.nodeid, agent=verdict.agent)
        if waiver is not None and waiver.holds:
            self.item.stash.setdefault(WAIVED, []).append(waiver.signature)
            return
        missing = attach(self.item.config, judgement, self.options, routes_spec=self.routes_spec)
        place = place_of(self.item, verdict.requirement)
        stated = "" if place is None else "\n  stated:  {}:{}".format(*place)
        reach = self.reach(verdict.requirement)
        error = BrokenRequirementError(self._text(judgement) + legible(reach + missing) + stated, verdict)
        self.item.stash.setdefault(RAISED, []).append(error)
        raise error

    def leave_open(self, judgement: Judgement) -> None:
        """Fail, skip or note an inconclusive verdict, as `--drive-inconclusive` says."""
        __tracebackhide__ = True
        mode = self.options.inconclusive
        if mode == "fail":
            self._fail(judgement)
            return
        first = self._text(judgement).partition("\n")[0]
        if mode == "skip":
            pytest.skip(first)
        self.item.user_properties.append((INCONCLUSIVE, first))

    def _text(self, judgement: Judgement) -> str:
        text = failure_text(
            judgement.verdict,
            self.options,
            routes_spec=self.routes_spec,
            privileged=judgement.privileged,
        )
        return legible(text)
