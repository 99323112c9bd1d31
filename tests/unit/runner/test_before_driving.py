"""What somebody's world says before it is driven, and nothing could be driven with, is refused in a sentence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from pytest_drive_robust.errors import PluginError, RouteError
from pytest_drive_robust.runner.before_driving import check_route, facts_of, routes_of, sources_of
from pytest_drive_robust.testing import FakeSimulator, fake_route


def world(**answers: object) -> FakeSimulator:
    """Return a fake world that has these attributes."""
    made = FakeSimulator()
    for name, answer in answers.items():
        setattr(made, name, answer)
    return made


def broken(*_: object) -> object:
    raise RuntimeError("no map")


@pytest.mark.parametrize(
    ("routes", "message"),
    [
        (lambda names: (), "gives no route for 'fake', expected at least one"),
        (lambda names: (fake_route("1"), fake_route("1")), "gives two routes with the id '1', expected each once"),
        (lambda names: (replace(fake_route(), id=7),), "gives a route with the id 7, expected text"),
        (lambda names: (fake_route("a,b"),), "gives a route with the id 'a,b', which --drive-routes could not name"),
        (lambda names: (fake_route(" a"),), "gives a route with the id ' a', which --drive-routes could not name"),
        (lambda names: (fake_route(""),), "gives a route with the id '', which --drive-routes could not name"),
        (lambda names: (replace(fake_route(), scenario=None),), "'NoneType' object has no attribute 'type'"),
        (
            lambda names: (replace(fake_route(), scenario=replace(fake_route().scenario, type=None)),),
            "gives a route with the scenario of the type None, expected text",
        ),
        (lambda names: None, "'NoneType' object is not iterable"),
        (lambda names: ["1"], "'str' object has no attribute 'id'"),
        (broken, r"raised RuntimeError: no map \(.*test_before_driving.py:\d+ in broken\), expected routes"),
    ],
)
def test_routes_of_a_world_that_are_none(routes: object, message: str) -> None:
    with pytest.raises(PluginError, match=message):
        routes_of("fake", world(routes=routes))


@pytest.mark.parametrize(
    ("versions", "message"),
    [
        (lambda: None, "'NoneType' object is not iterable"),
        (lambda: {"map": object()}, "object has no content that could be compared"),
        (broken, "raised RuntimeError: no map"),
    ],
)
def test_versions_that_no_key_can_be_made_of(versions: Callable[[], object], message: str) -> None:
    with pytest.raises(PluginError, match=message):
        facts_of(world(versions=versions))


@pytest.mark.parametrize("sources", ["maps", ("no_map",), None, (1,)])
def test_sources_that_are_no_names_of_modules(sources: object) -> None:
    with pytest.raises(PluginError, match="expected names of modules that can be imported"):
        sources_of(world(sources=sources))


def test_a_check_of_a_route_that_breaks_is_told_and_one_that_refuses_is_its_own_answer() -> None:
    def refuses(route: object) -> None:
        raise RouteError("no road leads there")

    with pytest.raises(PluginError, match="raised RuntimeError: no map"):
        check_route(world(check_route=broken), fake_route())
    with pytest.raises(RouteError, match="no road leads there"):
        check_route(world(check_route=refuses), fake_route())
