"""The distance of proposed limits, over runs of any scores."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.perturbations import BUILTIN
from pytest_drive_robust.regression.fingerprint import Fingerprint
from pytest_drive_robust.regression.proposed_limits import ProposedLimit, propose_limits
from pytest_drive_robust.regression.snapshot import Cell, RouteScore, Snapshot, Taken

RULE = VerdictRule()


def run(clean: list[float], perturbed: list[float], setting: str = "200 ms latency") -> Snapshot:
    cells = {}
    for name, scores in (("clean", clean), (setting, perturbed)):
        routes = {
            str(n): RouteScore.of(
                str(n), "Accident", [Taken(0, ds, ds == 100.0, "")], digest="", fingerprint=Fingerprint("embedded")
            )
            for n, ds in enumerate(scores)
        }
        cells["driver", name] = Cell("driver", name, "full", routes)
    return Snapshot("run", cells)


def limits(snapshot: Snapshot, agent: str = "driver") -> tuple[ProposedLimit, ...]:
    return propose_limits(snapshot, agent, perturbations=BUILTIN, rule=RULE)


scores = st.floats(1.0, 100.0)


@given(st.lists(st.tuples(st.floats(40.0, 100.0), scores), min_size=2, max_size=60))
def test_the_agent_meets_what_is_proposed(pairs: list[tuple[float, float]]) -> None:
    for item in limits(run([clean for clean, _ in pairs], [score for _, score in pairs])):
        assert item.requirement.is_met_by(round(item.value, 9))
        assert item.spare >= -1e-9


def test_more_routes_allow_a_limit_nearer_to_the_value() -> None:
    clean, perturbed = [100.0, 40.0, 80.0, 60.0], [90.0, 20.0, 100.0, 10.0]
    few, many = (limits(run(clean * times, perturbed * times))[1] for times in (6, 50))
    assert few.value == pytest.approx(many.value)
    assert few.spare > many.spare + 0.05


def test_a_setting_that_may_cost_everything_gets_no_limit() -> None:
    assert [str(item.requirement) for item in limits(run([100.0] * 5, [0.0] * 5))] == ["DS under clean >= 95"]


def test_an_agent_that_does_not_drive_gets_none() -> None:
    with pytest.raises(UsageError, match="shows no limit for 'driver'"):
        limits(run([5.0] * 30, [4.0] * 30))


def test_an_agent_that_was_not_driven_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'driver'"):
        limits(run([80.0] * 3, [70.0] * 3), "drive")
