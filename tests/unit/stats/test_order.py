from __future__ import annotations

import random
from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_drive_robust.stats.judges import EvidenceJudge
from pytest_drive_robust.stats.order import PrefixReader, planned_order
from pytest_drive_robust.stats.rules import degradation_rule

ROUTES = [f"r{number}" for number in range(220)]
TYPES = [f"type {number // 5}" for number in range(220)]
TYPE_OF = dict(zip(ROUTES, TYPES, strict=True))


def test_every_block_holds_one_route_of_each_type() -> None:
    order = planned_order(ROUTES, TYPES, "rd-200ms-latency")

    assert sorted(order) == sorted(ROUTES)
    for start in range(0, 220, 44):
        assert len({TYPE_OF[route] for route in order[start : start + 44]}) == 44


def test_types_of_different_size_are_spread_evenly() -> None:
    types = ["common"] * 180 + ["rare"] * 40
    order = planned_order(ROUTES, types, "suite")
    of = dict(zip(ROUTES, types, strict=True))

    for end in range(11, 221, 11):
        rare = Counter(of[route] for route in order[:end])["rare"]
        assert abs(rare - 40 * end / 220) < 2.0


def test_the_order_is_named_by_the_text_and_by_nothing_else() -> None:
    order = planned_order(ROUTES, TYPES, "suite a")
    both = random.Random(1).sample(list(zip(ROUTES, TYPES, strict=True)), 220)

    assert planned_order(*map(list, zip(*both, strict=True)), "suite a") == order
    assert planned_order(ROUTES, TYPES, "suite b") != order
    assert planned_order(["1", "2", "3", "4"], ["a", "a", "b", "b"], "suite") == ("1", "3", "4", "2")


def test_any_route_may_come_first() -> None:
    first = {planned_order(ROUTES[:10], TYPES[:10], str(number))[0] for number in range(200)}

    assert first == set(ROUTES[:10])


def test_routes_without_a_type_and_routes_that_come_twice_are_refused() -> None:
    with pytest.raises(ValueError, match="2 routes and 1 scenario types"):
        planned_order(["1", "2"], ["a"], "x")
    with pytest.raises(ValueError, match="come twice: 1"):
        planned_order(["1", "2", "1"], ["a", "a", "b"], "x")
    with pytest.raises(ValueError, match="comes twice"):
        PrefixReader(["1", "1"])


@given(st.permutations(list("abcdefgh")))
def test_whatever_finishes_first_the_planned_order_is_read(finishing: list[str]) -> None:
    reader: PrefixReader[str] = PrefixReader("abcdefgh")
    read = []
    for done, route in enumerate(finishing, 1):
        read += reader.finish(route, route.upper())
        assert reader.ahead == done - len(read)
        assert [route for route, _ in read] == list("abcdefgh"[: len(read)])

    assert read == [(route, route.upper()) for route in "abcdefgh"]
    assert reader.is_complete
    assert reader.next_route is None


@given(st.randoms())
def test_the_verdict_does_not_depend_on_who_finishes_first(shuffle: random.Random) -> None:
    # The routes that go badly are slow; stopping on what finished first would read the good ones only.
    pairs = {str(number): (90.0, 20.0 if number % 2 else 90.0) for number in range(60)}
    judge, reader = EvidenceJudge(degradation_rule(0.30)), PrefixReader[tuple[float, float]](pairs)
    finishing = list(pairs)
    shuffle.shuffle(finishing)
    for route in sorted(finishing, key=lambda route: pairs[route][1] < 50.0):
        for _, (clean, perturbed) in reader.finish(route, pairs[route]):
            judge.read(perturbed, clean)

    straight = EvidenceJudge(degradation_rule(0.30))
    for clean, perturbed in pairs.values():
        straight.read(perturbed, clean)
    assert (judge.close(), judge.routes) == (straight.close(), straight.routes)


def test_a_dropped_route_is_left_out_at_its_place() -> None:
    reader: PrefixReader[int] = PrefixReader("abcd")

    assert reader.finish("b", 2) == []
    assert reader.drop("c") == []
    assert (reader.next_route, reader.ahead) == ("a", 1)
    assert reader.finish("a", 1) == [("a", 1), ("b", 2)]
    assert reader.next_route == "d"
    assert reader.finish("d", 4) == [("d", 4)]
    assert reader.dropped == ("c",)
    assert reader.is_complete


def test_more_than_5_percent_dropped_are_too_many() -> None:
    reader: PrefixReader[int] = PrefixReader(map(str, range(40)))
    lost = [reader.drop(str(number)) or reader.lost_too_many for number in range(3)]

    assert lost == [False, False, True]


def test_what_is_not_planned_or_finished_before_is_refused() -> None:
    reader: PrefixReader[int] = PrefixReader("ab")
    reader.finish("b", 1)

    with pytest.raises(ValueError, match="not planned"):
        reader.finish("c", 1)
    with pytest.raises(ValueError, match="finished before"):
        reader.finish("b", 2)
