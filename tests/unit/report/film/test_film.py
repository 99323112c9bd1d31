"""What is where on a picture of the film."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pytest_drive_robust.domain.agent import PlannedPath
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.report.film.canvas import CLEAN, MARK, PERTURBED, WRONG, Rectangle, text, text_width, wrapped
from pytest_drive_robust.report.film.film import Film
from pytest_drive_robust.report.film.top_view import PATH, SPEED_POINT, TARGET_POINT
from pytest_drive_robust.runner.replay.recording import Tape, record_episode
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.testing import FakeSimulator, ScriptedAgent, fake_route

Pixels = NDArray[np.uint8]
HIT = Infraction(InfractionKind.COLLISION_VEHICLE, 60, "hit van at 4.2 m/s", x_m=10.0, y_m=0.0)
LEFT_VIEW, RIGHT_VIEW = Rectangle(408, 66, 224, 394), Rectangle(1048, 66, 224, 394)
RIGHT_CAMERA = Rectangle(648, 90, 392, 221)


class Planner(ScriptedAgent):
    def plan(self) -> PlannedPath:
        return PlannedPath(((4.0, 0.0), (30.0, 0.0)), ((20.0, -6.0),), ((15.0, 6.0),))


def tape_of(setting: str, *, ticks: int = 80, infractions: tuple[Infraction, ...] = (), agent: Any = None) -> Tape:
    simulator = FakeSimulator(
        SimulatorOptions(tick_cap=4000), infractions=infractions, ends=End.TICK_CAP, ends_at=ticks
    )
    parsed = Setting.parse(setting)
    return record_episode(
        simulator,
        agent or Planner([Control(throttle=1.0)], cameras=(CameraSpec("front"),)),
        route=fake_route(length_m=200.0),
        setting=parsed,
        seed=0,
        agent_name="planner",
    )


@pytest.fixture(scope="module")
def tapes() -> tuple[Tape, Tape]:
    clean = tape_of("clean")
    perturbed = tape_of("3 s burst frame drop (probability=0.9) and 500 ms latency", ticks=100, infractions=(HIT,))
    return clean, perturbed


@pytest.fixture(scope="module")
def film(tapes: tuple[Tape, Tape]) -> Film:
    return Film(*tapes)


def count(picture: Pixels, box: Rectangle, colour: tuple[int, int, int], *, tolerance: int = 12) -> int:
    """How many pixels of the box have about that colour."""
    return int((abs(box.of(picture).astype(int) - colour).max(axis=2) <= tolerance).sum())


def test_a_picture_is_what_browsers_and_people_want(film: Film) -> None:
    picture = film.picture(0)
    assert picture.shape == (720, 1280, 3)
    assert picture.dtype == np.uint8


def test_the_same_position_gives_the_same_bits_and_another_one_does_not(film: Film, tapes: tuple[Tape, Tape]) -> None:
    assert (film.picture(30) == film.picture(30)).all()
    assert (film.picture(30) == Film(*tapes).picture(30)).all()
    assert (film.picture(30) != film.picture(50)).any()


def test_clean_is_left_and_perturbed_is_right(film: Film) -> None:
    picture = film.picture(0)
    assert tuple(picture[37, 320]) == CLEAN
    assert tuple(picture[37, 960]) == PERTURBED


def test_each_ego_has_the_colour_of_its_side_and_the_right_one_its_clean_twin(film: Film) -> None:
    picture = film.picture(40)
    assert count(picture, LEFT_VIEW, CLEAN) > 100
    assert count(picture, LEFT_VIEW, PERTURBED) == 0
    assert count(picture, RIGHT_VIEW, PERTURBED) > 100
    assert count(picture, RIGHT_VIEW, CLEAN) > 40


def test_the_plan_has_the_colours_of_the_paper(film: Film) -> None:
    picture = film.picture(40)
    for colour, least in ((PATH, 50), (TARGET_POINT, 30), (SPEED_POINT, 10)):
        assert count(picture, LEFT_VIEW, colour) >= least


def test_points_of_the_plan_lie_where_they_are_meant(film: Film) -> None:
    picture = film.picture(40)
    blue = np.argwhere(abs(LEFT_VIEW.of(picture).astype(int) - TARGET_POINT).max(axis=2) < 12).mean(axis=0)
    # 20 m ahead of the ego and 6 m to its left, at 8 pixels a metre; the ego stands 24 % from the bottom
    assert blue[0] == pytest.approx(394 * 0.76 - 160, abs=3.0)
    assert blue[1] == pytest.approx(112 - 48, abs=3.0)


def test_a_stale_picture_is_framed_in_red_and_what_is_there_stands_beside_it(film: Film, tapes: Any) -> None:
    stale = next(k for k in range(50, 100) if k - tapes[1].images(k)["front"][1] > 10)
    picture = film.picture(stale)
    assert tuple(picture[RIGHT_CAMERA.y + 3, RIGHT_CAMERA.x + 3]) == WRONG
    assert tuple(picture[RIGHT_CAMERA.bottom - 4, RIGHT_CAMERA.right - 4]) == WRONG
    inset = Rectangle(RIGHT_CAMERA.right - 153, RIGHT_CAMERA.bottom + 62, 153, 86)
    assert tuple(picture[inset.y, inset.x + 120]) == (240, 240, 240)
    fresh = Rectangle(8, 90, 392, 221)
    assert count(picture, fresh, WRONG, tolerance=2) == 0


def test_the_first_divergence_is_flagged_when_it_comes_and_marked_for_ever(film: Film) -> None:
    assert film.story.divergence is not None
    at = film.story.divergence[0]
    assert tuple(film.picture(at - 1)[5, 5]) != MARK
    assert tuple(film.picture(at)[5, 5]) == MARK
    assert tuple(film.picture(film.story.length)[5, 5]) != MARK
    strips = Rectangle(0, 466, 1280, 254)
    for position in (0, film.story.length):
        assert count(film.picture(position), strips, MARK) > 100


def test_an_infraction_is_told_from_its_tick_on(film: Film) -> None:
    captions = Rectangle(648, 373, 230, 86)
    assert count(film.picture(59), captions, WRONG) == 0
    assert count(film.picture(60), captions, WRONG) > 3000
    later = film.picture(95)  # then it is only a line
    assert 0 < count(later, captions, WRONG) < 500


def test_an_infraction_has_a_broken_ring_before_its_tick_and_a_whole_one_from_then_on(film: Film) -> None:
    broken, whole = (count(film.picture(position), RIGHT_VIEW, WRONG) for position in (59, 60))
    assert 50 < broken < 0.7 * whole
    assert whole > 200
    assert count(film.picture(60), LEFT_VIEW, WRONG) == 0


def test_the_shorter_episode_waits_at_its_end_with_its_reason(film: Film) -> None:
    first, last = film.picture(80), film.picture(100)
    half = Rectangle(0, 66, 636, 394)
    assert (half.of(first) == half.of(last)).all()
    assert (Rectangle(640, 66, 636, 394).of(first) != Rectangle(640, 66, 636, 394).of(last)).any()
    captions = Rectangle(8, 373, 392, 86)
    assert count(film.picture(79), captions, WRONG) == 0
    assert count(first, captions, WRONG) > 3000


def test_the_strips_dim_what_is_still_to_come(film: Film) -> None:
    strips = Rectangle(600, 500, 600, 196)
    assert count(film.picture(0), strips, PERTURBED) == 0
    assert count(film.picture(100), strips, PERTURBED) > 200


def test_one_tape_alone_stands_in_the_middle(tapes: tuple[Tape, Tape]) -> None:
    picture = Film(tapes[0]).picture(10)
    assert tuple(picture[37, 640]) == CLEAN
    assert not picture[66:460, :300].std(axis=(0, 1)).any()


def test_an_agent_without_cameras_is_filmed_all_the_same() -> None:
    tape = tape_of("clean", ticks=20, agent=ScriptedAgent([Control(throttle=1.0)]))
    picture = Film(tape).picture(10)
    assert picture[120:300, 340:700].std() > 5.0


def test_many_cameras_share_the_panel() -> None:
    names = ("front_left", "front", "front_right", "back")
    agent = ScriptedAgent([Control(throttle=1.0)], cameras=[CameraSpec(name) for name in names])
    tape = tape_of("clean", ticks=20, agent=agent)
    picture = Film(tape).picture(10)
    thumbnails = picture[255:305, 330:710]
    assert all(thumbnails[:, k * 130 : k * 130 + 100].std() > 5.0 for k in range(3))


def test_a_wrong_gps_is_crossed_where_the_agent_believes_to_be() -> None:
    tape = tape_of("clean", ticks=20)
    moments = [replace(m, gps=(m.state.ego.x_m + 10.0, 5.0)) for m in tape.moments]
    told, right = Film(replace(tape, moments=tuple(moments))).picture(10), Film(tape).picture(10)
    view = Rectangle(728, 66, 224, 394)
    place = np.argwhere((view.of(told) != view.of(right)).any(axis=2)).mean(axis=0)
    assert place == pytest.approx((394 * 0.76 - 80, 112 + 40), abs=4.0)


def test_how_far_the_gps_is_off_stands_below_the_speed() -> None:
    tape = tape_of("clean", ticks=20)
    moments = [replace(m, gps=(m.state.ego.x_m + 10.0, m.state.ego.y_m)) for m in tape.moments]
    below_speed = Rectangle(328, 359, 200, 13)
    assert count(Film(replace(tape, moments=tuple(moments))).picture(10), below_speed, WRONG) > 30
    assert count(Film(tape).picture(10), below_speed, WRONG) == 0


def test_the_sheet_holds_the_telling_moments_two_in_a_row(film: Film) -> None:
    sheet = film.sheet()
    moments = film.story.telling()
    assert sheet.shape == (720 * ((len(moments) + 1) // 2), 2560, 3)
    assert (sheet[:720, :1280] == film.picture(moments[0])).all()
    assert (sheet[:720, 1280:] == film.picture(moments[1])).all()


def test_pictures_that_stand_still_are_made_once(film: Film) -> None:
    shown = [id(picture) for picture, _ in zip(film.pictures(), range(40), strict=False)]
    assert len(set(shown)) < 40


def test_text_keeps_to_its_width_and_says_when_it_was_cut() -> None:
    canvas = np.zeros((60, 400, 3), np.uint8)
    assert text(canvas, "a very long sentence about something " * 4, (5, 40), within=300) <= 300
    assert not canvas[:, 310:].any()
    assert text(canvas, "", (5, 40), within=10) == 0


def test_text_is_wrapped_at_blanks() -> None:
    lines = wrapped("outside its lanes for 8 m, 7 % of the way", size=0.6, within=200)
    assert len(lines) == 2
    assert " ".join(lines) == "outside its lanes for 8 m, 7 % of the way"
    assert text_width(lines[0], 0.6) <= 200


def test_the_second_of_the_last_moments_leaves_the_numbers_of_the_axis_alone(film: Film) -> None:
    numbers = Rectangle(1232, 502, 28, 18)
    for position in range(film.story.length - 15, film.story.length + 1):
        now = 118 + round(1145 * position / film.story.length)
        beside = film.picture(position)[numbers.y : numbers.bottom, numbers.x : min(numbers.right, now - 3)]
        assert not (beside > 200).all(axis=2).any()


def test_an_impact_is_told_in_the_unit_of_the_speed_beside_it(film: Film) -> None:
    assert [event.words for event in film.story.events[1]] == ["hit van at 15 km/h"]
