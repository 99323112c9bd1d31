"""What an assertion shows of a measured value."""

from __future__ import annotations

import pytest
from result_factory import scored

from pytest_drive_robust.plugin.estimate import Estimate
from pytest_drive_robust.verdict.evaluate import evaluate
from pytest_drive_robust.verdict.object_form import requirement


@pytest.mark.parametrize(
    ("score", "shown"),
    [(60.0, "60.00"), (60.1234, "60.1234"), (60.00001, "60.00001"), (59.99999, "59.99999"), (60.5, "60.50")],
)
def test_a_value_is_not_rounded_to_the_limit_that_it_misses(score: float, shown: str) -> None:
    driven = [scored("1", score), scored("2", score)]
    value = Estimate.of(evaluate(requirement("DS") >= 50, agent="driver", clean=[], perturbed=driven))
    assert repr(value).startswith(f"{shown} (DS under clean, 95 % interval ")
    assert (value <= 60) == (float(shown) <= 60)
