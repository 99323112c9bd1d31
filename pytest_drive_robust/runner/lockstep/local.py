"""Batches in this process: the worlds and the agents of episodes that are driven in lockstep."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.runner.episode.generators import borrowed_generators
from pytest_drive_robust.runner.episode.machine import with_machine
from pytest_drive_robust.runner.episode.make_agent import make_agent
from pytest_drive_robust.runner.executors import DRIVEN_AGAIN, InlineExecutor
from pytest_drive_robust.runner.lockstep.admission import Admission, admission_of, factory_offers_lockstep
from pytest_drive_robust.runner.lockstep.executor import LockstepExecutor
from pytest_drive_robust.runner.lockstep.lockstep import Lockstep

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.registry.registry import Registry
    from pytest_drive_robust.runner.episode.loop import OnTick, Watch
    from pytest_drive_robust.runner.plan import EpisodeRequest
    from pytest_drive_robust.simulators.base import Simulator, SimulatorOptions

    Ended = Generator[tuple[EpisodeRequest, EpisodeResult], None, None]

__all__ = ["LocalBatches", "lockstep_inline"]


def lockstep_inline(
    registry: Registry, *, simulator: str, options: SimulatorOptions, ticked: Callable[[], object], width: int
) -> LockstepExecutor:
    """Return the executor of lockstep in this process, where nothing protects the run from the agent.

    `ticked` is called after every tick of all that are driven together.
    """

    def make_drivers() -> list[LocalBatches]:
        made = LocalBatches(
            lambda: registry.simulator(simulator, options),
            lambda name: make_agent(registry, name),
            width=width,
            ticked=ticked,
        )
        return [made]

    return LockstepExecutor(
        InlineExecutor(registry, simulator=simulator, options=options, ticked=ticked),
        make_drivers,
        width=width,
        shares=lambda agent: factory_offers_lockstep(agent, registry),
    )


class LocalBatches:
    """Drives batches here; the worlds and agents of one agent's name are kept for the next ones.

    `make_agent` is given that name. What drives is `wrap` of the agent that it makes. See `Lockstep` for the rest.
    """

    output = ""

    def __init__(
        self,
        make_world: Callable[[], Simulator],
        make_agent: Callable[[str], Agent],
        *,
        width: int,
        wrap: Callable[[Agent], Agent] = lambda agent: agent,
        watch: Watch | None = None,
        ticked: Callable[[], object] | None = None,
        on_tick: OnTick | None = None,
    ) -> None:
        self._make_world = make_world
        self._make_agent = make_agent
        self._wrap = wrap
        self._width = width
        self._watch = watch
        self._ticked = ticked
        self._on_tick = on_tick
        self._lockstep: Lockstep | None = None
        self._agent: str | None = None
        self._latest: Agent | None = None

    def check(self, request: EpisodeRequest) -> Admission:
        """May the agent of `request` be driven in lockstep? Raises `UsageError` when it cannot be made."""
        name = request.episode.agent
        world = self._make_world()
        try:
            with borrowed_generators(f"driving {name}"):
                return admission_of(world, lambda: self._make(name), request, width=self._width, watch=self._watch)
        finally:
            world.close()

    def drive_batch(self, agent: str, requests: Iterator[EpisodeRequest]) -> Ended:
        """Drive what `requests` gives, all of `agent`: see `Lockstep.drive`. Raises `UsageError`."""
        if self._lockstep is None or self._agent != agent:
            self.close()
            self._agent = agent
            self._lockstep = Lockstep(
                self._make_world,
                lambda: self._make(agent),
                width=self._width,
                watch=self._watch,
                ticked=self._ticked,
                on_tick=self._on_tick,
            )
        driving = self._lockstep.drive(requests)
        try:
            while True:
                with borrowed_generators(f"driving {agent}"):
                    ended = next(driving, None)
                if ended is None:
                    return
                yield ended[0], with_machine(ended[1], self._latest)
        finally:
            driving.close()

    def drive(self, request: EpisodeRequest) -> EpisodeResult:
        """Drive one in a batch of its own, again where the world broke."""
        for _ in range(1 + DRIVEN_AGAIN):
            ((_, result),) = self.drive_batch(request.episode.agent, iter([request]))
            if result.outcome is not Outcome.INFRA_ERROR:
                break
        return result

    def wake(self) -> None:
        """Do nothing: whoever drives here looks at `requests` in every tick."""

    def stop(self) -> None:
        """Do nothing: between two calls nothing is under way."""

    def close(self) -> None:
        """Close the worlds and drop the agents. Calling it twice does no harm."""
        if self._lockstep is not None:
            self._lockstep.close()
        self._lockstep = self._latest = None

    def _make(self, name: str) -> Agent:
        self._latest = agent = self._make_agent(name)
        return self._wrap(agent)
