"""Scenes for viewers: an episode and its clean twin over time.

Positions are in metres: x to the east, y to the north (the y of simulators points south), z up. Yaw is
counter-clockwise from east. Times are seconds from the start.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pytest_drive_robust.domain.geodesy import to_geodetic
from pytest_drive_robust.domain.result import Given
from pytest_drive_robust.domain.truth import ActorKind, LightState
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.report.numbers import legible
from pytest_drive_robust.report.road_map import RoadMaps, map_data
from pytest_drive_robust.simulators.embedded.actors import SIZES
from pytest_drive_robust.verdict.explain import describe_outcome, infraction_s
from pytest_drive_robust.verdict.infraction_words import infraction_words

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.results.run import Run

    Floats = NDArray[np.float64]

Colour = tuple[int, int, int]

_EGO = {"clean": (31, 119, 196), "perturbed": (221, 107, 16)}
_ROAD, _ROUTE, _ACTOR, _PERSON = (120, 120, 130), (70, 160, 90), (150, 150, 160), (194, 37, 92)
_LIGHTS = {LightState.GREEN: (47, 158, 68), LightState.YELLOW: (245, 190, 30)}
_RED = (224, 49, 49)
_EGO_HEIGHT_M = 1.5
_LONGEST_NAME = 200  # bytes, of the 255 that a name has on usual disks
_PLOTTED = ("speed_mps", "forward_mps2", "right_mps2", "yaw_rate_radps", "throttle", "steer", "brake", "progress_m")


class Pose(NamedTuple):
    """The pose of a frame or box in the world."""

    x_m: float
    y_m: float
    yaw_rad: float

    @property
    def turned(self) -> tuple[float, float]:
        """The z and w of the pose's quaternion; x and y are 0."""
        return math.sin(self.yaw_rad / 2.0), math.cos(self.yaw_rad / 2.0)


class Place(NamedTuple):
    """A point on the earth; the maps of the simulators lie around (0, 0)."""

    latitude_deg: float
    longitude_deg: float


class Values(dict[str, float]):
    """Numbers to plot, by name."""


class Note(NamedTuple):
    """A line of the log; `bad` marks an infraction."""

    text: str
    bad: bool


class Box(NamedTuple):
    """The box of the ego or an actor; `pose` is the centre of its base, `size_m` its length, width and height."""

    name: str
    pose: Pose
    size_m: tuple[float, float, float]
    colour: Colour


class Lines(NamedTuple):
    """Lines on the ground in one colour and width; each line is (points, 2) in metres."""

    lines: list[Floats]
    colour: Colour
    width_m: float


class Shapes(NamedTuple):
    """All shapes that a path shows from a moment on, in the ego frame named `frame`, or in the world frame if ""."""

    boxes: list[Box]
    lines: list[Lines]
    frame: str = ""


Item = tuple[float, str, "Pose | Place | Values | Note | Shapes"]
"""The second from which a thing is shown, its path such as `clean/actors`, and the thing."""


@dataclass(frozen=True)
class Scene:
    """The content of one file: the episodes named `clean` and `perturbed`, and the world in the form of `map_data`."""

    title: str
    episodes: dict[str, EpisodeResult]
    world: dict[str, Any]

    @property
    def file_name(self) -> str:
        """The title as a file name without a suffix, unique for each title and short enough for a disk."""
        plain = re.sub(r"[^\w.+-]+", "-", self.title).strip("-")
        if plain.replace("-", " ") == self.title and len(plain.encode()) <= _LONGEST_NAME:
            return plain
        digest = hashlib.blake2b(self.title.encode(), digest_size=4).hexdigest()
        return f"{plain.encode()[: _LONGEST_NAME - 9].decode(errors='ignore')}-{digest}"

    def items(self) -> list[Item]:
        """Return all items of the scene, sorted by time."""
        found: list[Item] = [(0.0, "road", Shapes([], self._road()))]
        for name, result in self.episodes.items():
            found += [*self._ego(name, result), *self._around(name, result), *_plans(name, result)]
            found += _notes(name, result)
        return sorted(found, key=lambda item: item[0])

    def _road(self) -> list[Lines]:
        route = [_points(self.world["route"])] if self.world else []
        lines = [_points([*corners, *corners[:2]]) for corners in self.world.get("crossings", ())]
        for _, junction, width, left, right, centre in self.world.get("lanes", ()):
            if not junction and len(centre) > 2:
                sides = [side for line, side in ((left, 0.005), (right, -0.005)) if line]
                lines += [_beside(_points(centre), side * width) for side in sides]
        return [Lines(lines, _ROAD, 0.12), Lines(route, _ROUTE, 0.12)]

    def _ego(self, name: str, result: EpisodeResult) -> Iterator[Item]:
        """Yield the ego at the end of each tick, and the location that the agent was given."""
        length, width = (size / 100.0 for size in self.world.get("ego", (490, 185)))
        box = Box(name, Pose(0.0, 0.0, 0.0), (length, width, _EGO_HEIGHT_M), _EGO[name])
        yield 0.0, f"{name}/ego", Shapes([box], [], frame=name)
        names = result.trace.COLUMNS
        for number, row in enumerate(result.trace.rows.tolist(), 1):
            ego, second = dict(zip(names, row, strict=True)), number * result.dt_s
            yield second, f"{name}/ego", Pose(ego["x_m"], -ego["y_m"], -ego["yaw_rad"])
            yield second, f"{name}/location", Place(*to_geodetic(ego["x_m"], ego["y_m"]))
            yield second, f"{name}/state", Values({key: ego[key] for key in _PLOTTED})
        for row in () if result.given is None else result.given.rows[:, : len(Given.COLUMNS)].tolist():
            yield row[0] * result.dt_s, f"{name}/told", Place(*to_geodetic(row[1], row[2]))

    def _around(self, name: str, result: EpisodeResult) -> Iterator[Item]:
        """Yield the actors and the stop lines of each sample of the tracks."""
        tracks, row = result.tracks, 0
        if tracks is None:
            return
        seen: list[list[Box]] = [[] for _ in tracks.lights]
        for actor, kind, length, width, first, count in tracks.actors.tolist():
            colour = _PERSON if kind in (ActorKind.PEDESTRIAN, ActorKind.BICYCLE) else _ACTOR
            size = (length / 100.0, width / 100.0, SIZES[ActorKind(kind)].height_m)
            for place, (x, y, yaw, _) in enumerate(tracks.motion[row : row + count].tolist(), first):
                pose = Pose(x / 100.0, -y / 100.0, -yaw / 1000.0)
                seen[place].append(Box(f"{ActorKind(kind).name.lower()} {actor}", pose, size, colour))
            row += count
        stops = [_across(*stop[:4]) for stop in self.world.get("stops", ())]
        for place, lights in enumerate(tracks.lights.tolist()):
            colours = [_LIGHTS.get(LightState(light), _RED) for light in lights]
            lines = [Lines([stop], colour, 0.4) for stop, colour in zip(stops, colours, strict=False)]
            yield place * tracks.every_ticks * result.dt_s, f"{name}/actors", Shapes(seen[place], lines)


def scenes_of(run: Run) -> Iterator[Scene]:
    """Yield a scene for each episode under a failure, and for each clean episode that no other scene shows as a twin.

    Raises `UsageError` when no episode of the run has a trace.
    """
    twins = {id(run.twin(result)) for result in run.episodes if len(result.trace.rows)}
    chosen = [result for result in run.episodes if id(result) not in twins]
    shown = [result for result in chosen if len(result.trace.rows)]
    if chosen and not any(result.ticks for result in chosen):
        raise UsageError(
            f"none of these episodes lasted a tick: {chosen[0].end_detail or describe_outcome(chosen[0])}."
        )
    if not shown:
        raise UsageError("none of these episodes is in the store. Name it with --episodes, or drive them again.")
    maps = RoadMaps(run.records.simulator)
    try:
        for result in shown:
            episode, twin = result.episode, run.twin(result)
            truth = maps.truth(run.records.route(episode.route_id), episode.seed)
            episodes = {"clean" if run.records.is_clean(episode.setting) else "perturbed": result}
            if twin is not None and len(twin.trace.rows):
                episodes = {"clean": twin, **episodes}
            words = (episode.route_id, result.scenario, episode.setting, episode.agent, f"seed {episode.seed}")
            yield Scene(legible(" ".join(words)), episodes, {} if truth is None else map_data(truth))
    finally:
        maps.close()


def _plans(name: str, result: EpisodeResult) -> Iterator[Item]:
    """Yield the plans of the agent, placed where the ego was when the agent made the plan."""
    tracks, row = result.tracks, 0
    if tracks is None:
        return
    places = np.column_stack(result.trace.columns("x_m", "y_m", "yaw_rad"))
    for tick, path, targets, speeds in tracks.plans.tolist():
        ahead, right = (tracks.points[row : row + (path or targets or speeds)] / 10.0).T
        row += path + targets + speeds
        x, y, yaw = places[min(max(tick - 1, 0), len(places) - 1)]
        east = x + ahead * np.cos(yaw) - right * np.sin(yaw)
        south = y + ahead * np.sin(yaw) + right * np.cos(yaw)
        line = Lines([np.column_stack((east, -south))], _EGO[name], 0.25)
        yield tick * result.dt_s, f"{name}/plan", Shapes([], [line])


def _notes(name: str, result: EpisodeResult) -> Iterator[Item]:
    """Yield a note for each beginning of a failure, each infraction and the end of the episode."""
    dt_s, path = result.dt_s, f"{name}/log"
    for span in result.schedule:
        yield span.first_tick * dt_s, path, Note(legible(f"{span.perturbation} begins in {span.signal}"), bad=False)
    for item in result.infractions:
        second, told = infraction_s(item, dt_s), f"{item.kind.value}: {infraction_words(item.detail)}"
        yield result.game_s if second is None else second, path, Note(legible(told), bad=True)
    yield result.game_s, path, Note(legible(describe_outcome(result)), bad=False)


def _points(centimetres: list[int]) -> Floats:
    """Return centimetres x, y, x, y, ... (y to the south) as (points, 2) in metres (y to the north)."""
    points: Floats = np.array(centimetres, float).reshape(-1, 2) * (0.01, -0.01)
    return points


def _beside(points: Floats, left_m: float) -> Floats:
    along = np.gradient(points, axis=0)
    along /= np.maximum(np.hypot(*along.T), 1e-9)[:, None]
    moved: Floats = points + left_m * np.column_stack((-along[:, 1], along[:, 0]))
    return moved


def _across(x_cm: int, y_cm: int, heading_mrad: int, width_cm: int) -> Floats:
    """Return the ends of a line across a lane, (2, 2) in metres."""
    yaw, half_m = -heading_mrad / 1000.0, width_cm / 200.0
    left = np.array((-np.sin(yaw), np.cos(yaw))) * half_m
    ends: Floats = _points([x_cm, y_cm]) + np.array((left, -left))
    return ends
