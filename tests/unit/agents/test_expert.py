"""The agent `expert`: how it answers a scene, and a few routes as a whole."""

from __future__ import annotations

import math

import pytest
from privileged_scene import LANE_M, actor, observation, street

from drive_robust_agents.expert import Expert
from pytest_drive_robust import Control, GlobalPlan
from pytest_drive_robust.domain.truth import ActorKind, GroundTruth, LightState
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.metrics.score import is_success
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.route_sets import named_routes


def act(truth: GroundTruth, *, ticks: int = 1, room_s: float = 0.0) -> Control:
    agent, control = Expert(room_s=room_s), Control()
    agent.reset(GlobalPlan(()), 0)
    for tick in range(ticks):
        control = agent.act(observation(truth, tick))
    return control


def test_it_stops_for_a_red_light_and_not_for_a_green_one() -> None:
    assert act(street(light=(36.0, LightState.RED), speed_mps=9.0)).brake > 0.2
    assert act(street(light=(36.0, LightState.GREEN), speed_mps=9.0)).brake == 0.0


@pytest.mark.parametrize("option", ["room_s=-5", "room_s=nan", "halt_s=nan", "halt_s=inf"])
def test_seconds_that_nobody_can_wait_are_refused_in_its_name(option: str) -> None:
    name = option.partition("=")[0]
    with pytest.raises(UsageError, match=f"expert has {name}=.*as in 'expert:{name}=1'"):
        default_registry().entry("agents", f"expert:{option}").load().check()


def test_it_brakes_for_who_is_about_to_walk_into_the_lane() -> None:
    walker = actor(36.0, 3.4, speed_mps=2.0, yaw_rad=-math.pi / 2.0, kind=ActorKind.PEDESTRIAN)
    assert act(street(walker, speed_mps=10.0)).brake > 0.2


def test_it_waits_behind_an_obstacle_while_somebody_comes_and_goes_when_nobody_does() -> None:
    coming = actor(55.0, -LANE_M, speed_mps=10.0, yaw_rad=math.pi)
    waiting = act(street(actor(34.0, 1.0), coming, x_m=22.2), ticks=105)
    going = act(street(actor(34.0, 1.0), x_m=22.2), ticks=105)
    assert waiting.steer == 0.0
    assert waiting.throttle < 0.3  # from there on it would hold its speed
    assert going.steer < -0.1
    assert going.throttle > 0.4


def test_it_waits_five_seconds_before_it_uses_the_oncoming_lane() -> None:
    agent, blocked = Expert(), street(actor(34.0, 1.0), x_m=22.2)
    steers = [agent.act(observation(blocked, tick)).steer for tick in range(110)]
    assert set(steers[:100]) == {0.0}
    assert min(steers[100:]) < -0.1


def test_it_leaves_a_parking_space_only_into_a_gap() -> None:
    coming = actor(12.0, 0.0, speed_mps=9.0)
    assert act(street(coming, right_m=2.9)).throttle == 0.0
    assert act(street(right_m=2.9)).throttle > 0.3


def test_with_room_it_leaves_a_gap_that_is_only_just_enough() -> None:
    coming = street(actor(-4.0, 0.0, speed_mps=9.0), right_m=2.9)
    assert act(coming).throttle > 0.3
    assert act(coming, room_s=1.0).throttle == 0.0


@pytest.mark.parametrize("every_ticks", [1, 5])
@pytest.mark.parametrize(("halt_s", "waits"), [(0.0, False), (1.0, True)])
def test_it_stands_at_a_stop_sign_as_long_as_it_is_told(halt_s: float, waits: bool, every_ticks: int) -> None:
    agent = Expert(halt_s=halt_s)
    still, held_s = street(light=(36.0, LightState.STOP_SIGN), x_m=32.6, speed_mps=0.0), []
    for tick in range(0, 46, every_ticks):
        agent.act(observation(still, tick))
        held_s += [0.05 * tick] if math.isfinite(agent.intent().stop_row) else []
    assert bool(held_s) == waits
    assert not waits or max(held_s) == pytest.approx(halt_s, abs=0.05 * (every_ticks + 1) + 1e-9)


def behind_a_braking_car(*, every_ticks: int) -> float:
    """Return the acceleration that it chooses behind a car that brakes at 3 m/s2, asked every so many ticks."""
    agent = Expert()
    for tick in range(0, 21, every_ticks):
        away_m, slower_mps = 9.0 * 0.05 * tick, 3.0 * 0.05 * tick
        leader = actor(38.0 + away_m - 0.5 * slower_mps * 0.05 * tick, 0.0, speed_mps=9.0 - slower_mps)
        agent.act(observation(street(leader, x_m=20.0 + away_m, speed_mps=9.0), tick))
    return agent.intent().acceleration_mps2


@pytest.mark.parametrize("every_ticks", [2, 4, 10])
def test_asked_every_few_ticks_it_judges_who_brakes_ahead_as_in_every_tick(every_ticks: int) -> None:
    assert behind_a_braking_car(every_ticks=every_ticks) == behind_a_braking_car(every_ticks=1)


def test_its_patience_is_counted_in_seconds_and_not_in_answers() -> None:
    crossing = street(actor(34.0, 1.0), actor(55.0, -LANE_M, speed_mps=10.0, yaw_rad=math.pi), x_m=22.2)
    waited_s = []
    for every_ticks in (1, 10):
        agent = Expert()
        for tick in range(0, 41, every_ticks):
            agent.act(observation(crossing, tick))
        waited_s.append(agent.fork()._speed._waited_s)
    assert waited_s == pytest.approx([2.05, 2.05])


def test_without_ground_truth_it_says_what_it_needs() -> None:
    with pytest.raises(ValueError, match="privileged"):
        Expert().act(observation(None))


TYPES = (
    "AccidentTwoWays",
    "EnterActorFlow",
    "HighwayExit",
    "InvadingTurn",
    "ParkingExit",
    "SequentialLaneChange",
    "SignalizedJunctionLeftTurn",
    "YieldToEmergencyVehicle",
)


@pytest.mark.parametrize("scenario", TYPES)
def test_it_drives_a_route_of_each_kind_and_again_the_same_way(scenario: str) -> None:
    route = next(route for route in named_routes("full") if route.scenario.type == scenario)
    simulator, agent = EmbeddedSimulator(SimulatorOptions(stuck_stop_s=60.0)), Expert()
    first, second = (
        drive_episode(simulator, agent, route=route, setting=Setting.CLEAN, seed=0, agent_name="expert")
        for _ in range(2)
    )
    assert is_success(first), (first.end_detail, first.infractions)
    assert first.ticks == second.ticks
