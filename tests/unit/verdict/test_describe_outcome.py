from __future__ import annotations

import pytest
from result_factory import infraction, make_result, trace_of

from pytest_drive_robust.domain.outcome import End, InfractionKind
from pytest_drive_robust.verdict.describe import describe_outcome


def test_a_clean_drive_is_completed() -> None:
    assert describe_outcome(make_result(infractions=[InfractionKind.MIN_SPEED])) == "completed"


def test_a_completed_route_names_its_first_infraction() -> None:
    light = infraction(InfractionKind.RED_LIGHT, second=8.2)

    assert describe_outcome(make_result(infractions=[light])) == "completed, red light at 8.2 s"


def test_the_first_infraction_is_the_earliest_and_the_others_are_counted() -> None:
    result = make_result(
        end=End.BLOCKED,
        trace=trace_of(1220),
        infractions=[
            infraction(InfractionKind.BLOCKED, second=61.0),
            infraction(InfractionKind.COLLISION_LAYOUT, second=12.0),
            infraction(InfractionKind.COLLISION_VEHICLE, second=11.3),
        ],
    )

    assert describe_outcome(result) == "collision with vehicle at 11.3 s and 1 more, blocked at 61.0 s"


def test_leaving_the_lanes_is_told_by_its_share() -> None:
    event = infraction(InfractionKind.OUTSIDE_LANES, share_pct=12.4)

    assert describe_outcome(make_result(infractions=[event])) == "completed, outside the lanes for 12 % of the way"


def test_an_agent_error_says_what_was_raised() -> None:
    result = make_result(end=End.AGENT_CRASHED, end_detail="ValueError: steer is nan", trace=trace_of(64))

    assert describe_outcome(result) == "agent error at 3.2 s (ValueError: steer is nan)"


@pytest.mark.parametrize("end", End)
@pytest.mark.parametrize("kind", InfractionKind)
def test_every_end_and_every_infraction_can_be_told(end: End, kind: InfractionKind) -> None:
    assert describe_outcome(make_result(end=end, infractions=[kind]))
