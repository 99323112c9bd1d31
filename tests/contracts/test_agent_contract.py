"""check_agent finds each kind of broken promise, and nothing else."""

from __future__ import annotations

import itertools
import math
import random
import sys
from collections.abc import Callable, Sequence

import cv2
import numpy as np
import pytest

from pytest_drive_robust.domain.agent import PlannedPath
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.route import GlobalPlan
from pytest_drive_robust.testing import ContractReport, FakeSimulator, ScriptedAgent, check_agent

CAMERA = CameraSpec("front", width_px=8, height_px=6)


class Good:
    """Sees everything, draws from its seed, shows a plan."""

    def sensors(self) -> list[CameraSpec]:
        return [CAMERA]

    def reset(self, route: GlobalPlan, seed: int) -> None:
        self.random = random.Random(seed)

    def act(self, observation: Observation) -> Control:
        observation.cameras["front"].pixels[:] = 0
        return Control(throttle=0.5 + 0.1 * self.random.random(), steer=-0.02 * observation.gps.y_m)

    def plan(self) -> PlannedPath:
        return PlannedPath(path=((1.0, 0.0), (2.0, 0.0)))


def failed(report: ContractReport) -> list[str]:
    assert not report.ok
    return [check.name for check in report.checks if not check.ok]


def scripted(act: Callable[[Observation], Control], **options: object) -> Callable[[], ScriptedAgent]:
    return lambda: ScriptedAgent(act, **options)  # type: ignore[arg-type]


def test_a_good_agent_keeps_every_promise() -> None:
    report = check_agent(Good)
    assert report.ok, str(report)
    names = [check.name for check in report.checks]
    assert names == [
        "methods",
        "declarations",
        "controls",
        "time",
        "determinism",
        "reset",
        "isolation",
        "consumes",
        "privileged",
        "plan",
        "lockstep",
    ]
    assert "Good keeps the contract" in str(report)


def test_each_check_is_told_as_soon_as_it_is_known() -> None:
    seen: list[str] = []

    class Noted(Good):
        def act(self, observation: Observation) -> Control:
            seen.append("act")
            return super().act(observation)

    report = check_agent(Noted, told=lambda check: seen.append(check.name))
    assert seen[:3] == ["methods", "declarations", "act"]
    assert [name for name in seen if name != "act"] == [check.name for check in report.checks]


def test_a_time_limit_that_is_kept_changes_nothing() -> None:
    assert [check.ok for check in check_agent(Good, act_timeout_s=60.0).checks] == [
        check.ok for check in check_agent(Good).checks
    ]


def test_libraries_compute_on_one_thread_as_in_a_run_and_on_as_many_as_before_afterwards() -> None:
    seen: set[int] = set()

    class Counting(Good):
        def act(self, observation: Observation) -> Control:
            seen.add(cv2.getNumThreads())
            return super().act(observation)

    before = cv2.getNumThreads()
    cv2.setNumThreads(2)
    try:
        assert check_agent(Counting).ok
        assert (seen, cv2.getNumThreads()) == ({1}, 2)
    finally:
        cv2.setNumThreads(before)


def test_missing_methods_are_named() -> None:
    class NoReset(Good):
        reset = None  # type: ignore[assignment]

    report = check_agent(NoReset)  # type: ignore[arg-type]
    assert failed(report) == ["methods"]
    assert "lacks reset" in report["methods"].sentence


def test_a_factory_that_raises_is_told() -> None:
    def factory() -> Good:
        raise OSError("no weights")

    assert "OSError: no weights" in check_agent(factory)["methods"].sentence


def test_a_constructor_that_exits_is_told() -> None:
    class Exits(Good):
        def __init__(self) -> None:
            sys.exit("no licence")

    report = check_agent(Exits)
    assert failed(report) == ["methods"]
    assert "SystemExit: no licence" in report["methods"].sentence
    assert "test_agent_contract.py" in report["methods"].sentence


def test_a_factory_that_gives_one_agent_only_is_told() -> None:
    made: list[Good] = []

    def single() -> Good:
        if made:
            raise OSError("the port is taken")
        made.append(Good())
        return made[0]

    report = check_agent(single)
    assert failed(report) == ["declarations"]
    assert "OSError: the port is taken" in report["declarations"].sentence


def test_a_declaration_that_raises_is_told() -> None:
    class Unsure(Good):
        @property
        def privileged(self) -> bool:
            raise RuntimeError("ask later")

    report = check_agent(Unsure)
    assert failed(report) == ["declarations"]
    assert "RuntimeError: ask later" in report["declarations"].sentence


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("consumes", {"lidar"}, "consumes has 'lidar', which is no signal. There are cameras, compass, gps"),
        ("consumes", "gps", "consumes is 'gps'"),
        ("consumes", 5, "consumes is 5"),
        ("privileged", "yes", "privileged is 'yes'"),
    ],
)
def test_wrong_declarations_are_told(name: str, value: object, told: str) -> None:
    report = check_agent(type("Declaring", (Good,), {name: value}))
    assert failed(report) == ["declarations"]
    assert told in report["declarations"].sentence


def test_weights_that_are_not_there_are_told() -> None:
    missing = type("Missing", (Good,), {"weights": ("no-such-file.pt",)})
    for factory in (missing, lambda: missing()):
        report = check_agent(factory)
        assert failed(report) == ["declarations"]
        assert "'no-such-file.pt', which cannot be read" in report["declarations"].sentence


def test_weights_that_only_the_object_names_are_told() -> None:
    class Late(Good):
        def __init__(self) -> None:
            self.weights = [__file__]

    report = check_agent(Late)
    assert failed(report) == ["declarations"]
    assert "in the body of the class, not in __init__" in report["declarations"].sentence


@pytest.mark.parametrize(
    ("act", "told"),
    [
        (lambda observation: Control(steer=float("nan")), "tick 0: act returned .* steer is nan"),
        (lambda observation: Control(throttle=1.5), r"throttle is 1\.5"),
        (lambda observation: None, "act returned None"),
        (lambda observation: observation.missing, "AttributeError"),
    ],
)
def test_a_control_that_cannot_be_is_told_with_its_tick(act: Callable[[Observation], Control], told: str) -> None:
    report = check_agent(scripted(act))
    assert failed(report) == ["controls"]
    with pytest.raises(AssertionError, match=told):
        raise AssertionError(report["controls"].sentence)


def test_two_cameras_of_one_name_are_told() -> None:
    report = check_agent(scripted(lambda observation: Control(), cameras=[CAMERA, CAMERA]))
    assert "two cameras named 'front'" in report["controls"].sentence


def test_randomness_that_does_not_come_from_the_seed_is_found() -> None:
    source = itertools.count()
    report = check_agent(scripted(lambda observation: Control(throttle=(next(source) % 997) / 997.0)))
    assert failed(report) == ["determinism"]
    assert "from act 0 on" in report["determinism"].sentence
    assert report.checks[-1].name == "plan"  # nothing else can be told of an agent that differs from itself


def test_a_constructor_may_draw_from_global_generators_and_act_may_not() -> None:
    class DrawsOnce(Good):
        def __init__(self) -> None:
            self.throttle = 0.5 * random.random() + 0.5 * float(np.random.rand())

        def act(self, observation: Observation) -> Control:
            return Control(throttle=self.throttle)

    class DrawsAlways(DrawsOnce):
        def act(self, observation: Observation) -> Control:
            return Control(throttle=self.throttle * random.random())

    report = check_agent(DrawsOnce)
    assert report.ok, str(report)
    assert failed(check_agent(DrawsAlways)) == ["determinism"]


def test_an_agent_that_remembers_its_last_episode_is_found() -> None:
    class Tired(Good):
        acts = 0

        def act(self, observation: Observation) -> Control:
            self.acts += 1
            return Control(throttle=1.0 / (1.0 + 0.001 * self.acts))

    report = check_agent(Tired)
    assert failed(report) == ["reset"]


def test_an_agent_that_breaks_on_another_route_is_found() -> None:
    class OneRoute(Good):
        def reset(self, route: GlobalPlan, seed: int) -> None:
            super().reset(route, seed)
            self.metres = list(range(int(route.points[-1].x_m)))

        def act(self, observation: Observation) -> Control:
            self.metres[59]  # the other route of the check is shorter
            return super().act(observation)

    report = check_agent(OneRoute)
    assert failed(report) == ["reset"]
    assert "IndexError: list index out of range" in report["reset"].sentence


def test_an_agent_whose_second_reset_raises_is_told_what_it_raised() -> None:
    class Once(Good):
        used = False

        def reset(self, route: GlobalPlan, seed: int) -> None:
            if self.used:
                raise RuntimeError("the socket is open")
            self.used = True
            super().reset(route, seed)

    report = check_agent(Once)
    assert failed(report) == ["reset"]
    assert "RuntimeError: the socket is open" in report["reset"].sentence
    assert "remembers" not in report["reset"].sentence


def test_an_agent_that_breaks_in_a_later_check_is_told_by_its_own_call() -> None:
    def act(observation: Observation) -> Control:
        if observation.truth is not None:
            raise KeyError("lane")
        return Control(throttle=0.6)

    report = check_agent(scripted(act))
    assert failed(report) == ["privileged"]
    assert report["privileged"].sentence.startswith("act raised KeyError: 'lane' (")


def test_a_signal_that_is_used_but_not_declared_is_found() -> None:
    def act(observation: Observation) -> Control:
        return Control(throttle=0.6, steer=0.01 * max(-1.0, min(1.0, observation.imu.right_mps2)))

    assert failed(check_agent(scripted(act, consumes={"cameras", "speed"}))) == ["consumes"]
    honest = check_agent(scripted(act, consumes={"imu"}))
    assert honest.ok, str(honest)
    assert "cameras, gps, compass, speed reach no control" in honest["consumes"].sentence


@pytest.mark.parametrize(
    ("signal", "value"),
    [
        ("cameras", lambda seen: float(seen.cameras["front"].pixels.mean())),
        ("gps", lambda seen: seen.gps.x_m),
        ("compass", lambda seen: seen.compass.heading_rad),
        ("speed", lambda seen: seen.speed.mps),
    ],
)
def test_each_signal_is_watched(signal: str, value: Callable[[Observation], float]) -> None:
    def act(observation: Observation) -> Control:
        return Control(throttle=0.5 + 0.4 * math.tanh(value(observation) / 100.0))

    report = check_agent(scripted(act, cameras=[CAMERA], consumes={"imu"}))
    assert failed(report) == ["consumes"]
    assert report["consumes"].sentence.startswith(f"{signal} changes the control of act 0")


def test_truth_that_is_read_without_asking_is_found() -> None:
    def peek(observation: Observation) -> Control:
        return Control(throttle=0.5 if observation.truth is None else 0.9)

    assert failed(check_agent(scripted(peek))) == ["privileged"]
    assert check_agent(scripted(peek, privileged=True)).ok


def test_truth_that_is_asked_for_in_vain_is_found() -> None:
    report = check_agent(scripted(lambda observation: Control(throttle=0.7), privileged=True))
    assert failed(report) == ["privileged"]
    assert "remove privileged" in report["privileged"].sentence


def test_an_agent_that_needs_the_truth_may_fail_without_it() -> None:
    def act(observation: Observation) -> Control:
        assert observation.truth is not None
        return Control(throttle=0.01 * observation.truth.route[0, 3])

    report = check_agent(scripted(act, privileged=True))
    assert report.ok, str(report)


def test_an_agent_that_moves_the_world_by_hand_is_found() -> None:
    world = FakeSimulator()

    def cheat(observation: Observation) -> Control:
        world._actors[0, 2] = 11.0
        return Control(throttle=0.7)

    report = check_agent(scripted(cheat, cameras=[CAMERA]), simulator=world)
    assert failed(report) == ["isolation"]


@pytest.mark.parametrize(
    "planned",
    [
        None,
        PlannedPath(path=((float("nan"), 0.0),)),
        PlannedPath(path=None),  # type: ignore[arg-type]
        PlannedPath(path=(1.0, 2.0)),  # type: ignore[arg-type]
        PlannedPath(path="ahead"),  # type: ignore[arg-type]
    ],
    ids=str,
)
def test_a_plan_that_cannot_be_drawn_is_found(planned: object) -> None:
    class Planner(Good):
        def plan(self) -> PlannedPath:
            return planned  # type: ignore[return-value]

    assert failed(check_agent(Planner)) == ["plan"]


def test_a_plan_that_changes_what_is_driven_is_found() -> None:
    class Smoothing(Good):
        def reset(self, route: GlobalPlan, seed: int) -> None:
            super().reset(route, seed)
            self.throttle = 0.2

        def act(self, observation: Observation) -> Control:
            return Control(throttle=self.throttle)

        def plan(self) -> PlannedPath:
            self.throttle += 0.5 * (1.0 - self.throttle)
            return super().plan()

    report = check_agent(Smoothing)
    assert failed(report) == ["plan"]
    assert report["plan"].sentence.startswith("plan changes the control of act 1: ")


class Batched(Good):
    """`act` for many, every row by itself."""

    @staticmethod
    def act_batch(agents: Sequence[Good], observations: Sequence[Observation]) -> list[Control]:
        return [agent.act(observation) for agent, observation in zip(agents, observations, strict=True)]


def test_an_act_batch_whose_rows_keep_to_themselves_is_told() -> None:
    report = check_agent(Batched)
    assert report.ok, str(report)
    assert report["lockstep"].sentence.startswith("act_batch drives like act")
    assert check_agent(Good)["lockstep"].sentence == "there is no act_batch(), and none is needed."


def test_an_act_batch_that_looks_at_its_neighbours_is_found() -> None:
    class Sociable(Good):
        @staticmethod
        def act_batch(agents: Sequence[Good], observations: Sequence[Observation]) -> list[Control]:
            mean = sum(observation.speed.mps for observation in observations) / len(observations)
            return [Control(throttle=min(0.5 + 0.01 * mean, 1.0)) for _ in agents]

    report = check_agent(Sociable)
    assert failed(report) == ["lockstep"]
    assert "in other company" in report["lockstep"].sentence


def test_an_act_batch_that_drives_otherwise_than_act_is_found() -> None:
    class Braver(Good):
        @staticmethod
        def act_batch(agents: Sequence[Good], observations: Sequence[Observation]) -> list[Control]:
            return [Control(throttle=1.0) for _ in agents]

    report = check_agent(Braver)
    assert failed(report) == ["lockstep"]
    assert "in tick 0 act gives Control(throttle=0.5" in report["lockstep"].sentence
