"""An agent that got slower, and runs of a real agent on the embedded bench to compare: what a planted regression is."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence

from pytest_drive_robust.domain.agent import Agent, PlannedPath, consumed_signals, is_privileged
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import GlobalPlan
from pytest_drive_robust.metrics.score import driving_score, is_success
from pytest_drive_robust.regression.fingerprint import AgentPrint, Fingerprint
from pytest_drive_robust.regression.snapshot import Cell, CellKey, RouteScore, Snapshot, Taken
from pytest_drive_robust.verdict.explain import describe_outcome

TICK_MS = 50
STUCK_STOP_S = 30.0
FINGERPRINT = Fingerprint("embedded", STUCK_STOP_S, AgentPrint("", "", ""), {})


class LateAgent:
    """Another agent, whose every command lies around for `late_ms` before it is given."""

    def __init__(self, agent: Agent, late_ms: int) -> None:
        self._agent = agent
        self._late_ticks = late_ms // TICK_MS
        self.privileged = is_privileged(agent)
        self.consumes = consumed_signals(agent)

    def sensors(self) -> Sequence[CameraSpec]:
        return self._agent.sensors()

    def reset(self, route: GlobalPlan, seed: int) -> None:
        self._agent.reset(route, seed)
        self._queue: deque[Control] = deque([Control()] * self._late_ticks)

    def act(self, observation: Observation) -> Control:
        self._queue.append(self._agent.act(observation))
        return self._queue.popleft()

    def plan(self) -> PlannedPath:
        plan = getattr(self._agent, "plan", PlannedPath)
        found: PlannedPath = plan()
        return found


def snapshot_of_results(results: Iterable[EpisodeResult], *, spec: str, label: str) -> Snapshot:
    """Scored episodes of one agent and seed as a stored run holds them."""
    cells: dict[CellKey, dict[str, RouteScore]] = {}
    for result in results:
        episode = result.episode
        taken = Taken(episode.seed, driving_score(result), is_success(result), describe_outcome(result))
        cells.setdefault((episode.agent, episode.setting), {})[episode.route_id] = RouteScore.of(
            episode.route_id, result.scenario, [taken], digest="", fingerprint=FINGERPRINT
        )
    return Snapshot(label, {key: Cell(*key, spec, routes) for key, routes in cells.items()})
