from __future__ import annotations

from collections.abc import Callable, Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st
from stream_factory import started

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.errors import PerturbationError
from pytest_drive_robust.perturbations import InferenceLatency, Perturbation, RunningStack, Setting

NEVER = -1  # stands for the neutral command in the tables: it was computed in no tick


def command_of(tick: int) -> Control:
    """What the agent says in `tick`: a control that tells it."""
    return Control(throttle=1.0, steer=tick / 1000.0)


def drive(
    stack: RunningStack, ticks: int, *, inference_s: Callable[[int], float] = lambda _: 0.0
) -> tuple[list[int], list[int]]:
    """(ticks in which the agent ran, for each tick the one in which the applied command was computed)."""
    ran, applied = [], []
    for tick in range(ticks):
        control, seconds = None, 0.0
        if stack.wants_inference(tick):
            control, seconds = command_of(tick), inference_s(len(ran))
            ran.append(tick)
        done = stack.actuate(tick, control, seconds)
        applied.append(NEVER if done == Control.NEUTRAL else round(done.steer * 1000.0))
    return ran, applied


N = NEVER


@pytest.mark.parametrize(
    ("perturbation", "ran", "applied"),
    [
        (InferenceLatency(ms=0), range(9), range(9)),
        (InferenceLatency(ms=0, mode="hold"), range(9), range(9)),
        (InferenceLatency(ms=50), range(9), [N, 0, 1, 2, 3, 4, 5, 6, 7]),
        (InferenceLatency(ms=100), range(9), [N, N, 0, 1, 2, 3, 4, 5, 6]),
        (InferenceLatency(ms=149), range(9), [N, N, 0, 1, 2, 3, 4, 5, 6]),
        (InferenceLatency(ms=200), range(9), [N, N, N, N, 0, 1, 2, 3, 4]),
        (InferenceLatency(ms=500), range(9), [N] * 9),
        (InferenceLatency(ms=50, mode="hold"), range(9), [N, 0, 1, 2, 3, 4, 5, 6, 7]),
        (InferenceLatency(ms=100, mode="hold"), [0, 2, 4, 6, 8], [N, N, 0, 0, 2, 2, 4, 4, 6]),
        (InferenceLatency(ms=200, mode="hold"), [0, 4, 8], [N, N, N, N, 0, 0, 0, 0, 4]),
        (InferenceLatency(ms=100, warmup_ticks=5), range(9), [N, N, N, N, N, 3, 4, 5, 6]),
        (InferenceLatency(ms=100, mode="hold", warmup_ticks=5), [0, 2, 4, 6, 8], [N, N, N, N, N, 2, 4, 4, 6]),
        (InferenceLatency(ms=0, warmup_ticks=3), range(9), [N, N, N, 3, 4, 5, 6, 7, 8]),
        (InferenceLatency(ms=0, mode="hold", warmup_ticks=3), range(9), [N, N, N, 3, 4, 5, 6, 7, 8]),
        (  # 0.12 s: due in tick 2; 0.04 s: due in tick 2 as well, less than a tick later; 0.2 s: from tick 3 to 7
            InferenceLatency(mode="measured", replay_s=(0.12, 0.04, 0.2, 0.05, 0.05)),
            [0, 2, 3, 7, 8],
            [N, N, 2, 2, 2, 2, 2, 3, 7],
        ),
    ],
    ids=str,
)
def test_each_mode_applies_these_commands_tick_by_tick(
    perturbation: Perturbation, ran: Sequence[int], applied: Sequence[int]
) -> None:
    assert drive(started(perturbation), 9) == (list(ran), list(applied))


@given(st.integers(0, 20), st.integers(1, 60))
def test_fifo_is_the_equation_of_the_paper(ticks: int, length: int) -> None:
    ran, applied = drive(started(InferenceLatency(ms=50.0 * ticks)), length)
    assert ran == list(range(length))
    assert applied == [tick - ticks if tick >= ticks else NEVER for tick in range(length)]


@given(st.integers(1, 20), st.integers(1, 80))
def test_hold_applies_commands_that_are_one_to_two_latencies_old(ticks: int, length: int) -> None:
    ran, applied = drive(started(InferenceLatency(ms=50.0 * ticks, mode="hold")), length)
    assert ran == list(range(0, length, ticks))
    ages = [tick - computed for tick, computed in enumerate(applied) if computed != NEVER]
    assert all(ticks <= age < 2 * ticks for age in ages)
    assert len(ages) == max(0, length - ticks)


@given(st.lists(st.floats(0.0, 0.6), min_size=60, max_size=60))
def test_a_replay_of_the_measured_times_repeats_the_episode(times_s: list[float]) -> None:
    measures = Setting.of(InferenceLatency(mode="measured"))
    measured = started(measures)
    driven = drive(measured, 60, inference_s=times_s.__getitem__)
    recording = measured.inference_s
    assert recording == tuple(times_s[: len(driven[0])])
    replays = Setting.of(InferenceLatency(mode="measured", replay_s=recording))
    replay = started(replays)
    assert drive(replay, 60, inference_s=lambda _: 9.9) == driven
    assert replay.inference_s == recording
    assert measures.measures_inference
    assert not replays.measures_inference


def test_a_command_that_an_earlier_latency_repeats_is_no_inference_to_measure() -> None:
    stack = started(Setting.parse("50 ms latency and measured latency"))
    ran, _ = drive(stack, 20, inference_s=lambda _: 0.2)
    assert ran == [0, 4, 8, 12, 16]
    assert stack.inference_s == (0.2,) * 5


def test_a_recording_of_another_episode_is_noticed() -> None:
    stack = started(InferenceLatency(mode="measured", replay_s=(0.05, 0.05)))
    with pytest.raises(PerturbationError, match="the times of 2 inferences, but the agent ran once more"):
        drive(stack, 9)


@pytest.mark.parametrize(
    ("sentence", "ran", "applied"),
    [
        ("50 ms latency and 100 ms latency", range(9), [N, N, N, 0, 1, 2, 3, 4, 5]),
        ("50 ms latency and 100 ms latency (mode=hold)", [0, 2, 4, 6, 8], [N, N, N, N, 0, 0, 2, 2, 4]),
        ("100 ms latency (mode=hold) and 50 ms latency", [0, 2, 4, 6, 8], [N, N, N, 0, 0, 2, 2, 4, 4]),
    ],
)
def test_stacked_latencies_add_up(sentence: str, ran: Sequence[int], applied: Sequence[int]) -> None:
    assert drive(started(Setting.parse(sentence)), 9) == (list(ran), list(applied))


def test_fifo_repeats_the_last_command_when_the_agent_was_not_asked() -> None:
    stack = started(InferenceLatency(ms=50))
    given = [command_of(0), None, command_of(2), None]
    applied = [stack.actuate(tick, control, 0.0) for tick, control in enumerate(given)]
    assert applied == [Control.NEUTRAL, command_of(0), command_of(0), command_of(2)]


def test_the_clean_stack_holds_the_last_command_and_starts_neutral() -> None:
    stack = started(Setting.CLEAN)
    assert stack.actuate(0, None, 0.0) is Control.NEUTRAL
    command = command_of(1)
    assert stack.actuate(1, command, 0.0) is command
    assert stack.actuate(2, None, 0.0) is command


@pytest.mark.parametrize(("ms", "dt_s", "ticks"), [(100, 0.05, 2), (300, 0.1, 3), (150, 0.05, 3), (90, 0.03, 3)])
def test_whole_ticks_survive_rounding(ms: float, dt_s: float, ticks: int) -> None:
    _, applied = drive(started(InferenceLatency(ms=ms), dt_s=dt_s), 10)
    assert applied.index(0) == ticks


@pytest.mark.parametrize("mode", ["fifo", "hold"])
def test_a_latency_below_one_tick_is_refused_because_it_would_be_the_clean_setting(mode: str) -> None:
    with pytest.raises(PerturbationError, match=r"ms is 49\.0, expected 0 or at least one tick, which lasts 0\.05 s"):
        started(InferenceLatency(ms=49, mode=mode))  # type: ignore[arg-type]


def test_the_baseline_of_a_setting_with_a_warm_up_has_the_same_warm_up() -> None:
    setting = Setting.parse("occlusion 0.5 and 100 ms latency (mode=hold, warmup_ticks=4)")
    assert setting.warmup_ticks == 4
    assert str(setting.baseline) == "0 ms latency (mode=hold, warmup_ticks=4)"
    assert drive(started(setting.baseline), 7) == (list(range(7)), [N, N, N, N, 4, 5, 6])
    assert setting.baseline.baseline == setting.baseline
    assert Setting.parse("200 ms latency").baseline == Setting.CLEAN


def test_the_record_tells_in_which_ticks_commands_were_late() -> None:
    late, early = started(InferenceLatency(ms=100)), started(InferenceLatency(ms=0, warmup_ticks=3))
    drive(late, 9)
    drive(early, 9)
    assert [(item.signal, item.first_tick, item.last_tick) for item in late.schedule()] == [("control", 0, 8)]
    assert [(item.signal, item.first_tick, item.last_tick) for item in early.schedule()] == [("control", 0, 2)]
    measured = started(InferenceLatency(mode="measured"))
    drive(measured, 9)
    assert [(item.signal, item.first_tick, item.last_tick) for item in measured.schedule()] == [("control", 0, 8)]
