"""How the evidence of a requirement grew: it ends at the interval of the verdict."""

from __future__ import annotations

import math

import pytest
from report_pages import data_of, evidence, records
from result_factory import make_result

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.report.pages.folder import write_pages
from pytest_drive_robust.runner.planned_order import planned_order
from pytest_drive_robust.simulators.routes import resolve_routes
from pytest_drive_robust.store.events import Judged
from pytest_drive_robust.verdict.evaluate import evaluate
from pytest_drive_robust.verdict.sentences import requirements


@pytest.mark.parametrize("planned", [24, 44])
def test_the_evidence_grows_to_the_interval_of_the_verdict_where_some_routes_have_no_data(tmp_path, planned):
    routes = resolve_routes("one-per-scenario")
    order = planned_order([r.id for r in routes], [r.scenario.type for r in routes], "driver")[:24]
    results = [make_result(name, speed_ratios_pct=[40.0 + n] if n % 6 else []) for n, name in enumerate(order)]
    verdict = evaluate(
        requirements("efficiency under clean >= 70")[0], agent="driver", clean=[], perturbed=results,
        verdict_rule=VerdictRule("evidence"), decision="fail", planned=planned,
    )  # fmt: skip
    judged = Judged("t", str(verdict.requirement), "driver", "one-per-scenario", (0,), "efficiency", "clean",
                    ">=", 70.0, "fail", verdict.value, verdict.low, verdict.high, 24, planned=planned,
                    rule="evidence")  # fmt: skip
    write_pages(tmp_path, records(*results, judged=[judged]))
    (item,) = data_of(tmp_path)["requirements"]
    assert item["growth"][0] == [1, None, None, None]
    assert [point[0] for point in item["growth"]] == list(range(1, 25))
    high = verdict.high if verdict.high < math.inf else None
    assert item["growth"][-1] == [24, pytest.approx(verdict.value), verdict.low, high]


def test_the_evidence_grows_in_the_order_of_reading_to_the_value_of_the_verdict(tmp_path):
    order, judged, given = evidence()
    write_pages(tmp_path, given)
    (item,) = data_of(tmp_path)["requirements"]
    assert item["order"] == list(order)
    assert [point[0] for point in item["growth"]] == list(range(1, 13))
    assert item["growth"][0][1] == pytest.approx(0.5)
    assert item["growth"][-1][1] == pytest.approx(judged.value)
    assert item["lenient"] == pytest.approx(0.2 + given.document["settings"]["margin"])
    assert all(low <= value <= high for _, value, low, high in item["growth"] if None not in (low, high))
