"""Does one seed suffice? One clean episode, driven twice by fresh agent objects, tells."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.metrics.score import driving_score
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.runner.driver import EpisodeDriver, make_agent
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.runner.replay.recording import difference

if TYPE_CHECKING:
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.domain.route import Route
    from pytest_drive_robust.registry.registry import Registry
    from pytest_drive_robust.simulators.base import SimulatorOptions

__all__ = ["RepeatedEpisode", "drive_twice"]


@dataclass(frozen=True, slots=True)
class RepeatedEpisode:
    """Two drives of one clean episode."""

    first: EpisodeResult
    second: EpisodeResult

    @property
    def is_judged(self) -> bool:
        """Return True when both came to an end of their own."""
        return Outcome.INFRA_ERROR not in (self.first.outcome, self.second.outcome)

    @property
    def is_same(self) -> bool:
        """Return True when they are the same to the bit."""
        return self.is_judged and self.first.trace.digest == self.second.trace.digest

    @property
    def apart_m(self) -> float:
        """Return how far the two egos were apart at most, in metres, over the ticks that both drives have."""
        import numpy as np

        from pytest_drive_robust.arithmetic.arrays import hypot

        ticks = min(self.first.ticks, self.second.ticks)
        (x, y), (other_x, other_y) = (
            [result.trace.column(name)[:ticks] for name in ("x_m", "y_m")] for result in (self.first, self.second)
        )
        return float(np.max(hypot(x - other_x, y - other_y), initial=0.0))

    def __str__(self) -> str:
        episode = self.first.episode
        twice = f"probe: {episode.agent} drove route {episode.route_id} clean twice with seed {episode.seed}"
        if not self.is_judged:
            broken = next(item for item in (self.first, self.second) if item.outcome is Outcome.INFRA_ERROR)
            return f"{twice}, but the simulation broke, so nothing was learned: {broken.end_detail}"
        if self.is_same:
            return f"{twice}: the same {self.first.ticks} ticks bit for bit, so one seed suffices to repeat a run"
        scores = f"driving scores {driving_score(self.first):.2f} and {driving_score(self.second):.2f}"
        return (
            f"{twice}: not the same {difference(self.second, self.first)}, up to {self.apart_m:.2f} m apart, {scores}. "
            "One seed does not repeat a run: give several (--drive-seeds 0,1,2) and let evidence judge"
        )


def drive_twice(
    registry: Registry, *, agent: str, simulator: str, options: SimulatorOptions, route: Route, seed: int
) -> RepeatedEpisode:
    """Drive `route` twice under the clean setting, on one simulator as a run does, with an agent object for each.

    Raises `UsageError` when the agent or the simulator cannot be made.
    """
    episode = Episode(agent, route.id, str(Setting.CLEAN), seed)
    request = EpisodeRequest(episode, route, Setting.CLEAN)
    world = registry.simulator(simulator, options)
    try:
        drivers = [EpisodeDriver(lambda: world, lambda name: make_agent(registry, name)) for _ in range(2)]
        first, second = (driver.drive_once(request) for driver in drivers)
    finally:
        world.close()
    return RepeatedEpisode(first, second)
