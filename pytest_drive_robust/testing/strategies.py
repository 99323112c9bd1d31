"""hypothesis strategies for settings: properties over failures and stacks of them.

::

    from hypothesis import given
    from pytest_drive_robust import requirement
    from pytest_drive_robust.testing import strategies

    @strategies.driving(max_examples=20)
    @given(setting=strategies.settings())
    def test_no_stack_of_failures_costs_more_than_half_of_the_score(drive, setting):
        failure = drive.minimal(requirement("RD", setting) <= 0.50)
        assert failure is None, str(failure)

hypothesis keeps failed examples in its own database (`.hypothesis/examples`) and tries them first the next time: keep
that folder between CI runs, or commit the test case that the failure prints. hypothesis must be installed.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

try:
    import hypothesis
    from hypothesis import strategies as st
    from hypothesis.strategies import SearchStrategy
except ImportError as error:  # pragma: no cover
    raise ImportError("pytest_drive_robust.testing.strategies needs hypothesis: pip install hypothesis") from error

from pytest_drive_robust.perturbations import BUILTIN, Perturbation, Setting
from pytest_drive_robust.perturbations.ladder import Ladder, ladder_of
from pytest_drive_robust.verdict.smallest_stack import MinimalFailure, minimal_failing

__all__ = ["MinimalFailure", "driving", "minimal_failing", "perturbations", "settings"]

Kind = Perturbation | type[Perturbation]
_TICK_S = 0.05


def perturbations(kind: Kind, *, dt_s: float = _TICK_S) -> SearchStrategy[Perturbation]:
    """Return a strategy for one failure at any step of its ladder, shrinking to the mildest step.

    `kind` is a class, or an object whose other severities are kept. `dt_s` is the length of a tick in seconds, for
    failures that last whole ticks. Raises `PerturbationError` for a class without a ladder.
    """
    return _steps(ladder_of(kind, dt_s=dt_s))


def settings(
    kinds: Iterable[Kind] = tuple(BUILTIN.values()), *, min_size: int = 1, max_size: int = 3, dt_s: float = _TICK_S
) -> SearchStrategy[Setting]:
    """Return a strategy for stacks of `min_size` to `max_size` failures in the order of `kinds`.

    Stacks shrink to fewer and milder failures.

    `min_size=0` gives the clean setting too. Raises `ValueError` for sizes that `kinds` cannot fill.
    """
    ladders = [ladder_of(kind, dt_s=dt_s) for kind in kinds]
    if not 0 <= min_size <= min(max_size, len(ladders)):
        raise ValueError(f"stacks of {min_size} to {max_size} of {len(ladders)} failures cannot be made.")
    one = st.one_of([st.tuples(st.just(place), _steps(ladder)) for place, ladder in enumerate(ladders)])
    stacks = st.lists(one, min_size=min_size, max_size=min(max_size, len(ladders)), unique_by=lambda pair: pair[0])
    return stacks.map(lambda chosen: Setting.of(*(item for _, item in sorted(chosen, key=lambda pair: pair[0]))))


def driving(max_examples: int = 10, *, shrink: bool = False, **others: Any) -> hypothesis.settings:
    """Return hypothesis settings for tests that drive: no deadline, the `drive` fixture allowed, few examples.

    `shrink` lets hypothesis shrink too. hypothesis takes every verdict as certain, so leave shrinking to
    `drive.minimal`, unless the verdict rule is `"point"` or `"list"`, which give the same verdict on the same episodes.
    `others` are passed on to `hypothesis.settings`.
    """
    phases = [hypothesis.Phase.explicit, hypothesis.Phase.reuse, hypothesis.Phase.generate]
    if shrink:
        phases.append(hypothesis.Phase.shrink)
    allowed = [hypothesis.HealthCheck.function_scoped_fixture, hypothesis.HealthCheck.too_slow]
    chosen: dict[str, Any] = {"deadline": None, "phases": phases, "suppress_health_check": allowed, **others}
    return hypothesis.settings(max_examples=max_examples, **chosen)


def _steps(ladder: Ladder) -> SearchStrategy[Perturbation]:
    return st.sampled_from(ladder.levels).map(ladder.at)
