from __future__ import annotations

import random
from collections import Counter

import pytest

from pytest_drive_robust.runner.planned_order import planned_order

IDS = [f"r{number}" for number in range(220)]
TYPES = [f"type {number // 5}" for number in range(220)]
TYPE_OF = dict(zip(IDS, TYPES, strict=True))


def test_every_block_holds_one_route_of_each_type() -> None:
    order = planned_order(IDS, TYPES, "rd-200ms-latency")

    assert sorted(order) == sorted(IDS)
    for start in range(0, 220, 44):
        assert len({TYPE_OF[route] for route in order[start : start + 44]}) == 44


def test_types_of_different_size_are_spread_evenly() -> None:
    types = ["common"] * 180 + ["rare"] * 40
    order = planned_order(IDS, types, "suite")
    of = dict(zip(IDS, types, strict=True))

    for end in range(11, 221, 11):
        rare = Counter(of[route] for route in order[:end])["rare"]
        assert abs(rare - 40 * end / 220) < 2.0


def test_the_only_route_of_its_type_may_come_anywhere() -> None:
    types = ["rare"] + ["common"] * 30
    places = [planned_order(IDS[:31], types, str(number)).index(IDS[0]) for number in range(200)]
    assert sum(places) / 200 == pytest.approx(15.0, abs=2.0)  # 3 standard errors
    assert max(places) == 30


def test_the_order_is_named_by_the_text_and_by_nothing_else() -> None:
    order = planned_order(IDS, TYPES, "suite a")
    both = random.Random(1).sample(list(zip(IDS, TYPES, strict=True)), 220)

    assert planned_order(*map(list, zip(*both, strict=True)), "suite a") == order
    assert planned_order(IDS, TYPES, "suite b") != order
    assert planned_order(["1", "2", "3", "4"], ["a", "a", "b", "b"], "suite") == ("1", "3", "4", "2")


def test_a_route_more_leaves_most_of_the_others_where_they_are() -> None:
    types = {**TYPE_OF, "new": "type 7"}
    longer = [route for route in planned_order([*IDS, "new"], list(types.values()), "driver") if route != "new"]
    others = [route for route in longer if TYPE_OF[route] != "type 7"]
    assert others == [route for route in planned_order(IDS, TYPES, "driver") if TYPE_OF[route] != "type 7"]


def test_any_route_may_come_first() -> None:
    first = {planned_order(IDS[:10], TYPES[:10], str(number))[0] for number in range(200)}

    assert first == set(IDS[:10])


def test_routes_without_a_type_and_routes_that_come_twice_are_refused() -> None:
    with pytest.raises(ValueError, match="shorter"):
        planned_order(["1", "2"], ["a"], "x")
    with pytest.raises(ValueError, match="come twice: 1"):
        planned_order(["1", "2", "1"], ["a", "a", "b"], "x")
