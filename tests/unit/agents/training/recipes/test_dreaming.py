"""Dreams go where the instruction says."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("torch")

from simlingo_samples import FREE

from drive_robust_agents._nets.prompts import Instruction, Kind
from drive_robust_agents.training.recipes.dreaming import DreamStart, applicable, draw_instruction, dream, is_safe

METRES = np.arange(1.0, 25.0)
STRAIGHT = np.stack([METRES, np.zeros(24)], axis=1)


def moment(speed: float = 8.0, later: float = 8.0, bend: float = 0.0, **facts: float) -> DreamStart:
    """A car on a circle (nearly) whose speed goes from one value to another within 3 s."""
    steps = np.exp(1j * bend * (METRES - 0.5)).cumsum()
    line = np.stack([steps.real, steps.imag], axis=1)
    return DreamStart(line, speed, np.linspace(speed, later, 13)[1:], FREE | facts)


moments = st.builds(
    moment,
    st.floats(0.0, 18.0),
    st.floats(0.0, 18.0),
    st.floats(-0.03, 0.03),
    lane_left=st.sampled_from([0.0, 1.0]),
    lane_right=st.sampled_from([0.0, 1.0]),
    lead_m=st.floats(0.0, 100.0),
    light=st.sampled_from([-1.0, 0.0, 1.0, 2.0, 3.0]),
    light_m=st.floats(0.0, 60.0),
)


def length_m(waypoints: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(waypoints, axis=0, prepend=np.zeros((1, 2))), axis=1).sum())


def as_the_expert(here: DreamStart) -> float:
    speeds = np.concatenate([[here.speed_mps], here.speeds[:10]])
    return float(0.125 * (speeds[1:] + speeds[:-1]).sum())


@given(moments)
def test_faster_is_a_longer_way_and_slower_a_shorter_one(here: DreamStart) -> None:
    assert (
        length_m(dream(Instruction(Kind.FASTER), here).waypoints) > as_the_expert(here) + 3.0 or here.speed_mps > 16.0
    )
    slower = length_m(dream(Instruction(Kind.SLOWER), here).waypoints)
    assert slower < 0.95 * as_the_expert(here) + 0.05


@given(moments)
def test_stop_ends_at_rest(here: DreamStart) -> None:
    waypoints = dream(Instruction(Kind.STOP), here).waypoints
    assert np.linalg.norm(waypoints[-1] - waypoints[-2]) < 0.05
    assert length_m(waypoints) <= as_the_expert(here) + 0.3


@given(moments, st.floats(0.0, 20.0))
def test_a_target_speed_is_approached_and_not_passed(here: DreamStart, mps: float) -> None:
    waypoints = dream(Instruction(Kind.SPEED, mps=mps), here).waypoints
    last = float(np.linalg.norm(waypoints[-1] - waypoints[-2])) / 0.25
    low, high = sorted((here.speed_mps, mps))
    assert low - 0.6 <= last <= high + 0.6
    if 0.0 <= mps - here.speed_mps < 4.0 or 0.0 <= here.speed_mps - mps < 7.0:
        assert last == pytest.approx(mps, abs=0.7)


@pytest.mark.parametrize("speed", [0.0, 3.0, 12.0])
@pytest.mark.parametrize(("kind", "aside"), [(Kind.LEFT, -3.5), (Kind.RIGHT, 3.5)])
def test_a_lane_change_ends_one_lane_width_aside(kind: Kind, aside: float, speed: float) -> None:
    path, waypoints = dream(Instruction(kind), moment(speed, speed))
    assert path[-1, 1] == pytest.approx(aside, abs=0.05)
    assert abs(path[0, 1]) < 0.1
    assert (np.sign(aside) * np.diff(path[:, 1]) > -1e-9).all()
    gaps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    assert gaps == pytest.approx(np.ones(19), abs=0.02)
    if speed > 10.0:
        assert np.sign(aside) * waypoints[-1, 1] > 3.0


def test_a_lane_change_follows_a_bend() -> None:
    here = moment(bend=0.02)
    aside = dream(Instruction(Kind.RIGHT), here).path[-1] - here.line[19]
    along = np.array([math.cos(0.4), math.sin(0.4)])
    assert aside @ [-along[1], along[0]] == pytest.approx(3.5, abs=0.3)


@pytest.mark.parametrize(("kind", "side"), [(Kind.OFF_LEFT, -1.0), (Kind.OFF_RIGHT, 1.0)])
def test_who_leaves_the_road_ends_far_beside_it(kind: Kind, side: float) -> None:
    assert side * dream(Instruction(kind), moment()).path[-1, 1] > 5.0


@given(moments, st.sampled_from([Kind.FASTER, Kind.SLOWER, Kind.STOP, Kind.CRASH]))
def test_pedals_alone_do_not_move_the_path(here: DreamStart, kind: Kind) -> None:
    assert dream(Instruction(kind), here).path == pytest.approx(here.line[:20], abs=0.05)


def test_from_beside_the_line_the_way_begins_at_the_vehicle_and_the_path_on_the_line() -> None:
    here = replace(moment(), line=STRAIGHT + np.array([0.0, -1.5]))
    path, waypoints = dream(Instruction(Kind.FASTER), here)
    assert path[:, 1] == pytest.approx(-1.5)
    assert abs(waypoints[0, 1]) < 1.0 < abs(waypoints[-1, 1])


def test_lanes_are_offered_where_they_are_and_asked_about_everywhere() -> None:
    assert Kind.LEFT in applicable(moment(lane_left=1.0), safety=False)
    assert not {Kind.LEFT, Kind.RIGHT} & set(applicable(moment(), safety=False))
    assert {Kind.LEFT, Kind.RIGHT} <= set(applicable(moment(), safety=True))
    assert Kind.LEFT not in applicable(moment(lane_left=1.0, junction_m=5.0), safety=True)
    assert not {Kind.SLOWER, Kind.STOP} & set(applicable(moment(0.0, 0.0), safety=False))


@pytest.mark.parametrize(
    ("told", "facts", "safe"),
    [
        (Instruction(Kind.SLOWER), {}, True),
        (Instruction(Kind.STOP), {"lead_m": 5.0}, True),
        (Instruction(Kind.FASTER), {}, True),
        (Instruction(Kind.FASTER), {"lead_m": 12.0}, False),
        (Instruction(Kind.FASTER), {"light": 2.0, "light_m": 20.0}, False),
        (Instruction(Kind.FASTER), {"light": 0.0, "light_m": 20.0}, True),
        (Instruction(Kind.FASTER), {"limit_mps": 8.0}, False),
        (Instruction(Kind.SPEED, mps=6.0), {"lead_m": 12.0}, False),
        (Instruction(Kind.SPEED, mps=10.0), {}, True),
        (Instruction(Kind.LEFT), {}, False),
        (Instruction(Kind.LEFT), {"lane_left": 1.0}, True),
        (Instruction(Kind.RIGHT), {"lane_left": 1.0}, False),
        (Instruction(Kind.CRASH, thing="vehicle"), {"lead_m": 12.0}, False),
        (Instruction(Kind.OFF_LEFT), {}, False),
    ],
)
def test_what_is_safe_to_obey(told: Instruction, facts: dict[str, float], safe: bool) -> None:
    later = 2.0 if facts.get("lead_m", 100.0) < 20.0 else 8.0
    assert is_safe(told, moment(8.0, later, **facts)) is safe


def test_slowing_down_as_much_as_the_expert_is_safe() -> None:
    assert is_safe(Instruction(Kind.SPEED, mps=1.0), moment(8.0, 2.0, lead_m=12.0))


def test_instructions_are_drawn_by_the_generator_alone() -> None:
    here = moment(lead_m=20.0, lane_left=1.0)
    drawn = [[draw_instruction(here, np.random.default_rng(k), safety=True) for k in range(60)] for _ in range(2)]
    assert drawn[0] == drawn[1]
    assert {told.kind for told in drawn[0]} == set(applicable(here, safety=True))
