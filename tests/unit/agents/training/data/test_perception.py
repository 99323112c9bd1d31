"""Boxes, their futures and map vectors, against the world that they were taken from."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from privileged_scene import actor, street
from training_drives import route_of, samples_of

from drive_robust_agents.training.data.labels import to_ego
from drive_robust_agents.training.data.perception import (
    CROSSWALK,
    LANE,
    ROUTE,
    SOLID,
    STOP,
    STRIPED,
    MapLines,
    box_labels,
)
from drive_robust_agents.training.data.rigs import agent_rig
from drive_robust_agents.training.data.rollouts import Sample
from drive_robust_agents.training.data.rows import RigCameras, rows
from pytest_drive_robust.domain.truth import ActorKind, LightState, WorldState

LIGHT = "VanillaSignalizedTurnEncounterRedLight"


@pytest.fixture(scope="module")
def samples() -> tuple[Sample, ...]:
    return samples_of(LIGHT)


def moved(state: WorldState, *, tick: int, ahead_m: float) -> WorldState:
    """The state later, with everybody farther along x; who is behind 60 m is gone."""
    actors = state.actors.copy()
    actors[:, WorldState.X] += ahead_m
    return replace(state, tick=tick, actors=actors[actors[:, WorldState.X] < 60.0])


def test_boxes_are_in_the_ego_frame_nearest_first() -> None:
    truth = street(actor(50.0, -3.5, speed_mps=5.0, yaw_rad=math.pi), actor(30.0, 0.0, speed_mps=2.0), x_m=20.0)
    found = box_labels([truth.state], {0, 1})
    assert found["boxes"][:, 8].tolist() == [1.0, 1.0] + [0.0] * 22
    assert found["boxes"][0] == pytest.approx([10.0, 0.0, 0.0, 1.0, 4.6, 1.9, 2.0, ActorKind.CAR, 1.0])
    assert found["boxes"][1, :4] == pytest.approx([30.0, -3.5, 0.0, -1.0], abs=1e-6)
    assert np.isnan(found["box_future"]).all()  # nothing is known of what comes


def test_only_who_is_seen_and_near_is_a_box() -> None:
    truth = street(actor(30.0, 0.0), actor(40.0, 0.0), actor(90.0, 0.0), x_m=20.0)
    assert box_labels([truth.state], {1, 2})["boxes"][:, 0].tolist()[:2] == [20.0, 0.0]


def test_the_future_of_a_box_is_where_it_is_later_until_it_is_gone() -> None:
    state = street(actor(50.0, -3.5, speed_mps=8.0), x_m=20.0).state
    states = [moved(state, tick=tick, ahead_m=0.4 * tick) for tick in range(61)]
    future = box_labels(states, {0})["box_future"][0]
    assert future[:2] == pytest.approx(np.array([[34.0, -3.5], [38.0, -3.5]]))
    assert np.isnan(future[2:]).all()  # beyond 60 m


def test_a_number_that_jumps_is_somebody_else() -> None:
    state = street(actor(30.0, 0.0, speed_mps=8.0), x_m=20.0).state
    states = [moved(state, tick=tick, ahead_m=0.0 if tick < 15 else 25.0) for tick in range(61)]
    future = box_labels(states, {0})["box_future"][0]
    assert future[0] == pytest.approx([10.0, 0.0])
    assert np.isnan(future[1:]).all()


def test_boxes_of_a_drive_lie_where_the_actors_are(samples: tuple[Sample, ...]) -> None:
    seen_any = 0
    for sample in samples[::10]:
        state = sample.states[0]
        found = box_labels(sample.states, set(state.actors[:, WorldState.ID].astype(int)))
        for box, future in zip(found["boxes"], found["box_future"], strict=True):
            if box[8] == 0.0:
                continue
            places = to_ego(state.ego, state.actors[:, [WorldState.X, WorldState.Y]])
            k = int(np.argmin(np.hypot(*(places - box[:2]).T)))
            assert places[k] == pytest.approx(box[:2], abs=1e-4)
            number = state.actors[k, WorldState.ID]
            for step, tick in enumerate((10, 20, 30, 40, 50, 60)):
                if np.isfinite(future[step, 0]):
                    later = sample.states[tick].actors
                    row = later[later[:, WorldState.ID] == number][0]
                    assert to_ego(state.ego, row[[WorldState.X, WorldState.Y]]) == pytest.approx(future[step], abs=1e-4)
                    seen_any += 1
    assert seen_any > 10


def test_who_stands_behind_somebody_else_is_not_seen(samples: tuple[Sample, ...]) -> None:
    truth = samples[0].here.truth
    row = np.array(actor(0.0, 0.0, kind=ActorKind.CAR))
    ego = truth.state.ego
    c, s = math.cos(ego.yaw_rad), math.sin(ego.yaw_rad)
    behind = [
        (10.0, 3.0, 3.5, ActorKind.TRUCK),
        (30.0, 0.5, 0.6, ActorKind.PEDESTRIAN),
        (8.0, 0.5, 0.6, ActorKind.CONE),
    ]
    actors = []
    for number, (ahead, width, height, kind) in enumerate(behind):
        right = 0.0 if kind is not ActorKind.CONE else 4.0
        one = row.copy()
        one[[WorldState.ID, WorldState.KIND, WorldState.YAW, WorldState.WIDTH, WorldState.HEIGHT]] = (
            number,
            kind,
            ego.yaw_rad,
            width,
            height,
        )
        one[[WorldState.X, WorldState.Y]] = ego.x_m + c * ahead - s * right, ego.y_m + s * ahead + c * right
        actors.append(one)
    state = replace(truth.state, actors=np.array(actors))
    eyes = RigCameras(truth.lane_map, route_of(LIGHT), truth.route, agent_rig("tcp").cameras)
    assert eyes.seen(state) == {0, 2}


# --- the map ---


def lines_of(samples: tuple[Sample, ...], at: int) -> list[tuple[int, np.ndarray]]:
    here = samples[at].here
    found = MapLines(here.truth.lane_map).labels(here)
    kinds, lanes = found["lane_kind"], found["lanes"]
    assert np.isnan(lanes[kinds < 0]).all()
    assert np.isfinite(lanes[kinds >= 0]).all()
    return [(int(kind), line) for kind, line in zip(kinds, lanes, strict=True) if kind >= 0]


def test_map_vectors_keep_to_the_window_and_the_route_comes_first(samples: tuple[Sample, ...]) -> None:
    found = lines_of(samples, 0)
    assert found[0][0] == ROUTE
    assert [kind for kind, _ in found].count(ROUTE) == 1
    assert {LANE, SOLID} <= {kind for kind, _ in found}
    assert {kind for kind, _ in found} <= {ROUTE, LANE, STRIPED, SOLID, STOP, CROSSWALK}
    for _, line in found:
        assert line[:, 0].min() > -16.0
        assert line[:, 0].max() < 64.0
        assert np.abs(line[:, 1]).max() < 32.0


def test_the_route_vector_lies_on_the_route(samples: tuple[Sample, ...]) -> None:
    for at in range(0, len(samples), 15):
        here = samples[at].here
        route = to_ego(here.ego, here.truth.route)
        for point in lines_of(samples, at)[0][1]:
            assert np.hypot(*(route - point).T).min() < 0.6  # between two rows of it


def test_a_stop_line_is_there_while_it_holds(samples: tuple[Sample, ...]) -> None:
    truth = street(speed_mps=8.0, light=(60.0, LightState.RED))
    here = replace(samples[0].here, truth=truth)
    red = [line for kind, line in labels_of(here) if kind == STOP]
    assert len(red) == 1
    assert red[0][:, 0] == pytest.approx(40.0)
    assert (red[0][0, 1], red[0][-1, 1]) == pytest.approx((-1.75, 1.75))
    green = replace(here, truth=street(speed_mps=8.0, light=(60.0, LightState.GREEN)))
    assert STOP not in [kind for kind, _ in labels_of(green)]


def labels_of(here) -> list[tuple[int, np.ndarray]]:
    found = MapLines(here.truth.lane_map).labels(here)
    return list(zip(found["lane_kind"].tolist(), found["lanes"], strict=True))


def test_edges_lie_half_a_lane_beside_its_middle(samples: tuple[Sample, ...]) -> None:
    found = labels_of(replace(samples[0].here, truth=street()))
    kinds = dict(reversed(found))
    assert kinds[ROUTE][:, 1] == pytest.approx(0.0)
    assert kinds[STRIPED][:, 1] == pytest.approx(-1.75)
    assert abs(kinds[SOLID][0, 1]) == pytest.approx(1.75)


# --- rows ---


def test_rows_of_agents_that_learn_perception_hold_it_and_others_do_not(samples: tuple[Sample, ...]) -> None:
    perception = {"boxes", "box_future", "lanes", "lane_kind"}
    for agent in ("tcp", "vad"):
        row = next(rows(samples[:1], route_of(LIGHT), agent_rig(agent), tag=3, episode=7))
        assert perception & set(row) == (perception if agent == "vad" else set())
        cameras = {f"cam_{camera.name}": (camera.height_px, camera.width_px, 3) for camera in agent_rig(agent).cameras}
        assert {name: row[name].shape for name in row if name.startswith("cam_")} == cameras
        assert (row["tag"], row["episode"], row["tick"], row["source"]) == (3, 7, samples[0].tick, samples[0].source)
