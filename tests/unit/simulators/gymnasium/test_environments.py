"""Which ids can be driven, which are refused, and what is forced on those that are driven."""

from __future__ import annotations

import gymnasium
import highway_env  # noqa: F401 -- registers its ids
import numpy as np
import pytest
from highway_env.envs import HighwayEnv
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.truth import WorldState
from pytest_drive_robust.errors import RouteError, UnknownNameError, UsageError
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.gymnasium import gymnasium_simulator
from pytest_drive_robust.simulators.gymnasium.class_attributes import ClassAttributes
from pytest_drive_robust.simulators.gymnasium.environments import WORKING
from pytest_drive_robust.testing import fake_route

HIGHWAY_ENV_IDS = sorted(
    name for name, spec in gymnasium.registry.items() if str(spec.entry_point).startswith("highway_env.envs")
)
REFUSED = sorted({*HIGHWAY_ENV_IDS} - {*WORKING})


class Slow(HighwayEnv):
    """Overrides the config that it is given."""

    @classmethod
    def default_config(cls):
        return super().default_config() | {"vehicles_count": 3}

    def configure(self, config):
        super().configure(config)
        self.config["policy_frequency"] = 5


class Small(HighwayEnv):
    """A highway of a stranger."""

    @classmethod
    def default_config(cls):
        return super().default_config() | {"vehicles_count": 3, "lanes_count": 2}


@pytest.fixture(autouse=True)
def strangers():
    gymnasium.register("test/Slow-v0", entry_point=Slow)
    gymnasium.register("test/Small-v0", entry_point=Small, max_episode_steps=5)
    yield
    del gymnasium.registry["test/Slow-v0"], gymnasium.registry["test/Small-v0"]


def made(identifier, *, tick_cap=4000):
    return gymnasium_simulator(SimulatorOptions(tick_cap=tick_cap), identifier)


def test_every_id_of_highway_env_either_works_or_is_refused():
    assert len(REFUSED) == 7


@pytest.mark.parametrize("identifier", sorted(WORKING))
def test_a_working_id_starts_on_its_route_and_drives_along_it(identifier):
    simulator = made(identifier)
    state = simulator.reset(simulator.routes()[2], seed=0, cameras=[])
    truth = simulator.truth()
    start = truth.route[0]
    assert abs(state.ego.x_m - start[0]) + abs(state.ego.y_m - start[1]) < 2.0
    assert len(state.actors) >= 1
    assert 40.0 < simulator.score().route_length_m < 1600.0
    assert {lane.index for lane in truth.lane_map.lanes} == set(range(len(truth.lane_map.lanes)))
    for _ in range(15):
        state = simulator.step(Control(throttle=0.3))
    assert simulator.done is None
    assert simulator.progress_m > 4.0
    assert state.tick == 15
    simulator.close()


@pytest.mark.parametrize("identifier", REFUSED)
def test_the_rest_is_refused_by_name_with_those_that_work(identifier):
    with pytest.raises(UsageError) as refusal:
        made(identifier)
    message = str(refusal.value)
    assert f"gymnasium:{identifier} cannot be driven" in message
    assert "The nearest is gymnasium:" in message
    assert "merge-generic-v0" in message


def test_an_unknown_id_gets_the_nearest_one():
    with pytest.raises(UnknownNameError, match="Did you mean 'roundabout-v0'"):
        made("roundabot-v0")


def test_an_environment_that_is_no_road_is_refused_with_what_was_expected():
    with pytest.raises(UsageError, match=r"gymnasium:CartPole-v1 cannot be made: .*expected an environment like"):
        made("CartPole-v1")


def test_an_environment_that_insists_on_another_rate_is_refused():
    with pytest.raises(UsageError, match="simulation_frequency 20 and policy_frequency 5, expected 20 and 20"):
        made("test/Slow-v0")


def test_an_environment_of_strangers_that_is_like_highway_env_is_driven():
    simulator = made("test/Small-v0")
    simulator.reset(simulator.routes()[0], seed=0, cameras=[])
    for _ in range(8):  # longer than its own limit of 5 steps
        simulator.step(Control(throttle=0.3))
    assert simulator.done is None
    assert simulator.name == "gymnasium:test/Small-v0"
    simulator.close()


def test_an_id_may_bring_the_module_that_registers_it():
    assert made("highway_env:merge-v0").routes()[0].id == "merge-v0-0"
    with pytest.raises(UsageError, match="the module 'no_such_module'"):
        made("no_such_module:merge-v0")


def test_without_an_id_the_syntax_is_told():
    with pytest.raises(UsageError, match="give gymnasium:ID, as in gymnasium:"):
        gymnasium_simulator(SimulatorOptions())


def test_routes_are_ten_reset_seeds_and_others_by_name():
    simulator = made("merge-v0")
    assert [route.id for route in simulator.routes()] == [f"merge-v0-{number}" for number in range(10)]
    assert [route.id for route in simulator.routes(["merge-v0-77", "merge-v0-3"])] == ["merge-v0-77", "merge-v0-3"]
    for name in ("merge-v1-3", "merge-v0-x", "merge-v0-03", "merge-v0-123456"):
        with pytest.raises(UnknownNameError, match="Any number up to 99999"):
            simulator.routes([name])


def test_a_route_of_another_world_does_not_fit():
    simulator = made("merge-v0")
    with pytest.raises(RouteError, match="give --drive-routes gymnasium:merge-v0"):
        simulator.check_route(fake_route())


def test_numbers_and_seeds_are_different_traffic():
    simulator = made("merge-v0")

    def traffic(number, seed):
        state = simulator.reset(simulator.routes()[number], seed=seed, cameras=[])
        return state.actors[:, [WorldState.X, WorldState.Y]].tolist()

    drawn = [traffic(0, 0), traffic(1, 0), traffic(0, 1)]
    assert drawn == [traffic(0, 0), traffic(1, 0), traffic(0, 1)]
    assert drawn[0] != drawn[1] != drawn[2] != drawn[0]
    simulator.close()


OURS = {"DISTANCE_WANTED", "COMFORT_ACC_MAX", "COMFORT_ACC_MIN"}


def values():
    return {name: getattr(IDMVehicle, name) for name in OURS}


def highway_trajectory():
    """8 s of highway-fast-v0 as anybody would drive it beside us, without our backend."""
    env = gymnasium.make("highway-fast-v0", config={"vehicles_count": 15, "policy_frequency": 5})
    env.reset(seed=3)
    for _ in range(40):
        env.step(1)
    return np.array([[*vehicle.position, vehicle.speed] for vehicle in env.unwrapped.road.vehicles])


def test_highway_drives_the_same_before_and_after_an_intersection():
    before = highway_trajectory()
    intersection = gymnasium_simulator(SimulatorOptions(), "intersection-v1")
    intersection.reset(intersection.routes()[0], seed=0, cameras=[])
    for _ in range(10):
        intersection.step(Control(throttle=0.2))
    during = highway_trajectory()
    intersection.score()
    intersection.close()
    assert np.array_equal(before, during)
    assert np.array_equal(before, highway_trajectory())


def test_the_control_an_intersection_without_us_changes_the_highway():
    before, unharmed = highway_trajectory(), values()
    try:
        gymnasium.make(gymnasium.spec("intersection-v0")).reset(seed=0)
        assert values() != unharmed
        assert not np.array_equal(before, highway_trajectory())
    finally:
        for name, value in unharmed.items():
            setattr(IDMVehicle, name, value)


def test_the_environment_keeps_its_own_values_from_call_to_call():
    own, before = ClassAttributes(), values()
    with own.inside():
        IDMVehicle.DISTANCE_WANTED = 7.5
    assert values() == before
    with own.inside():
        assert IDMVehicle.DISTANCE_WANTED == 7.5


def test_values_come_back_when_the_environment_raises():
    own, before = ClassAttributes(), values()

    def write_and_fail():
        with own.inside():
            IDMVehicle.COMFORT_ACC_MAX = 1.0
            raise OSError("lost")

    with pytest.raises(OSError, match="lost"):
        write_and_fail()
    assert values() == before


def test_an_attribute_that_a_class_did_not_have_goes_away_again():
    own = ClassAttributes()
    with own.inside():
        IDMVehicle.MAX_SPEED = 12.0
    assert "MAX_SPEED" not in vars(IDMVehicle)
    assert IDMVehicle.MAX_SPEED == Vehicle.MAX_SPEED
    with own.inside():
        assert IDMVehicle.MAX_SPEED == 12.0


def test_classes_that_are_defined_meanwhile_keep_what_they_say():
    own = ClassAttributes()
    with own.inside():

        class Tractor(IDMVehicle):
            MAX_SPEED = 8.0

    assert Tractor.MAX_SPEED == 8.0
