"""Facts about a moment: lights, leaders, walkers, lanes."""

from __future__ import annotations

import pytest
from privileged_scene import actor, street
from training_drives import first_moment

from drive_robust_agents.training.data.facts import FACTS, NO_LIGHT, fact_labels
from pytest_drive_robust.domain.truth import ActorKind, GroundTruth, LightState


def facts(truth: GroundTruth) -> dict[str, float]:
    return dict(zip(FACTS, fact_labels(first_moment(truth)).tolist(), strict=True))


@pytest.mark.parametrize("state", list(LightState))
def test_facts_tell_the_next_light(state: LightState) -> None:
    found = facts(street(speed_mps=8.0, light=(60.0, state)))
    assert found["light"] == float(state)
    assert found["light_m"] == pytest.approx(60.0 - 20.0 - 0.5 * 4.892, abs=0.05)


def test_facts_of_an_empty_road_name_nothing() -> None:
    found = facts(street(speed_mps=8.0))
    assert found["light"] == NO_LIGHT
    assert all(found[name] == 100.0 for name in ("light_m", "lead_m", "walker_m", "obstacle_m", "junction_m"))
    assert not any(found[name] for name in ("night", "passing", "waiting", "siren", "lane_left", "lane_right"))
    assert found["lane_width_m"] == 3.5
    assert found["limit_mps"] == 12.0
    assert found["wish_mps2"] > 0.5


def test_facts_tell_who_is_ahead_and_who_walks_near_the_way() -> None:
    car = facts(street(actor(50.0, 0.0, speed_mps=4.0), speed_mps=8.0))
    assert (car["lead_m"], car["lead_mps"]) == pytest.approx((25.25, 4.0), abs=0.05)
    assert car["walker_m"] == car["obstacle_m"] == 100.0
    walker = facts(street(actor(40.0, 3.0, kind=ActorKind.PEDESTRIAN), speed_mps=8.0))
    assert walker["walker_m"] == pytest.approx(40.0 - 20.0 - 0.5 * (4.892 + 0.5), abs=0.05)
    assert walker["lead_m"] == 100.0
    far = facts(street(actor(40.0, 9.0, kind=ActorKind.PEDESTRIAN), speed_mps=8.0))
    assert far["walker_m"] == 100.0


def test_facts_tell_lanes_that_lead_the_same_way() -> None:
    assert facts(street(same_way=True))["lane_left"] == 1.0
    assert facts(street(same_way=False))["lane_left"] == 0.0
