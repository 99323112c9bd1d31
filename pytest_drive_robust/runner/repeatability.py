"""Does one seed suffice? One clean episode, driven twice by fresh agent objects, tells."""

from __future__ import annotations

import math

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.metrics.score import driving_score
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.runner.driver import EpisodeDriver, make_agent
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.runner.replay.recording import difference
from pytest_drive_robust.simulators.base import SimulatorOptions


def drives_compared(first: EpisodeResult, second: EpisodeResult) -> str:
    """Return what two drives of one clean episode show, as a sentence."""
    episode = first.episode
    twice = f"probe: {episode.agent} drove route {episode.route_id} clean twice with seed {episode.seed}"
    for broken in (first, second):
        if broken.outcome is Outcome.INFRA_ERROR:
            return f"{twice}, but the simulation broke, so nothing was learned: {broken.end_detail}"
    unlike = difference(second, first)
    if not unlike:
        return f"{twice}: the same {first.ticks} ticks bit for bit, so one seed suffices to repeat a run"
    places = zip(*(zip(*one.trace.columns("x_m", "y_m"), strict=True) for one in (first, second)), strict=False)
    apart_m = max((math.dist(one, other) for one, other in places), default=0.0)
    return (
        f"{twice}: not the same {unlike}, up to {apart_m:.2f} m apart, driving scores "
        f"{driving_score(first):.2f} and {driving_score(second):.2f}. "
        "One seed does not repeat a run: give several (--drive-seeds 0,1,2) and let evidence judge"
    )


def drive_twice(
    registry: Registry, *, agent: str, simulator: str, options: SimulatorOptions, route: Route, seed: int
) -> tuple[EpisodeResult, EpisodeResult]:
    """Drive `route` twice under the clean setting, on one simulator as a run does, with an agent object for each.

    Raises `UsageError` when the agent or the simulator cannot be made.
    """
    episode = Episode(agent, route.id, str(Setting.CLEAN), seed)
    request = EpisodeRequest(episode, route, Setting.CLEAN)
    world = registry.simulator(simulator, options)
    try:
        drivers = [EpisodeDriver(lambda: world, lambda name: make_agent(registry, name)) for _ in range(2)]
        return drivers[0].drive_once(request), drivers[1].drive_once(request)
    finally:
        world.close()
