"""Drives of the expert that several tests of the training data look at; each is driven once in a process."""

from __future__ import annotations

import functools

from privileged_scene import observation

from drive_robust_agents._wrappers.route_planner import Target
from drive_robust_agents.expert import Expert
from drive_robust_agents.training.data.draws import draws
from drive_robust_agents.training.data.labels import ExpertMoment
from drive_robust_agents.training.data.noise import burst_plan
from drive_robust_agents.training.data.rollouts import Sample, drive_expert
from drive_robust_agents.training.data.routes import SCENARIO_NAMES, RouteKey, draw
from pytest_drive_robust import GlobalPlan, RoadOption
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.domain.truth import GroundTruth

NOWHERE = Target(0.0, 0.0, RoadOption.STRAIGHT, 0.0, 0.0)


def key_of(scenario: str, number: int = 0) -> RouteKey:
    """Return the training route of a scenario type."""
    return RouteKey(1, SCENARIO_NAMES.index(scenario), number)


@functools.lru_cache(maxsize=8)
def route_of(scenario: str, number: int = 0) -> Route:
    """Draw the training route of a scenario type."""
    route = draw(key_of(scenario, number))
    assert route is not None
    return route


def data_seed(route: Route, *, noisy: bool) -> int:
    """Return the first seed of the data that gives the first episode of a route steering noise, or none."""
    return next(seed for seed in range(100) if burst_plan(draws(seed, route.id, 0, "noise"), 400).any() == noisy)


@functools.lru_cache(maxsize=8)
def samples_of(scenario: str, *, noisy: bool = False) -> tuple[Sample, ...]:
    """Return the samples of the first episode."""
    route = route_of(scenario)
    return tuple(drive_expert(route, data_seed=data_seed(route, noisy=noisy), seed=0))


def first_moment(truth: GroundTruth) -> ExpertMoment:
    """Return the moment in which the expert sees this for the first time."""
    expert = Expert()
    expert.reset(GlobalPlan(()), 0)
    expert.act(observation(truth))
    return ExpertMoment(truth, expert.intent(), (NOWHERE, NOWHERE), night=False)
