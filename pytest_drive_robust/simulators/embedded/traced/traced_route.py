"""An official route with the town that we build around it."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from pytest_drive_robust.arithmetic import arrays
from pytest_drive_robust.domain.route import Route, ScenarioSpec
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.simulators.embedded.geometry import arc_lengths, project, resample
from pytest_drive_robust.simulators.embedded.map import CompiledTown
from pytest_drive_robust.simulators.embedded.towns.town import Town
from pytest_drive_robust.simulators.embedded.traced.course import read_course
from pytest_drive_robust.simulators.embedded.traced.open_roads import draw_street
from pytest_drive_robust.simulators.embedded.traced.ramps import draw_cut_in, draw_entry, draw_exit
from pytest_drive_robust.simulators.embedded.traced.scenario_problems import problems_of
from pytest_drive_robust.simulators.embedded.traced.schema import SCHEMA, Place
from pytest_drive_robust.simulators.embedded.traced.traced_junction import draw_junction

TRIGGER_OFF_M = 25.0


@dataclass(frozen=True, slots=True)
class TracedRoute:
    """A traced route: `line` (n, 3) is the route on the lanes of `town`, in the file's coordinates."""

    town: CompiledTown
    line: Floats
    trigger_m: float


def trace_route(route: Route) -> TracedRoute:
    """Build the town of an official route, once per process. Raises `RouteError` with all mistakes."""
    spec = route.scenario
    parts = (route.id, route.town, route.waypoints, spec.type, spec.trigger, sorted(spec.texts.items()))
    numbers = sorted((name, sorted(given.items())) for name, given in spec.parameters.items())
    return _trace_route(_Key(repr((*parts, numbers)), route))


@dataclass(frozen=True)
class _Key:
    """A hashable key of a route, whose parameters are mappings and cannot be hashed."""

    text: str
    route: Route = field(compare=False)


@lru_cache(maxsize=64)
def _trace_route(key: _Key) -> TracedRoute:
    route, spec = key.route, key.route.scenario
    problems = problems_of(spec)
    if problems:
        raise RouteError(f"route {route.id}: {'; '.join(problems)}")
    digest = hashlib.blake2b(key.text.encode(), digest_size=4).hexdigest()
    try:
        return _build(Town(f"{route.town}-{route.id}-{digest}"), route, spec)
    except RouteError as error:
        raise RouteError(f"route {route.id}: {error}") from None


def _build(town: Town, route: Route, spec: ScenarioSpec) -> TracedRoute:
    course = read_course(route)
    roads, direction = SCHEMA[spec.type].roads, spec.texts.get("direction")
    trigger_m = _trigger_m(course.whole(), spec)
    latest = np.inf
    if roads.place is Place.STREET:
        line = draw_street(town, course, roads, direction)
    elif roads.place is Place.JUNCTION:
        line, latest = draw_junction(town, course, roads, trigger_m)
    elif roads.place is Place.EXIT:
        line = draw_exit(town, course, roads, spec, trigger_m)
    elif roads.place is Place.ENTRY:
        line = draw_entry(town, course, roads, spec)
    else:
        line = draw_cut_in(town, course, roads, spec)
    line = resample(line)
    return TracedRoute(CompiledTown(town), line, min(_trigger_m(line, spec), latest))


def _trigger_m(line: Floats, spec: ScenarioSpec) -> float:
    at = spec.trigger
    along, _ = project(line, at.x_m, at.y_m)
    off = float(arrays.hypot(line[:, 0] - at.x_m, line[:, 1] - at.y_m).min())
    if not off <= TRIGGER_OFF_M:
        raise RouteError(f"<trigger_point> is {off:.0f} m from its waypoints, expected {TRIGGER_OFF_M:.0f} m at most")
    return float(np.clip(along, 0.0, arc_lengths(line)[-1]))
