"""In a child process: the worlds and the agents of episodes that are driven in lockstep."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from pytest_drive_robust.domain.agent import offers_lockstep
from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.engine.shared_state import Phase, SharedState
from pytest_drive_robust.engine.worker.process_state import read_process_state, restore_process_state
from pytest_drive_robust.engine.worker.watched_agent import WatchedAgent, call_contained
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.episode.contract import blame
from pytest_drive_robust.runner.episode.generators import seed_generators
from pytest_drive_robust.runner.episode.machine import with_machine
from pytest_drive_robust.runner.episode.make_agent import make_agent
from pytest_drive_robust.runner.episode.rescore import bare_result
from pytest_drive_robust.runner.lockstep.lockstep import Lockstep
from pytest_drive_robust.runner.lockstep.vetting import Vetting, vet
from pytest_drive_robust.runner.plan import EpisodeRequest

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.domain.control import Control
    from pytest_drive_robust.domain.observation import CameraSpec, Observation
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.domain.route import GlobalPlan
    from pytest_drive_robust.domain.truth import WorldState
    from pytest_drive_robust.engine.pickled_request import PickledRequest
    from pytest_drive_robust.engine.worker_setup import WorkerSetup
    from pytest_drive_robust.registry.registry import Registry
    from pytest_drive_robust.simulators.base import Simulator

__all__ = ["Crew"]


class Crew:
    """Drives in lockstep what one process is asked for; worlds and agents of one agent name are kept warm."""

    def __init__(self, recipe: WorkerSetup, registry: Registry, board: SharedState, channel: int) -> None:
        self.board = board
        self._recipe = recipe
        self._registry = registry
        self.channel = channel
        self._lockstep: Lockstep | None = None
        self._of: tuple[str, int] | None = None
        self._surroundings: dict[str, Mapping[str, Any]] = {}
        self._sample: Agent | None = None
        self._asked: Control | None = None
        self._alone = False

    def vet(self, order: PickledRequest, width: int) -> EpisodeResult:
        """May the agent be driven in lockstep? Not driven: completed when it may, an agent error when it must not.

        An `infra_error` says that there was nothing to ask about, because the episode broke at once.
        """
        name, task = order.episode.agent, self.task_of(order)
        if offers_lockstep(self._make(name)):
            world = self._world()
            try:
                vetting = vet(world, lambda: _TimedRow(self._make(name), self), task, width=width)
            finally:
                world.close()
        else:
            vetting = Vetting(recorded=True, problem="it has no act_batch.")
        outcome, end = Outcome.INFRA_ERROR, End.SIMULATION_CRASHED
        if vetting.recorded:
            passed = vetting.problem is None
            outcome, end = (Outcome.COMPLETED, End.COMPLETED) if passed else (Outcome.AGENT_ERROR, End.AGENT_CRASHED)
        return bare_result(order.route, order.episode, outcome=outcome, end=end, detail=vetting.problem or "")

    def drive_alone(self, order: PickledRequest, width: int) -> EpisodeResult:
        """One episode in a batch of its own, with everything on the board that salvaging it would take."""
        task = self.task_of(order)
        self._alone = True
        try:
            ((_, result),) = self.drive([task], agent=task.episode.agent, width=width)
        except UsageError:
            raise
        except BaseException as error:  # sys.exit() in a simulator, a perturbation that interrupts
            detail = blame("the simulation", error)
            result = bare_result(
                order.route, order.episode, outcome=Outcome.INFRA_ERROR, end=End.SIMULATION_CRASHED, detail=detail
            )
        finally:
            self._alone = False
        if result.outcome is Outcome.INFRA_ERROR:
            self.close()
        return result

    def drive(
        self, tasks: Iterable[EpisodeRequest], *, agent: str, width: int
    ) -> Generator[tuple[EpisodeRequest, EpisodeResult], None, None]:
        """See `Lockstep.drive`, for requests of `agent`, in the surroundings that it was made in."""
        if self._lockstep is None or self._of != (agent, width):
            self.close()
            self._of = agent, width
            self._lockstep = Lockstep(
                self._world,
                lambda: WatchedRow(self._make(agent), self),
                width=width,
                watch=self.board,
                on_tick=self._ticked,
            )
        if agent in self._surroundings:
            restore_process_state(self._surroundings[agent])
        seed_generators(f"driving {agent}")
        self.board.enter(Phase.SIM, 0)
        for task, result in self._lockstep.drive(tasks):
            yield task, with_machine(result, self._sample)

    def task_of(self, order: PickledRequest) -> EpisodeRequest:
        """Raises `UsageError` for a setting that cannot be had here."""
        return EpisodeRequest(order.episode, order.route, order.read_setting(self._registry))

    def close(self) -> None:
        """Close the worlds and drop the agents. Calling it twice does no harm."""
        if self._lockstep is not None:
            self._lockstep.close()
        self._lockstep = self._sample = None

    def answered(self, answers: object) -> None:
        """What the first row of a batch was told is the control of an episode that is driven alone."""
        self._asked = answers[0] if isinstance(answers, Sequence) and answers else None

    def _ticked(self, tick: int, frame: WorldState, observation: Observation, applied: Control) -> None:
        if self._alone:
            self.board.add(tick, self._asked, applied, frame.ego)
        self._asked = None

    def _world(self) -> Simulator:
        self.board.enter(Phase.SIM, 0)
        return self._registry.simulator(self._recipe.simulator, self._recipe.options)

    def _make(self, name: str) -> Agent:
        self.board.enter(Phase.MAKE, 0)
        self._sample = agent = make_agent(self._registry, name)
        self._recipe.limit_threads()
        self._surroundings.setdefault(name, read_process_state())
        self.board.enter(Phase.SIM, 0)
        return agent


class WatchedRow(WatchedAgent):
    """An agent among others."""

    def __init__(self, agent: Agent, crew: Crew) -> None:
        super().__init__(agent, crew.board, crew.channel)
        self._crew = crew
        self._told = False

    def sensors(self) -> Sequence[CameraSpec]:
        """The agent's cameras: it drives an episode of its own."""
        self._told = True
        return super().sensors()

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """A stand-in is not asked for its cameras, and leaves the rig on the board as it is."""
        if self._told:
            self._told = False
            super().reset(route, seed)
        else:
            call_contained(self._agent.reset, route, seed)

    def act(self, observation: Observation) -> Control:
        """As one that drives alone: where the time of inference is measured."""
        control = super().act(observation)
        self._crew.answered([control])
        return control

    def act_batch(self, rows: Sequence[WatchedRow], observations: Sequence[Observation]) -> Sequence[Control]:
        """The agents' own answers."""
        agents: list[Any] = [row._agent for row in rows]
        answers: Sequence[Control] = call_contained(agents[0].act_batch, agents, observations)
        self._check_connection()
        self._crew.answered(answers)
        return answers


class _TimedRow(WatchedRow):
    """Tells the board itself when the agent's code runs: for calls that no loop makes."""

    def reset(self, route: GlobalPlan, seed: int) -> None:
        self._timed(Phase.RESET, super().reset, route, seed)

    def act(self, observation: Observation) -> Control:
        control: Control = self._timed(Phase.ACT, super().act, observation)
        return control

    def act_batch(self, rows: Sequence[WatchedRow], observations: Sequence[Observation]) -> Sequence[Control]:
        answers: Sequence[Control] = self._timed(Phase.ACT, super().act_batch, rows, observations)
        return answers

    def _timed(self, phase: Phase, call: Callable[..., Any], *arguments: object) -> Any:
        self._state.enter(phase, 0)
        try:
            return call(*arguments)
        finally:
            self._state.enter(Phase.SIM, 0)
