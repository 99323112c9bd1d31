"""check_agent finds what one episode leaves behind for the next, and says so."""

from __future__ import annotations

import math
from typing import ClassVar

import pytest

from pytest_drive_robust.cli.main import main
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.route import GlobalPlan
from pytest_drive_robust.testing import ContractReport, FakeSimulator, check_agent, fake_route


class Forgetful:
    """Keeps a running mean and its route within an episode, and nothing beyond."""

    def sensors(self) -> list[CameraSpec]:
        return []

    def reset(self, route: GlobalPlan, seed: int) -> None:
        self.hidden = 0.0
        self.end_m = route.points[-1].x_m

    def act(self, observation: Observation) -> Control:
        self.hidden = 0.9 * self.hidden + 0.1 * observation.speed.mps
        return Control(throttle=0.5 + 0.1 * math.tanh(self.hidden) + 0.1 * math.tanh(self.end_m / 1000.0))


class KeepsItsHiddenState(Forgetful):
    hidden = 0.0

    def reset(self, route: GlobalPlan, seed: int) -> None:
        self.end_m = route.points[-1].x_m


class KeepsItsFirstRoute(Forgetful):
    end_m = 0.0

    def reset(self, route: GlobalPlan, seed: int) -> None:
        self.hidden = 0.0
        self.end_m = self.end_m or route.points[-1].x_m


class LearnsARouteByHeart(Forgetful):
    """What it knows of a route helps it only when it comes there again."""

    def __init__(self) -> None:
        self.known: dict[float, float] = {}

    def reset(self, route: GlobalPlan, seed: int) -> None:
        self.known[route.points[-1].x_m] = self.known.get(route.points[-1].x_m, -0.1) + 0.1
        super().reset(route, seed)

    def act(self, observation: Observation) -> Control:
        return Control(throttle=0.5 + self.known[self.end_m])


class KeepsItInItsClass(Forgetful):
    episodes: ClassVar[list[int]] = []

    def reset(self, route: GlobalPlan, seed: int) -> None:
        super().reset(route, seed)
        self.episodes.append(seed)

    def act(self, observation: Observation) -> Control:
        return Control(throttle=1.0 / len(self.episodes))


def failed(report: ContractReport) -> list[str]:
    return [check.name for check in report.checks if not check.ok]


def test_an_agent_that_forgets_is_told_so() -> None:
    report = check_agent(Forgetful)
    assert report.ok, str(report)
    assert report["reset"].sentence == "after other episodes and reset, the agent drives like a new one."


@pytest.mark.parametrize(
    ("agent", "remembered"),
    [
        (
            KeepsItsHiddenState,
            f"after an episode on {fake_route('2').label} the agent still remembers it: from act 0 on",
        ),
        (
            KeepsItsFirstRoute,
            f"after an episode on {fake_route('2').label} the agent still remembers it: from act 0 on",
        ),
        (LearnsARouteByHeart, "after the same episode the agent still remembers it: from act 0 on"),
    ],
)
def test_an_agent_whose_episode_depends_on_the_one_before_is_found(agent: type[Forgetful], remembered: str) -> None:
    report = check_agent(agent)
    assert failed(report) == ["reset"]
    assert report["reset"].sentence.startswith(remembered)
    assert "Set in reset every attribute that reset or act changes" in report["reset"].sentence


def test_what_is_kept_outside_the_object_is_found() -> None:
    report = check_agent(KeepsItInItsClass)
    assert "determinism" in failed(report)
    assert "keep nothing outside the object" in report["determinism"].sentence


def test_a_route_of_ones_own_may_be_driven_in_between() -> None:
    route, other = fake_route("7"), fake_route("8", length_m=40.0)
    assert check_agent(KeepsItsFirstRoute, simulator=FakeSimulator(), route=route)["reset"].ok, "there is only one"
    report = check_agent(KeepsItsFirstRoute, simulator=FakeSimulator(), route=route, other_route=other)
    assert failed(report) == ["reset"]
    assert f"an episode on {other.label}" in report["reset"].sentence


def test_the_command_finds_it_between_two_routes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check-agent", f"{__name__}:KeepsItsFirstRoute"]) == 1
    assert "the agent still remembers it" in " ".join(capsys.readouterr().out.split())
    assert main(["check-agent", f"{__name__}:Forgetful"]) == 0
