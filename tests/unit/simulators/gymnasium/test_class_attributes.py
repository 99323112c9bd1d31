"""What an environment writes on highway-env's classes is seen by itself alone."""

from __future__ import annotations

import gymnasium
import highway_env  # noqa: F401 -- registers its ids
import numpy as np
import pytest
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.gymnasium import gymnasium_simulator
from pytest_drive_robust.simulators.gymnasium.class_attributes import ClassAttributes

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
