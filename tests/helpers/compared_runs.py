"""Suites whose runs are stored and compared: requirements, a worse agent, and what a stored run holds."""

from __future__ import annotations

import json

from suite_runs import run

from pytest_drive_robust.simulators.embedded.route_xml import save_routes
from pytest_drive_robust.testing import fake_route

HOLDS = "DS under throttle 0.9 >= 1"
ALSO = "DS under clean >= 1"
EVIDENCE = "--drive-verdict=evidence"
BROKEN = "DS under throttle 0.9 >= 100"


def many_routes(folder):
    """40 routes: enough for evidence."""
    routes = [fake_route(str(number), length_m=5.0 + 0.15 * number) for number in range(1, 41)]
    save_routes(routes, folder.path / "routes.xml")


def slow_down(folder):
    """The same agent, worse: its code has changed, and its length, else Python may run what it compiled before."""
    conftest = folder.path / "conftest.py"
    conftest.write_text(
        conftest.read_text().replace(
            "ScriptedAgent([Control(throttle=1.0)])", "ScriptedAgent([Control(throttle=0.25)])"
        )
    )


def stored(folder, name):
    return json.loads((folder.path / ".drive-robust" / "runs" / f"{name}.json").read_text())


def refused(folder, driven, *args):
    """Return what a run says that is refused before it drives."""
    before = len(driven())
    result = run(folder, *args)
    assert result.ret == 4
    assert len(driven()) == before
    return "\n".join((*result.outlines, *result.errlines))
