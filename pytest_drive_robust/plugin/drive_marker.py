"""Reads the marker `drive_robust` of tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

from pytest_drive_robust.options.marker import MarkerOptions
from pytest_drive_robust.options.parsers import routes_from_root


def marker_options(item: pytest.Item) -> MarkerOptions:
    """Return the merged markers of a test; a route file's path starts from the root folder. Raises `UsageError`.

    Markers of the test's parameters win over markers of its function, because no other test has them. pytest lists the
    parameters' markers last.
    """
    own = [mark for mark in getattr(getattr(item, "callspec", None), "marks", ()) if mark.name == "drive_robust"]
    marker, config = MarkerOptions.from_marks([*own, *item.iter_markers("drive_robust")]), item.config
    if marker.routes is None:
        return marker
    # relative to the folder where pytest was called: a test may have changed the current folder
    return replace(marker, routes=routes_from_root(marker.routes, config.rootpath, config.invocation_params.dir))


def named_by_all(items: Sequence[pytest.Item]) -> MarkerOptions:
    """Return the agent and the routes of the first test's marker; each is None when some test's marker names none.

    Raises `UsageError` for a marker that cannot be used.
    """
    marks = [marker_options(item) for item in items]
    agents, routes = [mark.agent for mark in marks], [mark.routes for mark in marks]
    return MarkerOptions(
        agent=agents[0] if agents and all(agents) else None, routes=routes[0] if routes and all(routes) else None
    )
