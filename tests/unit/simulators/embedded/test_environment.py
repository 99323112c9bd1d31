"""The embedded world by gymnasium's conventions."""

from __future__ import annotations

import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.error import InvalidAction
from gymnasium.utils.env_checker import check_env

import pytest_drive_robust.simulators.gymnasium_ids  # noqa: F401 -- registers the id
from pytest_drive_robust import CameraSpec
from pytest_drive_robust.domain.outcome import End
from pytest_drive_robust.errors import SimulationError, UnknownNameError, UsageError
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.environment import WorldEnv
from pytest_drive_robust.simulators.embedded.geometry import place
from pytest_drive_robust.simulators.embedded.route_sets import DEFAULT_SET, named_routes

CAMERAS = (
    CameraSpec("front", width_px=64, height_px=36),
    CameraSpec("slow", width_px=32, height_px=18, rate_hz=5.0),
)
ROUTES = [route.id for route in named_routes(DEFAULT_SET)]


def controls(seed, count):
    rng = np.random.Generator(np.random.Philox(seed))
    return [np.array([rng.uniform(0.2, 0.9), rng.normal(0.0, 0.05), 0.0], np.float32) for _ in range(count)]


def rollout(env, actions):
    """Everything that the environment says to `actions`, as plain values."""
    told = []
    for action in actions:
        observed, reward, terminated, truncated, info = env.step(action)
        told.append(({name: value.tolist() for name, value in observed.items()}, reward, terminated, truncated, info))
    return told


@pytest.mark.parametrize("cameras", [(), CAMERAS], ids=["blind", "cameras"])
def test_gymnasium_finds_nothing_to_complain_about(cameras):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make("drive_robust/World-v0", cameras=cameras, render_mode="rgb_array")
        check_env(env.unwrapped)


def test_it_is_registered_under_its_name():
    env = gymnasium.make("drive_robust/World-v0")
    observed, info = env.reset(seed=3, options={"route": ROUTES[1]})
    assert info["route"] == ROUTES[1]
    assert observed["speed"].shape == (1,)
    assert set(info) == {"route", "progress_m", "infractions", "end", "is_success"}
    env.close()


def test_routes_are_named_as_on_the_command_line_or_given():
    shown = [route.id for route in named_routes("dev10")[:2]]
    for routes in (named_routes("dev10")[:2], f"dev10:{','.join(shown)}"):
        env = gymnasium.make("drive_robust/World-v0", routes=routes)
        for route in shown:
            assert env.reset(options={"route": route})[1]["route"] == route
        with pytest.raises(UnknownNameError, match="route of this environment"):
            env.reset(options={"route": "2901"})
    with pytest.raises(UnknownNameError, match=r"nothing\.xml"):
        gymnasium.make("drive_robust/World-v0", routes="nothing.xml")


def test_progress_is_rewarded():
    env = WorldEnv()
    _, info = env.reset(seed=3, options={"route": ROUTES[0]})
    told = rollout(env, controls(0, 60))
    total = sum(reward for _, reward, *_ in told)
    gained = told[-1][-1]["progress_m"] - info["progress_m"]
    assert gained > 3.0
    assert total == pytest.approx(gained - 10.0 * told[-1][-1]["infractions"])


def test_a_collision_costs():
    """Full throttle and no eyes: on some route something is in the way."""
    env = WorldEnv()
    for route in ROUTES:
        env.reset(seed=0, options={"route": route})
        for _ in range(300):
            _, reward, terminated, _, info = env.step(np.array([0.8, 0.0, 0.0], np.float32))
            if info["infractions"]:
                assert reward < -5.0
                assert not info["is_success"]
                return
            if terminated:
                break
    pytest.fail("no route has anything to hit")


@pytest.mark.parametrize("right_m", [0.0, 4.0])
def test_metres_outside_the_lanes_are_no_success(right_m):
    route = next(each for each in named_routes("full") if each.scenario.type == "ParkedObstacle")
    env = WorldEnv([route])
    env.reset(seed=0)
    world = env._simulator.world
    world.state.actor_ints[:, c.I_ACTIVE] = 0
    s_m, over = 0.0, False
    while not over:
        s_m += 0.4
        aside_m = right_m if 20.0 < s_m < 50.0 else 0.0
        world.state.ego[[c.EGO_X, c.EGO_Y, c.EGO_YAW]] = place(world.dense.rows[:, :3], s_m, aside_m)
        world.state.ego[c.EGO_V] = 8.0
        _, _, over, _, info = env.step(np.zeros(3, np.float32))
    assert info["end"] == End.COMPLETED.value
    assert info["infractions"] == 0
    assert info["is_success"] is (right_m == 0.0)


def test_the_same_seed_is_the_same_episode_and_the_same_next_ones():
    def driven():
        env = WorldEnv()
        first = env.reset(seed=11)[1]["route"], rollout(env, controls(1, 20))
        second = env.reset()[1]["route"], rollout(env, controls(1, 20))
        return first, second

    assert driven() == driven()


def test_seeds_draw_different_routes():
    env = WorldEnv()
    assert len({env.reset(seed=seed)[1]["route"] for seed in range(6)}) > 2


@pytest.mark.parametrize(
    ("options", "message"),
    [({"route": "no-such-route"}, "route of this environment"), ({"rout": "1"}, "Did you mean 'route'")],
)
def test_options_that_mean_nothing_are_refused(options, message):
    with pytest.raises(UnknownNameError, match=message):
        WorldEnv().reset(options=options)


@pytest.mark.parametrize("route", ROUTES[:: max(1, len(ROUTES) // 4)][:4])
def test_branches_are_a_straight_run_bit_by_bit(route):
    env = WorldEnv(cameras=CAMERAS)
    env.reset(seed=5, options={"route": route})
    before, after, elsewhere = controls(2, 33), controls(3, 25), controls(4, 17)
    straight = rollout(env, [*before, *after])

    env.reset(seed=5, options={"route": route})
    assert rollout(env, before) == straight[:33]
    here = env.snapshot()
    other = rollout(env, elsewhere)
    for _ in range(2):
        env.restore(here)
        assert rollout(env, after) == straight[33:]
    env.restore(here)
    assert rollout(env, elsewhere) == other
    assert other != straight[33:50]


@pytest.mark.parametrize(
    ("cameras", "told"),
    [
        ([CameraSpec("speed")], "camera 'speed': another camera or a signal has this name"),
        ([CameraSpec("front"), CameraSpec("front")], "camera 'front': another camera or a signal has this name"),
        ([CameraSpec("front", width_px=0)], "camera 'front': width_px is 0, expected a whole number"),
    ],
)
def test_cameras_that_cannot_be_observed_are_refused_where_they_are_given(cameras, told):
    with pytest.raises(UsageError, match=told):
        gymnasium.make("drive_robust/World-v0", cameras=cameras)


def test_an_environment_without_routes_is_refused():
    with pytest.raises(UsageError, match="no routes: give at least one"):
        gymnasium.make("drive_robust/World-v0", routes=[])


@pytest.mark.parametrize("action", [[np.nan, 0, 0], [np.inf, 0, 0], [0.5], 0.5, [[0.5, 0, 0]], [0.5, 0, 0, 0]])
def test_an_action_that_is_not_three_finite_numbers_is_refused(action):
    env = WorldEnv()
    env.reset(seed=0)
    with pytest.raises(InvalidAction, match="expected three finite numbers: throttle, steer, brake"):
        env.step(np.array(action, np.float32))
    observed, *_ = env.step(np.array([2.0, 0.0, -1.0], np.float32))  # clipped, and nothing of the refused one is left
    assert np.isfinite(observed["speed"]).all()


@pytest.mark.parametrize("action", [["a", "b", "c"], [None, 0, 0], [[1], 2, 3], None])
def test_an_action_that_is_no_array_of_numbers_is_refused(action):
    env = WorldEnv()
    env.reset(seed=0)
    with pytest.raises(InvalidAction, match="expected three finite numbers: throttle, steer, brake"):
        env.step(action)


def test_a_snapshot_of_another_episode_is_refused():
    env = WorldEnv()
    env.reset(seed=0)
    here = env.snapshot()
    env.reset(seed=0)
    with pytest.raises(SimulationError, match="of another episode"):
        env.restore(here)


def test_the_picture_is_a_bird_s_eye_view():
    env = WorldEnv(render_mode="rgb_array")
    env.reset(seed=0)
    picture = env.render()
    assert picture.dtype == np.uint8
    assert picture.shape == (512, 512, 3)
    assert picture.std() > 5
