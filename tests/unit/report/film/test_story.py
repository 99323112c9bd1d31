"""The plot of a film: where it stands still, what it skims, which moments are telling."""

from __future__ import annotations

from result_factory import infraction, make_result, trace_of

from pytest_drive_robust.domain.outcome import End, InfractionKind
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.truth import EgoState, WorldState
from pytest_drive_robust.report.film.story import story_of
from pytest_drive_robust.runner.replay.recording import Tape, TapedMoment


def tape_of(result: EpisodeResult) -> Tape:
    import numpy as np

    speeds = [*result.trace.column("speed_mps").tolist(), 0.0]
    moments = tuple(
        TapedMoment(
            WorldState(k, EgoState(0, 0, 0, speed, 0, 0, 0, 4.5, 1.9), np.zeros((0, 10)), np.zeros(0, np.int64))
        )
        for k, speed in enumerate(speeds)
    )
    return Tape(result, moments, None, np.zeros((2, 4)))  # type: ignore[arg-type]


def result_of(ticks: int, **given: object) -> EpisodeResult:
    return make_result(trace=trace_of(ticks, speed_mps=given.pop("speed_mps", 5.0)), **given)  # type: ignore[arg-type]


def test_it_is_as_long_as_the_longer_episode() -> None:
    assert story_of((tape_of(result_of(30)), tape_of(result_of(50)))).length == 50


def test_it_says_when_and_how_the_two_parted() -> None:
    story = story_of((tape_of(result_of(40)), tape_of(result_of(40, speed_mps=7.0))))
    assert story.divergence == (1, "in speed")


def test_nothing_parts_twins() -> None:
    assert story_of((tape_of(result_of(40)), tape_of(result_of(40)))).divergence is None


def test_it_stands_still_for_a_second_where_something_happens_and_two_at_the_end() -> None:
    hit = infraction(InfractionKind.COLLISION_VEHICLE, second=1.0)
    shown = story_of((tape_of(result_of(40, infractions=[hit])),)).showing(0.05)
    assert shown.count(20) == 21
    assert shown.count(40) == 41
    assert shown.count(19) == 1
    assert shown == sorted(shown)


def test_a_long_wait_is_skimmed_but_not_what_happens_in_it() -> None:
    import numpy as np

    speeds = np.where(np.arange(400) < 100, 5.0, 0.0)
    late = infraction(InfractionKind.BLOCKED, second=15.0)
    story = story_of((tape_of(result_of(400, speed_mps=speeds, infractions=[late])),))
    shown = story.showing(0.05)
    assert set(range(161)) <= set(shown)
    assert len(set(shown) & set(range(161, 300))) < 25
    assert shown.count(300) == 21


def test_nothing_is_skimmed_while_the_other_one_drives() -> None:
    standing, driving = tape_of(result_of(200, speed_mps=0.0)), tape_of(result_of(200))
    assert not story_of((standing, driving)).skimmed - {200}


def test_the_telling_moments_are_start_divergence_infractions_and_end() -> None:
    events = [infraction(InfractionKind.COLLISION_VEHICLE, second=second) for second in (1.0, 1.5)]
    story = story_of((tape_of(result_of(40)), tape_of(result_of(60, speed_mps=7.0, infractions=events))))
    assert story.telling() == [0, 1, 20, 30, 60]
    many = [infraction(InfractionKind.COLLISION_VEHICLE, second=0.5 + 0.1 * k) for k in range(20)]
    assert len(story_of((tape_of(result_of(60, infractions=many)),)).telling()) == 6


def test_an_infraction_of_the_whole_way_has_no_place_and_a_crash_is_an_event() -> None:
    share = infraction(InfractionKind.OUTSIDE_LANES, second=2.0)
    broken = result_of(40, infractions=[share], end=End.AGENT_CRASHED, end_detail="act returned None")
    events = story_of((tape_of(broken),)).events[0]
    assert [event.place for event in events] == [None, None]
    assert events[-1].words == "act returned None"
