"""What `--drive-plan` says about how much there is to drive."""

from __future__ import annotations

from dataclasses import replace

from result_factory import make_result

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.report.plan_table import plan_text
from pytest_drive_robust.runner.plan import Scope
from pytest_drive_robust.testing import fake_route
from pytest_drive_robust.verdict.object_form import requirement

WANTED = requirement("DS") >= 40
SCOPE = Scope("driver", "many", tuple(fake_route(str(number)) for number in range(40)), (0,))
REQUESTS = SCOPE.plan([WANTED])


def last_line(rule: str, *stored: str, together: int = 1) -> str:
    plan = SCOPE.verdict_plan(WANTED, VerdictRule(rule))
    found = {key: replace(make_result(), wall_s=3.0) for key in stored}
    likely = {request.key for request in plan.likely}
    text = plan_text(
        REQUESTS.values(),
        found.get,
        likely=likely,
        possible=REQUESTS,
        slots=2 * together,
        together=lambda agent: together,
        colour=False,
    )
    return text.splitlines()[-1]


def test_by_evidence_it_says_what_is_likely_and_what_is_possible() -> None:
    likely = len(SCOPE.verdict_plan(WANTED, VerdictRule("evidence")).likely)
    assert 0 < likely < 40
    assert last_line("evidence").startswith(f"About {likely} episodes would be driven (at most 40")


def test_what_is_stored_is_not_driven_and_says_how_long_the_rest_takes() -> None:
    assert last_line("point") == (
        "40 episodes would be driven, 2 at a time; how long that takes shows when the first ones are stored."
    )
    assert last_line("point", *list(REQUESTS)[:20]) == "20 episodes would be driven, 2 at a time, in about 30 s."
    assert last_line("point", *REQUESTS) == "Every episode that the verdicts need is stored: nothing would be driven."


def test_those_that_are_driven_together_share_their_time() -> None:
    assert last_line("point", *list(REQUESTS)[:20], together=8) == (
        "20 episodes would be driven, 16 at a time, in about 30 s."
    )


def test_an_agent_takes_the_time_of_its_own_stored_episodes() -> None:
    slow = Scope("slow", "many", SCOPE.routes, (0,)).plan([WANTED])
    found = {key: replace(make_result(), wall_s=1.0) for key in REQUESTS}
    found |= {key: replace(make_result(), wall_s=30.0) for key in list(slow)[:10]}
    both = REQUESTS | slow
    text = plan_text(both.values(), found.get, likely=both, possible=both, slots=1, colour=False)
    assert text.splitlines()[-1] == "30 episodes would be driven, 1 at a time, in about 15 min."


def test_an_agent_of_which_nothing_is_stored_is_not_estimated_by_another_one() -> None:
    slow = Scope("slow", "many", SCOPE.routes, (0,)).plan([WANTED])
    both, quick = REQUESTS | slow, list(REQUESTS)

    def told(stored: list[str]) -> str:
        found = {key: replace(make_result(), wall_s=1.0) for key in stored}
        text = plan_text(both.values(), found.get, likely=both, possible=both, slots=1, colour=False)
        return text.splitlines()[-1]

    assert (
        told(quick)
        == "40 episodes would be driven, 1 at a time; how long that takes shows when the first ones are stored."
    )
    assert told(quick[:10]) == (
        "70 episodes would be driven, 1 at a time, in about 30 s and what those of slow take, "
        "of which none is stored yet."
    )


def test_where_nothing_is_asked_for_nothing_would_be_driven() -> None:
    text = plan_text((), {}.get, likely=(), possible=(), slots=1, colour=False)
    assert text.splitlines()[-1] == "Every episode that the verdicts need is stored: nothing would be driven."
