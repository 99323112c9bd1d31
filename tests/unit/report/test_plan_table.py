"""What `--drive-plan` says about how much there is to drive."""

from __future__ import annotations

from dataclasses import replace

from result_factory import make_result

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.report.plan_table import plan_text
from pytest_drive_robust.runner.plan import Scope
from pytest_drive_robust.testing import fake_route
from pytest_drive_robust.verdict.requirement import requirement

WANTED = requirement("DS") >= 40
SCOPE = Scope("driver", "many", tuple(fake_route(str(number)) for number in range(40)), (0,))
REQUESTS = SCOPE.plan([WANTED])


def last_line(rule: str, *stored: str) -> str:
    reading = SCOPE.reading(WANTED, VerdictRule(rule))
    found = {key: replace(make_result(), wall_s=3.0) for key in stored}
    likely = {request.key for request in reading.likely}
    text = plan_text(REQUESTS.values(), found.get, likely=likely, possible=REQUESTS, slots=2, colour=False)
    return text.splitlines()[-1]


def test_by_evidence_it_says_what_is_likely_and_what_is_possible() -> None:
    likely = len(SCOPE.reading(WANTED, VerdictRule("evidence")).likely)
    assert 0 < likely < 40
    assert last_line("evidence").startswith(f"About {likely} episodes would be driven (at most 40")


def test_what_is_stored_is_not_driven_and_says_how_long_the_rest_takes() -> None:
    assert last_line("point") == (
        "40 episodes would be driven, 2 at a time; how long that takes shows when the first ones are stored."
    )
    assert last_line("point", *list(REQUESTS)[:20]) == "20 episodes would be driven, 2 at a time, in about 30 s."
    assert last_line("point", *REQUESTS) == "Every verdict is in: nothing would be driven."
