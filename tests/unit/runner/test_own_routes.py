"""Simulators that bring their own routes."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_drive_robust.errors import UnknownNameError
from pytest_drive_robust.options.run import DEFAULT_ROUTES, RunOptions
from pytest_drive_robust.runner.routes import default_spec, routes_for
from pytest_drive_robust.simulators.embedded.routes import save_routes
from pytest_drive_robust.testing import FakeSimulator, fake_route


class Island(FakeSimulator):
    """Drives its own three routes, and by name some more."""

    def routes(self, names=()):
        for name in names:
            if not name.startswith("island-"):
                raise UnknownNameError.of("route of fake", name, ["island-1", "island-2"])
        return tuple(fake_route(name) for name in names or ("island-1", "island-2", "island-3"))


def ids(spec, simulator):
    return [route.id for route in routes_for(spec, simulator)]


def test_nobody_chose_so_the_simulator_does():
    assert default_spec(RunOptions(), Island()) == "fake"
    assert ids("fake", Island()) == ["island-1", "island-2", "island-3"]


def test_somebody_chose():
    settings = RunOptions(routes="island-7,island-9", routes_given=True)
    assert default_spec(settings, Island()) == "island-7,island-9"
    assert ids("island-7, island-9", Island()) == ["island-7", "island-9"]


def test_without_own_routes_ours_are_the_default():
    assert default_spec(RunOptions(), FakeSimulator()) == DEFAULT_ROUTES
    assert len(ids(DEFAULT_ROUTES, FakeSimulator())) >= 1


def test_files_and_sets_are_understood_and_left_to_check_route(tmp_path: Path):
    save_routes([fake_route("77")], tmp_path / "mine.xml")
    assert ids(str(tmp_path / "mine.xml"), Island()) == ["77"]
    assert ids(DEFAULT_ROUTES, Island()) == ids(DEFAULT_ROUTES, FakeSimulator())


def test_what_is_none_of_both_is_told_in_the_simulator_s_words():
    with pytest.raises(UnknownNameError, match=r"no route of fake named 'ilsand-1'\. Did you mean 'island-1'"):
        routes_for("ilsand-1", Island())
