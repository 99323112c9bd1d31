"""What was around the ego is kept beside an episode, and changes nothing of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pytest_drive_robust.domain.agent import PlannedPath
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.truth import EgoState, WorldState
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.episode.surroundings import Surroundings
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.store.track_bytes import pack_tracks, unpack_tracks
from pytest_drive_robust.testing import FakeSimulator, ScriptedAgent, fake_route

EGO = EgoState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.9, 1.8)


def car(number: int, x: float, y: float = 0.0, yaw: float = 0.0) -> list[float]:
    return [number, 0, x, y, yaw, 5.0, 4.6, 1.9, 1.5, 0]


def state(tick: int, *actors: list[float]) -> WorldState:
    return WorldState(tick, EGO, np.array(actors).reshape(-1, 10), np.array([2, 0]))


def seen(*states: WorldState) -> Surroundings:
    surroundings = Surroundings()
    for item in states:
        surroundings.see(item)
    return surroundings


class Planner(ScriptedAgent):
    """Plans straight on; `breaks` makes its plan raise."""

    def __init__(self, breaks: BaseException | None = None) -> None:
        super().__init__([Control(throttle=1.0)])
        self.breaks = breaks
        self.calls = 0

    def plan(self) -> PlannedPath:
        self.calls += 1
        if self.breaks is not None:
            raise self.breaks
        return PlannedPath(path=tuple((float(step), 0.5) for step in range(30)), target_points=((20.0, -1.0),))


def drive(agent):
    return drive_episode(
        FakeSimulator(SimulatorOptions(tick_cap=60)),
        agent,
        route=fake_route("1"),
        setting=Setting.CLEAN,
        seed=0,
        agent_name="planner",
    )


def test_actors_are_kept_in_centimetres_at_5_hz():
    tracks = seen(state(0, car(1, 10.0), car(2, -5.0, 1.234)), state(4, car(1, 11.0), car(2, -5.0, 1.234))).tracks()
    assert tracks.every_ticks == 4
    assert tracks.actors.tolist() == [[1, 0, 460, 190, 0, 2], [2, 0, 460, 190, 0, 2]]
    assert tracks.motion.tolist() == [[1000, 0, 0, 0], [1100, 0, 0, 0], [-500, 123, 0, 0], [-500, 123, 0, 0]]
    assert tracks.lights.tolist() == [[2, 0], [2, 0]]


def test_an_actor_that_goes_away_and_comes_back_has_two_tracks():
    tracks = seen(state(0, car(1, 10.0)), state(4), state(8, car(1, 30.0))).tracks()
    assert tracks.actors[:, 4:].tolist() == [[0, 1], [2, 1]]


@pytest.mark.parametrize("actors", [[], [car(1, 500.0)]], ids=["nobody", "nobody near"])
def test_a_road_without_anybody_has_lights_all_the_same(actors):
    tracks = seen(state(0, *actors), state(4, *actors)).tracks()
    assert [len(tracks.actors), len(tracks.motion)] == [0, 0]
    assert tracks.lights.tolist() == [[2, 0], [2, 0]]
    back = unpack_tracks(pack_tracks(tracks))
    assert [back.actors.shape, back.motion.shape, back.lights.tolist()] == [(0, 6), (0, 4), tracks.lights.tolist()]


def test_far_actors_are_left_out_and_yaw_does_not_jump():
    tracks = seen(
        state(0, car(1, 500.0), car(2, 5.0, yaw=3.1)), state(4, car(1, 500.0), car(2, 5.0, yaw=-3.1))
    ).tracks()
    assert tracks.actors[:, 0].tolist() == [2]
    assert np.diff(tracks.motion[:, 2]).tolist() == [83]


def test_tables_that_are_no_such_tables_leave_nothing():
    odd = replace(state(0), actors=np.zeros((2, 3)))
    assert seen(odd).tracks() is None
    assert Surroundings().tracks() is None


def test_a_table_of_another_width_leaves_nothing_and_harms_nothing():
    other = replace(state(4, car(1, 0.0)), actors=np.zeros((1, 7)))
    assert seen(state(0, car(1, 0.0)), other, state(8, car(1, 1.0))).tracks() is None


@pytest.mark.parametrize("table", [np.zeros((2000, 7)), [], None], ids=["more and wider", "a list", "nothing"])
def test_a_table_that_has_no_room_beside_the_others_harms_nothing(table):
    other = replace(state(4, car(1, 0.0)), actors=table)
    assert seen(other, state(8, car(1, 0.0))).tracks() is None
    assert seen(state(0, car(1, 0.0)), other, state(8, car(1, 1.0))).tracks() is None


def test_any_number_of_actors_finds_room():
    many = [car(number, float(number % 50)) for number in range(700)]
    tracks = seen(*(state(tick, *many) for tick in (0, 4, 8))).tracks()
    assert tracks is not None
    assert tracks.actors[:, 5].tolist() == [3] * 700
    assert tracks.motion[:, 0].tolist() == [100 * (number % 50) for number in range(700) for _ in range(3)]


def test_a_plan_is_kept_every_eight_ticks_with_few_points():
    agent = Planner()
    tracks = drive(agent).tracks
    assert agent.calls == 8
    assert tracks.plans.tolist() == [[tick, 9, 1, 0] for tick in range(0, 60, 8)]
    first = tracks.points[:10].tolist()
    assert first == [[0, 5], [40, 5], [80, 5], [120, 5], [160, 5], [200, 5], [240, 5], [280, 5], [290, 5], [200, -10]]


@pytest.mark.parametrize("error", [RuntimeError("no plan"), SystemExit(3)], ids=["raises", "exits"])
def test_a_plan_that_breaks_is_asked_for_once_and_harms_nothing(error):
    agent = Planner(error)
    result = drive(agent)
    assert agent.calls == 1
    assert len(result.tracks.plans) == 0
    assert result.trace.digest == drive(Planner()).trace.digest
    assert result.end == drive(ScriptedAgent([Control(throttle=1.0)])).end


@pytest.mark.parametrize("points", [((float("nan"), 0.0),), ((1e9, 0.0),), (("x", 0.0),), 7], ids=str)
def test_a_plan_of_no_points_is_left_out(points):
    agent = Planner()
    agent.plan = lambda: PlannedPath(path=points)  # type: ignore[method-assign]
    result = drive(agent)
    assert result.tracks is None or len(result.tracks.plans) == 0


def test_a_plan_is_copied_when_it_is_seen() -> None:
    class Reusing(Planner):
        def plan(self) -> PlannedPath:
            self.calls += 1
            self.buffer = getattr(self, "buffer", None) or [[0.0, 0.0]]
            self.buffer[0][0] = float(self.calls)
            return PlannedPath(path=self.buffer)  # type: ignore[arg-type]

    tracks = drive(Reusing()).tracks
    assert tracks is not None
    ahead = tracks.points[:, 0]
    assert len(ahead) > 2
    assert len(set(ahead.tolist())) == len(ahead)
