"""What reports say of a verdict, in the same words for pass and fail."""

from __future__ import annotations

import pytest

from pytest_drive_robust.metrics.table import METRICS
from pytest_drive_robust.report.promise import claims, confidence, of_these_routes, shown_by_evidence


@pytest.mark.parametrize(("rule", "sure"), [("evidence", 0.8), ("list", 0.95), ("point", 0.95), ("", 0.95)])
def test_an_interval_is_as_sure_as_its_rule(rule, sure):
    assert confidence(rule, 0.10) == sure


def test_a_fail_claims_the_limit_and_a_pass_the_limit_with_its_margin():
    assert claims(METRICS["RD"], "<=", limit=0.3, lenient=0.4) == ("RD > 0.30", "RD < 0.40")
    assert claims(METRICS["DS"], ">=", limit=70.0, lenient=60.0) == ("DS < 70", "DS > 60")


def test_among_several_requirements_only_a_fail_is_rarer():
    assert shown_by_evidence("RD < 0.40", "pass", alpha=0.05, family=3).endswith("wrong at most 5% of the time")
    assert shown_by_evidence("RD > 0.30", "fail", alpha=0.05, family=3).endswith("any wrong fail among 3: at most 5%")


@pytest.mark.parametrize(("alpha", "told"), [(0.025, "2.5%"), (0.005, "0.5%"), (0.0001, "0.01%")])
def test_a_small_alpha_is_told_with_its_digits(alpha, told):
    assert shown_by_evidence("RD > 0.30", "fail", alpha=alpha, family=1).endswith(f" wrong at most {told} of the time")
    assert shown_by_evidence("RD > 0.30", "fail", alpha=alpha, family=3).endswith(f" at most {told}")
    assert of_these_routes("list", routes=3, planned=4, alpha=alpha).endswith(f" wrong at most {told} of the time")


@pytest.mark.parametrize(
    ("rule", "routes", "told"),
    [
        ("point", 4, "compared with the limit for exactly these 4 routes and their seeds, not for others"),
        ("list", 4, "decided for exactly these 4 routes and their seeds, not for others"),
        (
            "list",
            3,
            "decided for exactly these 4 routes and their seeds, not for others, before all were driven: "
            "wrong at most 5% of the time",
        ),
    ],
)
def test_other_rules_speak_of_the_routes_that_were_given(rule, routes, told):
    assert of_these_routes(rule, routes=routes, planned=4, alpha=0.05) == told
