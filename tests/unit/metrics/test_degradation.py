from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from result_factory import crashed_simulation, make_result, scored

from pytest_drive_robust.domain.result import MACHINE_FACTS
from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.metrics.degradation import paired_driving_scores, robustness_degradation

LATE = "200 ms latency"


def test_rd_is_the_share_of_the_mean_clean_score_that_is_lost() -> None:
    clean = [scored("1", 100.0), scored("2", 60.0)]
    perturbed = [scored("2", 60.0, setting=LATE), scored("1", 20.0, setting=LATE)]

    assert robustness_degradation(clean, perturbed) == 0.5  # not the mean of 0.8 and 0


def test_rd_is_negative_when_the_perturbed_agent_is_better() -> None:
    assert robustness_degradation([scored("1", 50.0)], [scored("1", 60.0, setting=LATE)]) == pytest.approx(-0.2)


def test_rd_of_identical_scores_is_exactly_0() -> None:
    clean = [scored(str(route), 10.1 * route) for route in range(1, 8)]

    assert robustness_degradation(clean, clean) == 0.0


def test_the_scores_are_paired_by_route_whatever_the_order() -> None:
    clean = [scored("1", 10.0, seed=1), scored("2", 20.0), scored("1", 30.0)]
    perturbed = [scored("2", 2.0, setting=LATE), scored("1", 3.0, setting=LATE), scored("1", 1.0, seed=1, setting=LATE)]

    assert paired_driving_scores(clean, perturbed) == ([20.0, 20.0], [2.0, 2.0])


def test_different_routes_or_seeds_are_refused_and_listed() -> None:
    clean = [scored("1", 100.0), scored("2", 100.0)]
    perturbed = [scored("1", 100.0, setting=LATE), scored("2", 100.0, seed=7, setting=LATE)]

    with pytest.raises(ComparisonError, match=r"only clean: \(route 2, seed 0\); only perturbed: \(route 2, seed 7\)"):
        robustness_degradation(clean, perturbed)


def test_routes_that_only_one_of_the_sets_has_are_refused() -> None:
    few, more = [scored("1", 100.0)], [scored("1", 100.0), scored("2", 0.0)]

    with pytest.raises(ComparisonError, match=r"pairs: only perturbed: \(route 2, seed 0\)\."):
        robustness_degradation(few, more)
    with pytest.raises(ComparisonError, match=r"pairs: only clean: \(route 2, seed 0\)\."):
        robustness_degradation(more, few)


def test_a_long_list_of_differences_is_cut() -> None:
    clean = [scored(str(route), 100.0) for route in range(9)]

    with pytest.raises(ComparisonError, match=r"only clean: \(route 1, seed 0\).*\(route 5, seed 0\) and 3 more"):
        robustness_degradation(clean, [scored("0", 100.0, setting=LATE)])


def test_the_same_pair_twice_is_refused() -> None:
    once = scored("1", 100.0)

    with pytest.raises(ComparisonError, match=r"clean set holds more than one episode of \(route 1, seed 0\)"):
        robustness_degradation([once, once], [once])
    with pytest.raises(ComparisonError, match="perturbed set holds more than one"):
        robustness_degradation([once], [once, once])
    twice = [scored(route, 100.0) for route in ("2", "1", "2", "1")]
    with pytest.raises(ComparisonError, match=r"\(route 1, seed 0\), \(route 2, seed 0\)\. Expected"):
        robustness_degradation(twice, twice)


def test_an_empty_set_is_refused() -> None:
    with pytest.raises(ComparisonError, match="clean set holds no episode"):
        robustness_degradation([], [])
    with pytest.raises(ComparisonError, match="perturbed set holds no episode"):
        robustness_degradation([scored("1", 100.0)], [])


def test_a_route_that_scores_0_when_clean_counts_as_long_as_another_scores() -> None:
    clean = [scored("1", 0.0), scored("2", 100.0)]
    perturbed = [scored("1", 20.0, setting=LATE), scored("2", 30.0, setting=LATE)]

    assert robustness_degradation(clean, perturbed) == 0.5


def test_a_clean_score_of_0_is_refused() -> None:
    with pytest.raises(ComparisonError, match=r"clean driving score of agent 'driver' is 0"):
        robustness_degradation([scored("1", 0.0)], [scored("1", 50.0, setting=LATE)])


@pytest.mark.parametrize("broken", ["clean", "perturbed"])
def test_one_infra_error_in_either_set_is_refused(broken: str) -> None:
    good = [scored("1", 100.0), scored("2", 100.0)]
    bad = [scored("1", 100.0), crashed_simulation("2")]

    with pytest.raises(ComparisonError, match=r"1 of 2 episodes ended with infra_error.*Drive them again"):
        robustness_degradation(bad if broken == "clean" else good, bad if broken == "perturbed" else good)


def test_different_agents_are_refused() -> None:
    with pytest.raises(ComparisonError, match="different agents: driver, other"):
        robustness_degradation([scored("1", 100.0)], [scored("1", 100.0, agent="other", setting=LATE)])


def test_different_simulator_versions_are_refused_and_named() -> None:
    new = make_result(versions={"embedded": "2", "numpy": "2.0"}, setting=LATE)

    with pytest.raises(ComparisonError, match=r"embedded 1 and 2, numpy absent and 2\.0"):
        robustness_degradation([make_result()], [new])


@pytest.mark.parametrize("stray", [0, 1, 2, 3])
def test_another_version_is_found_in_any_episode_of_either_set(stray: int) -> None:
    episodes = [(route, setting) for setting in ("clean", LATE) for route in ("1", "2")]
    driven = [
        make_result(route, setting=setting, versions={"embedded": "2" if place == stray else "1"})
        for place, (route, setting) in enumerate(episodes)
    ]

    with pytest.raises(ComparisonError, match=r"embedded [12] and [12]"):
        robustness_degradation(driven[:2], driven[2:])


@pytest.mark.parametrize("fact", MACHINE_FACTS)
def test_another_machine_is_no_other_version(fact: str) -> None:
    elsewhere = scored("1", 50.0, setting=LATE, versions={"embedded": "1", fact: "b"})

    assert robustness_degradation([scored("1", 100.0, versions={"embedded": "1", fact: "a"})], [elsewhere]) == 0.5


def test_mixed_settings_are_refused() -> None:
    clean = [scored("1", 50.0), scored("2", 50.0)]
    mixed = [scored("1", 50.0, setting=LATE), scored("2", 50.0, setting="occlusion 0.5")]

    with pytest.raises(ComparisonError, match=r"perturbed set mixes settings: 200 ms latency; occlusion 0\.5"):
        robustness_degradation(clean, mixed)
    with pytest.raises(ComparisonError, match="clean set mixes settings"):
        robustness_degradation(mixed, clean)


scores = st.lists(
    st.tuples(st.floats(0.0, 100.0), st.floats(0.0, 100.0)).filter(lambda pair: pair[0] > 1.0), min_size=1, max_size=6
)


@given(scores, st.randoms())
def test_rd_is_at_most_1_and_does_not_depend_on_the_order(pairs: list[tuple[float, float]], random: object) -> None:
    clean = [scored(str(route), before) for route, (before, _) in enumerate(pairs)]
    perturbed = [scored(str(route), after, setting=LATE) for route, (_, after) in enumerate(pairs)]
    rd = robustness_degradation(clean, perturbed)
    random.shuffle(perturbed)  # type: ignore[attr-defined]

    assert rd <= 1.0
    assert robustness_degradation(list(reversed(clean)), perturbed) == rd
