"""What the fixture `drive` is to the body of a test: asked by threads, forgotten, compared in asserts, misused."""

from __future__ import annotations

import pytest
from suite_runs import processes, run


@pytest.mark.parametrize("executor", ["inline", "processes"])
def test_threads_of_a_test_may_ask_at_the_same_time(suite, driven, executor):
    test = """
from concurrent.futures import ThreadPoolExecutor
from pytest_drive_robust import requirements

STATED = requirements('''
DS under clean >= 60
DS under throttle 0.3 >= 60
DS under throttle 0.7 >= 10
RD under throttle 0.2 <= 0.9
latency margin >= 100 ms (DS >= 100)
''')

def test_it(drive):
    with ThreadPoolExecutor(5) as pool:
        asked = [pool.submit(drive.check, stated) for stated in STATED]
        measured = pool.submit(drive.ds, STATED[1].setting)
    assert [type(one.exception()).__name__ for one in asked] == [
        "NoneType", "BrokenRequirementError", "NoneType", "NoneType", "NoneType"
    ]
    assert 35 < measured.result() < 36
"""
    result = run(suite(test=test), "--drive-executor", executor)
    assert result.ret == 0
    result.assert_outcomes(passed=1)
    assert driven() == sorted(["1 0", "2 0", "3 0"] * 5)


@pytest.mark.parametrize(
    ("call", "told", "args"),
    [
        ("with ThreadPoolExecutor() as pool: pool.map(drive.check, STATED)", "DS under throttle 0.3 = 35.85, ", ()),
        ("with suppress(BaseException): drive.check(STATED[0])", "DS under throttle 0.3 = 35.85, ", ("-n2",)),
        (
            "with suppress(BaseException): drive.ds('clean')",
            "ERROR: not judged: DS under clean",
            ("--drive-sim=broken",),
        ),
        ("drive.ds('clean')", None, ()),
    ],
)
def test_a_test_that_keeps_to_itself_what_drive_raised_is_named(suite, call, told, args):
    test = f"""
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pytest_drive_robust import requirements

STATED = requirements("DS under throttle 0.3 >= 60")

def test_it(drive):
    {call}
"""
    result = run(suite(test=test), *args)
    assert result.ret == 0
    warning = "warning: test_suite.py::test_it passed although drive raised in it: "
    assert (f"{warning}{told}" in " ".join(result.outlines)) is (told is not None)


FORGETFUL = """
import pytest
from pytest_drive_robust import requirements

(OTHER,) = requirements("DS under clean >= 1")
each = pytest.mark.parametrize("requirement", requirements("DS under clean >= 90"))

@each
def test_forgot(drive, requirement):
    assert drive.agent

@each
def test_checked_another_one(drive, requirement):
    drive.check(OTHER)

@each
@pytest.mark.parametrize("second", [OTHER])
def test_checked_one_of_two(drive, requirement, second):
    drive.check(requirement)

@pytest.mark.xfail(strict=False)
@each
def test_forgot_what_was_expected_to_fail(drive, requirement):
    pass

@pytest.mark.xfail(strict=True)
@each
def test_forgot_what_had_to_fail(drive, requirement):
    drive.check(OTHER)

@each
def test_measured(drive, requirement):
    assert drive.ds(requirement.setting) >= requirement.limit

def helps(judge, wanted):
    judge(wanted)

@each
def test_hands_it_on(drive, requirement):
    helps(drive.check, requirement)

@each
def test_shrinks(drive, requirement):
    assert drive.minimal(requirement) is None

@pytest.fixture
def judged_later(drive, requirement):
    yield
    drive.check(requirement)

@pytest.fixture
def measured_later(drive):
    yield
    drive.ds("throttle 0.9")

@each
def test_judges_in_a_fixture(judged_later, requirement):
    pass

@each
def test_measures_another_setting_in_a_fixture(measured_later, requirement):
    pass

@each
def test_skipped(drive, requirement):
    pytest.skip("not today")

@each
def test_only_reads(requirement):
    assert requirement.limit == 90

@pytest.mark.parametrize("wanted", [requirements("DS under clean >= 90\\nDS under clean >= 2")])
def test_judges_the_first_of_a_list(drive, wanted):
    drive.check(wanted[0])

@pytest.mark.parametrize("case", [{"agent": "steady", "wanted": OTHER}])
def test_forgets_that_of_a_dictionary(drive, case):
    pass

def test_without(drive):
    assert drive.routes
"""


@processes
def test_a_test_that_forgets_its_requirement_is_an_error(suite, workers):
    result = run(suite(test=FORGETFUL), *workers)
    assert result.ret == 1
    result.assert_outcomes(passed=7, skipped=1, errors=8)
    result.stdout.fnmatch_lines(
        [
            "ERROR: not judged: DS under clean >= 90",
            "the test ended without judging it. Call drive.check(requirement), or skip the test.",
            "ERROR: not judged: DS under clean >= 1",
            "the test ended without judging it. Call drive.check(second), or skip the test.",
            "ERROR: not judged: DS under clean >= 2",
            "the test ended without judging it. Call drive.check(wanted[[]1[]]), or skip the test.",
            "ERROR *::test_forgot* - ERROR: not judged: DS under clean >= 90",
        ]
    )
    result.stdout.fnmatch_lines(["the test ended without judging it. Call drive.check(case[[]'wanted'[]]), or *"])


@pytest.mark.parametrize(
    ("call", "args", "errors"),
    [
        ("with suppress(BaseException): drive.check(requirement)", ("--drive-sim=broken",), 1),
        ("with suppress(BaseException): drive.check(requirement)", (), 0),
        ("drive.sr(requirement.setting)", ("--drive-reading=released",), 0),
        ("drive.largest(InferenceLatency, metric='DS', limit=1)", ("--drive-reading=released",), 0),
        ("drive.largest(InferenceLatency, metric='DS', limit=1, levels=[100])", (), 1),
    ],
)
def test_a_requirement_without_a_verdict_or_a_number_is_an_error_where_the_test_passes(suite, call, args, errors):
    test = f"""
from contextlib import suppress
import pytest
from pytest_drive_robust import InferenceLatency, requirements

@pytest.mark.parametrize("requirement", requirements("latency margin >= 150 ms (DS >= 60)"))
def test_it(drive, requirement):
    {call}
"""
    run(suite(test=test), *args).assert_outcomes(passed=1 - errors, errors=errors)


@pytest.mark.skipif(not hasattr(pytest, "Subtests"), reason="subtests come with pytest 9")
def test_a_subtest_has_not_forgotten_what_the_next_one_judges(suite):
    test = """
import pytest
from pytest_drive_robust import requirements

@pytest.mark.parametrize("requirement", requirements("DS under clean >= 90"))
def test_it(drive, requirement, subtests):
    with subtests.test("route"):
        assert drive.routes
    with subtests.test("verdict"):
        drive.check(requirement)
"""
    result = run(suite(test=test))
    assert result.ret == 0
    assert result.parseoutcomes()["passed"] == 1


def test_a_waived_verdict_on_another_requirement_leaves_its_own_an_error(suite):
    test = """
import pytest
from pytest_drive_robust import requirements

(OTHER,) = requirements("DS under throttle 0.3 >= 60")

@pytest.mark.parametrize("requirement", requirements("DS under clean >= 90"))
def test_it(drive, requirement):
    drive.check(OTHER)
"""
    folder = suite(test=test)
    folder.mkdir("suites")
    waiver = 'requirement = "DS under throttle 0.3 >= 60"\nowner = "kim"\nreason = "new"\nexpires = 2999-01-01\n'
    (folder.path / "suites" / "waivers.toml").write_text(f"[[waiver]]\n{waiver}")
    result = run(folder)
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["test_suite.py::test_it* broke: what it had not judged by then is not in this report"])


def test_values_with_intervals_can_be_compared_in_plain_asserts(suite):
    test = """
import pytest
from pytest_drive_robust import Setting

def test_measure(drive, drive_agent):
    weak = Setting.parse("throttle 0.3", drive_setting_classes())
    assert drive.rd(weak) > 0.30
    assert drive.ds(Setting.CLEAN) == pytest.approx(100.0)
    assert drive.sr(weak) == 0.0
    assert drive.rd(weak).low <= drive.rd(weak) <= drive.rd(weak).high
    assert [result.episode.route_id for result in drive.episodes(weak)] == ["1", "2", "3"]
    assert (drive.agent, drive_agent, drive.seeds) == ("steady", "steady", (0,))
    assert [route.id for route in drive.routes] == ["1", "2", "3"]
    assert drive.rd(weak) <= 0.64

def drive_setting_classes():
    from pytest_drive_robust.registry.registry import default_registry
    return default_registry().perturbations()
"""
    result = run(suite(test=test))
    result.assert_outcomes(failed=1)
    result.stdout.re_match_lines(
        [r"E +assert 0\.64\d\d \(RD under throttle 0\.3, 95 % interval .*, 3 routes x 1 seed\) <= 0\.64"]
    )


RED_LIGHTS = """

class RedLights(LoggedSimulator):
    def step(self, control):
        self.is_weak = control.throttle < 1.0
        return super().step(control)

    def score(self):
        from pytest_drive_robust.domain.outcome import Infraction, InfractionKind
        found = super().score()
        return replace(found, infractions=(Infraction(InfractionKind.RED_LIGHT, 5, "red"),)) if self.is_weak else found


@pytest.hookimpl(optionalhook=True)
def pytest_drive_robust_register(registry, _known=pytest_drive_robust_register):
    _known(registry)
    registry.register_simulator("lights", lambda options: RedLights(replace(options, tick_cap=90)))
"""


def test_a_measured_value_at_the_limit_keeps_to_it_as_a_requirement_does(suite):
    test = """
from pytest_drive_robust import requirements

def test_of_one_light(drive):
    (requirement,) = requirements("RD under throttle 0.99 <= 0.30")
    assert drive.check(requirement).value != 0.30, "1 - 70 / 100 is 0.30000000000000004"
    assert drive.rd("throttle 0.99") <= 0.30
    assert drive.rd("throttle 0.99") >= 0.30
    assert drive.ds("throttle 0.99") == 70.0
"""
    result = run(suite(test=test, conftest=RED_LIGHTS), "--drive-sim", "lights")
    result.assert_outcomes(passed=1)


@pytest.mark.parametrize("call", ["check", "minimal"])
def test_a_sentence_in_place_of_a_requirement_is_explained(suite, call):
    result = run(suite(test=f"def test_it(drive):\n    drive.{call}('DS under clean >= 1')\n"))
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines([f"E*drive.{call} was given 'DS*, expected a Requirement: *"])


@pytest.mark.parametrize(
    "call",
    [
        "rd('20 ms latency')",
        "episodes('20 ms latency')",
        "check(requirement('RD', InferenceLatency(ms=20)) <= 0.5)",
        "minimal(requirement('RD', InferenceLatency(ms=20)) <= 0.5)",
        "largest(InferenceLatency, levels=[20, 100])",
    ],
)
def test_a_severity_that_a_tick_cannot_show_is_refused_before_anything_is_driven(suite, driven, call):
    test = f"""
from pytest_drive_robust import requirement
from pytest_drive_robust.perturbations import InferenceLatency

def test_it(drive):
    drive.{call}
"""
    result = run(suite(test=test))
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*ms is 20*expected 0 or*"])
    assert not driven()


@pytest.mark.parametrize(
    ("asked", "world", "told"),
    [
        ("'throttle 0.3'", "fake", None),
        ("'throttle 1.0'", "fake", "throttle 1 changed nothing in all 3 episodes of agent 'steady'"),
        ("'throttle 0.3'", "broken", "3 of 3 episodes ended with infra_error and are never scored"),
        ("'throttle 0.3', broken=True", "broken", None),
    ],
)
def test_episodes_that_tell_nothing_of_the_agent_are_an_error_where_a_test_reads_them(suite, asked, world, told):
    test = f"""
def test_no_collision(drive):
    assert not any(result.infractions for result in drive.episodes({asked}))
"""
    result = run(suite(test=test), "--drive-sim", world)
    assert result.ret == (1 if told else 0)
    if told:
        result.assert_outcomes(errors=1)
        result.stdout.fnmatch_lines([f"ERROR: not judged: the episodes under {asked[1:13]}*", f"*{told}*"])
