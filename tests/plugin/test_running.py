"""`pytest --drive-robust` as people use it, in one process and with two workers."""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path
from xml.etree import ElementTree

import pytest
from heeding_interrupts import heed_interrupts
from patience import PATIENCE_S

GREEN = "RD under throttle 0.9 <= 0.30"
RED = "RD under throttle 0.3 <= 0.30"

processes = pytest.mark.parametrize("workers", [(), ("-n2",)], ids=["one-process", "two-workers"])


def run(suite, *args):
    return suite.runpytest_inprocess("--drive-robust", *args)


@processes
def test_a_suite_whose_requirements_hold_is_green(suite, driven, workers):
    result = run(suite(GREEN, "DS under clean >= 90"), "--drive-seeds", "0,7", *workers)
    assert result.ret == 0
    result.assert_outcomes(passed=2)
    assert driven() == sorted(["1 0", "2 0", "3 0", "1 7", "2 7", "3 7"] * 2)


@processes
def test_a_broken_requirement_fails_its_test_and_says_why(suite, driven, workers):
    result = run(suite(GREEN, RED, "SR under throttle 0.9 >= 0.5", "DS under clean >= 90"), *workers)
    assert result.ret == 1
    result.assert_outcomes(passed=3, failed=1)
    result.stdout.re_match_lines(
        [
            r"RD under throttle 0\.3 = 0\.\d\d, limit <= 0\.30   \(95 % interval .* to .*, 3 routes x 1 seed\)",
            r" +clean   perturbed",
            r"  DS +100\.00 +\d\d\.\d\d",
            r"  SR +1\.00 +0\.00",
            r"  worst routes",
            r"  3 Straight, diverged at \d\.\d s",
            r"    clean +100\.0  completed",
            r"    perturbed +\d\d\.\d  out of time at 3\.0 s",
        ],
    )
    result.stdout.fnmatch_lines(
        ['  replay:  drive-robust -p conftest.py replay 3 --agent steady --setting "throttle 0.3" --seed 0 --routes *']
    )
    result.stdout.fnmatch_lines(["FAILED *rd-throttle-0.3-le-0.30[]] - RD under throttle 0.3 = 0.64, limit <= 0.30"])
    result.stdout.no_fnmatch_line("*Traceback*")
    result.stdout.no_fnmatch_line("*test_suite.py:*: *Error*")
    assert driven() == sorted(["1 0", "2 0", "3 0"] * 3), "clean, throttle 0.9 and throttle 0.3, each once"
    assert_table(result.outlines, verdicts=["pass", "pass", "fail"])


def test_the_replay_line_drives_again_what_a_conftest_registered(suite):
    folder = suite(RED)
    result = run(folder)
    line = next(line for line in result.outlines if line.startswith("  replay:  "))
    program, *words = shlex.split(line.partition("replay:")[2])
    assert program == "drive-robust"
    replayed = folder.run(sys.executable, "-m", "pytest_drive_robust.cli", *words, "--no-video")
    assert replayed.ret == 0
    replayed.stdout.fnmatch_lines(["steady on 3 under throttle 0.3, seed 0 (Straight)", "first divergence at * s in *"])


@pytest.mark.parametrize("workers", [(), ("-n1",)], ids=["one-process", "one-worker"])
def test_replay_lines_and_reports_name_a_conftest_that_stands_below_the_root(suite, workers):
    folder = suite(RED)
    below = folder.path / "suites" / "own"
    below.mkdir(parents=True)
    for name in ("conftest.py", "test_suite.py"):
        (folder.path / name).rename(below / name)
    result = run(folder, *workers, "--drive-json", "run.json", ".")
    words = shlex.split(next(line for line in result.outlines if line.startswith("  replay:  ")))[2:]
    assert words[:3] == ["-p", "suites/own/conftest.py", "replay"]
    assert json.loads((folder.path / "run.json").read_text())["settings"]["plugins"] == ["suites/own/conftest.py"]
    replayed = folder.run(sys.executable, "-m", "pytest_drive_robust.cli", *words, "--no-video")
    assert replayed.ret == 0
    replayed.stdout.fnmatch_lines(["steady on 3 under throttle 0.3, seed 0 (Straight)"])


def assert_table(lines, *, verdicts):
    start = next(number for number, line in enumerate(lines) if "= drive-robust =" in line)
    table = lines[start + 1 : start + 5]
    assert table[0].split() == ["agent", "setting", "DS", "SR", "RD", "efficiency", "comfort", "routes", "verdict"]
    assert [line.split()[-1] for line in table[1:]] == verdicts
    assert all(len(line) <= 100 for line in table)


@processes
def test_an_episode_that_broke_in_the_simulator_is_an_error_not_a_failure(suite, workers):
    result = run(suite(GREEN), "--drive-sim", "broken", *workers)
    assert result.ret == 1
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*ERROR: not judged: RD under throttle 0.9 <= 0.30*", "*no map*"])


LOST = """

@dataclass
class GpsLoss(Perturbation):
    phrase = "GPS loss"

    def observe(self, observation):
        return replace(observation, gps=replace(observation.gps, x_m=float("nan")))


@dataclass
class SlowComputer(Perturbation):
    every: int = 2
    phrase = "slow computer {every}"

    def wants_inference(self, tick):
        tick % self.every == 0


@dataclass
class AllLate(Perturbation):
    ticks: int = 5
    phrase = "all late {ticks}"

    def reset(self, context):
        self.kept = []

    def observe(self, observation):
        self.kept.append(observation)
        return self.kept[max(observation.tick - self.ticks, 0)]


def follower():
    return ScriptedAgent(lambda seen: Control(throttle=1.0, steer=0.0 * seen.gps.x_m))


AGENTS.append(follower)


@pytest.hookimpl(optionalhook=True)
def pytest_drive_robust_register(registry, _known=pytest_drive_robust_register):
    _known(registry)
    registry.register_perturbation(GpsLoss)
    registry.register_perturbation(SlowComputer)
    registry.register_perturbation(AllLate)
"""


@pytest.mark.parametrize(
    ("failure", "told"),
    [
        ("GPS loss", "GpsLoss.observe gave an observation whose*"),
        ("slow computer 2", "SlowComputer.wants_inference gave None,*"),
        ("all late 5", "AllLate.observe gave the observation of tick 0 in tick*"),
    ],
)
def test_a_perturbation_that_gives_what_cannot_be_used_is_an_error_not_a_failure(suite, failure, told):
    result = run(suite(f"RD under {failure} <= 0.30", conftest=LOST), "--drive-agent", "follower")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines([f"3 x simulation error, never scored: {told}"])


def test_an_agent_that_breaks_its_contract_is_scored_and_listed(suite):
    result = run(suite("DS under clean >= 90"), "--drive-agent", "faulty")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*3 episodes of 3 ended with an agent error*", "*3 x agent error: *throttle is 7.0*"])


def test_a_privileged_agent_is_marked(suite):
    result = run(suite("DS under clean >= 90"), "--drive-agent", "seer")
    assert result.ret == 0
    result.stdout.re_match_lines([r"seer\* .*pass", r"\* privileged: this agent sees ground truth"])


def test_the_header_shows_the_effective_choices(suite):
    result = run(suite(GREEN), "--drive-seeds", "0,1", "--drive-metrics", "fixed")
    settled = "routes=3 (routes.xml) seeds=0,1 reading=paper metrics=fixed"
    result.stdout.fnmatch_lines([f"drive-robust: agent=steady sim=fake {settled}"])


def test_the_header_tells_where_nobody_named_an_agent(suite):
    result = run(suite(GREEN), "-o", "drive_agent=", "--collect-only")
    result.stdout.fnmatch_lines(["drive-robust: agent=tcp (nobody named one) sim=fake *"])


def test_a_route_file_of_the_ini_file_starts_from_the_root_folder(suite, monkeypatch):
    folder = suite(GREEN)
    monkeypatch.chdir(folder.mkdir("below"))
    result = run(folder, "..")
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(["drive-robust: * routes=3 (../routes.xml) *"])


@processes
def test_a_route_file_of_a_marker_starts_from_the_root_folder(suite, monkeypatch, driven, workers):
    test = """
import pytest
from pytest_drive_robust import requirements

@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

@pytest.mark.drive_robust(routes="routes.xml:1,2")
def test_it(elsewhere, drive):
    drive.check(requirements("DS under clean >= 90")[0])
"""
    folder = suite(test=test)
    monkeypatch.chdir(folder.mkdir("below"))
    result = run(folder, "..", "--drive-json", "run.json", *workers)
    result.assert_outcomes(passed=1)
    assert driven() == ["1 0", "2 0"]
    requirement = json.loads((folder.path / "below" / "run.json").read_text())["requirements"][0]
    assert requirement["routes_spec"] == "../routes.xml:1,2"


def test_files_to_write_that_the_ini_file_names_start_from_the_root_folder(suite, monkeypatch):
    folder = suite(GREEN)
    folder.mkdir("out")
    with (folder.path / "tox.ini").open("a") as ini:
        ini.write("drive_json = out/run.json\ndrive_csv = run.csv\ndrive_report = out/pages\n")
    monkeypatch.chdir(folder.mkdir("below"))
    run(folder, "..").assert_outcomes(passed=1)
    assert not list(Path.cwd().iterdir())
    run(folder, "..", "--drive-csv", "mine.csv").assert_outcomes(passed=1)
    assert [path.name for path in Path.cwd().iterdir()] == ["mine.csv"]
    for name in ("out/run.json", "run.csv", "out/pages/index.html"):
        assert (folder.path / name).is_file(), name


@pytest.mark.skipif(os.name == "nt", reason="neither is there")
def test_reports_go_where_a_link_leads_and_never_replace_a_pipe(suite, driven):
    folder = suite(GREEN)
    os.mkfifo(folder.path / "pipe")
    for flag in ("--drive-json", "--drive-csv"):
        refused = run(folder, flag, "pipe")
        assert refused.ret == 4
        refused.stderr.fnmatch_lines([f"*{flag} is 'pipe', which is a pipe or a device; expected a file*"])
    assert (folder.path / "pipe").is_fifo()
    assert driven() == []
    links = {name: folder.path / name for name in ("run.json", "run.csv")}
    for name, link in links.items():
        link.symlink_to(Path("kept", name))
    folder.mkdir("kept")
    run(folder, "--drive-json", "run.json", "--drive-csv", "run.csv").assert_outcomes(passed=1)
    for name, link in links.items():
        assert link.is_symlink()
        assert (folder.path / "kept" / name).stat().st_size > 0


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
    warning = "warning: test_suite.py::test_it passed although it was told: "
    assert (f"{warning}{told}" in " ".join(result.outlines)) is (told is not None)


@processes
def test_collect_only_drives_nothing_and_is_green(suite, driven, workers):
    result = run(suite(GREEN), "--collect-only", "-q", *workers)
    assert result.ret == 0
    result.stdout.fnmatch_lines(["test_suite.py::test_requirement[[]rd-throttle-0.9-le-0.30[]]"])
    assert driven() == []


@pytest.mark.parametrize("option", ["--setup-plan", "--setup-only", "--fixtures-per-test"])
def test_looking_at_fixtures_drives_nothing_and_is_green(suite, driven, option):
    assert run(suite(GREEN), option).ret == 0
    assert driven() == []


def test_requirements_are_selected_by_their_ids(suite):
    result = run(suite(GREEN, RED), "-k", "throttle-0.9")
    result.assert_outcomes(passed=1, deselected=1)


def test_exitfirst_stops_after_the_first_broken_requirement(suite, driven):
    result = run(suite(RED, GREEN), "-x")
    assert result.ret in (1, 2)
    result.assert_outcomes(failed=1)
    assert driven() == ["1 0", "1 0", "2 0", "2 0", "3 0", "3 0"]


def test_last_failed_drives_only_what_failed(suite, driven):
    folder = suite(GREEN, RED)
    run(folder)
    (folder.path / "driven.log").unlink()
    result = run(folder, "--lf", "--drive-fresh")
    result.assert_outcomes(failed=1)
    assert len(driven()) == 6


def test_last_failed_drives_nothing_that_is_stored(suite, driven):
    folder = suite(GREEN, RED)
    run(folder)
    (folder.path / "driven.log").unlink()
    result = run(folder, "--lf")
    result.assert_outcomes(failed=1)
    assert driven() == []


def test_without_a_terminal_the_exit_code_is_still_right(suite):
    folder = suite(RED)
    assert run(folder, "-p", "no:terminal").ret == 1


@pytest.mark.parametrize(
    ("test", "workers"),
    [
        ("def test_other(): pass", ()),
        ("import pytest\n@pytest.mark.skip\ndef test_it(drive): pass", ()),
        ("def test_other(): pass", ("-n2",)),
    ],
    ids=["nothing-that-drives", "all-skipped", "two-workers"],
)
def test_a_run_that_drove_nothing_is_not_green(suite, test, workers):
    result = run(suite(test=test), *workers)
    assert result.ret == 1
    result.stdout.fnmatch_lines(["NOT GREEN: --drive-robust was given but no episode was driven*"])


FORGETFUL = """
import pytest
from pytest_drive_robust import requirements

each = pytest.mark.parametrize("requirement", requirements("DS under clean >= 90"))

@each
def test_forgot(drive, requirement):
    assert drive.agent

@pytest.mark.xfail
@each
def test_forgot_what_was_expected_to_fail(drive, requirement):
    pass

@each
def test_measured(drive, requirement):
    assert drive.ds(requirement.setting) >= requirement.limit

@each
def test_skipped(drive, requirement):
    pytest.skip("not today")

@each
def test_only_reads(requirement):
    assert requirement.limit == 90

def test_without(drive):
    assert drive.routes
"""


@processes
def test_a_test_that_forgets_its_requirement_is_an_error(suite, workers):
    result = run(suite(test=FORGETFUL), *workers)
    assert result.ret == 1
    result.assert_outcomes(passed=3, skipped=1, errors=2)
    result.stdout.fnmatch_lines(
        [
            "ERROR: not judged: DS under clean >= 90",
            "the test ended without it. Call drive.check(requirement), or skip the test.",
            "ERROR *::test_forgot* - ERROR: not judged: DS under clean >= 90",
        ]
    )


def test_where_there_is_no_test_the_next_step_is_to_write_one(suite, tmp_path):
    empty = tmp_path / "empty"
    empty.mkdir()
    result = run(suite(), empty)
    assert result.ret == 5
    result.stdout.fnmatch_lines(["NOT GREEN: * No test was found: name the folder of a suite, or *drive-robust init*"])


def test_where_tests_could_not_be_collected_the_next_step_is_to_mend_them(suite):
    result = run(suite(test="import no_such_module\n"))
    assert result.ret == 2
    result.stdout.fnmatch_lines(["NOT GREEN: * Its tests could not be collected: see the errors above."])


def test_where_tests_were_left_out_the_next_step_is_to_select_some(suite):
    result = run(suite("DS under clean >= 90"), "-k", "nothing_of_that_name")
    assert result.ret == 5
    result.stdout.fnmatch_lines(["NOT GREEN: * Select tests that use the drive fixture*"])


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


def test_a_marker_pins_agent_seeds_and_routes(suite, driven):
    test = """
import pytest
from pytest_drive_robust import requirement

@pytest.mark.drive_robust(agent="seer", routes="routes.xml:2", seeds=[4, 5])
def test_pinned(drive):
    assert drive.agent == "seer"
    drive.check(requirement("DS") >= 90)
"""
    result = run(suite(test=test), "--drive-agent", "steady")
    assert result.ret == 0
    assert driven() == ["2 4", "2 5"]


def test_a_marker_of_a_parameter_wins_over_that_of_its_function(suite, driven):
    test = """
import pytest
from pytest_drive_robust import requirement

@pytest.mark.drive_robust(agent="steady", routes="routes.xml:2")
@pytest.mark.parametrize("agent", ["steady", pytest.param("seer", marks=pytest.mark.drive_robust(agent="seer"))])
def test_pinned(drive, agent):
    assert drive.agent == agent
    drive.check(requirement("DS") >= 90)
"""
    run(suite(test=test)).assert_outcomes(passed=2)
    assert driven() == ["2 0", "2 0"]


@pytest.mark.parametrize(
    ("args", "marks", "told"),
    [
        ((), 2, ""),
        ((), 1, "its weights are not there"),
        (("--drive-agent", "tcp"), 2, "its weights are not there"),
        (("--drive-agent", "steady", "--drive-routes", "dev10"), 2, "10 of 10 routes cannot be driven:"),
    ],
    ids=["nobody asks for them", "a test without a marker does", "the run names the agent", "the run names the routes"],
)
def test_an_agent_and_routes_that_nobody_asks_for_need_not_be_there(suite, args, marks, told):
    absent = """

class OneTown(LoggedSimulator):
    def check_route(self, route):
        if route.town != "Straight":
            from pytest_drive_robust.errors import RouteError
            raise RouteError(f"no town {route.town}")


@pytest.hookimpl(optionalhook=True)
def pytest_drive_robust_register(registry, _known=pytest_drive_robust_register):
    _known(registry)

    def tcp():
        pass

    def check():
        from pytest_drive_robust.errors import UsageError
        raise UsageError("its weights are not there")

    tcp.check = check
    registry.register_agent("tcp", tcp)
    registry.register_simulator("one-town", lambda options: OneTown(replace(options, tick_cap=60)))
"""
    test = """
import pytest
from pytest_drive_robust import requirement

def test_first(drive):
    drive.check(requirement("DS") >= 1)

def test_second(drive):
    drive.check(requirement("DS") >= 1)
"""
    for name in ("first", "second")[:marks]:
        test = test.replace(f"def test_{name}", f"@NAMED\ndef test_{name}")
    test = test.replace("@NAMED", '@pytest.mark.drive_robust(agent="steady", routes="routes.xml")')
    unsaid = ("-o", "drive_agent=", "-o", "drive_routes=", "--drive-sim", "one-town")
    result = run(suite(test=test, conftest=absent), *unsaid, *args)
    assert result.ret == (4 if told else 0)
    result.stderr.fnmatch_lines([f"ERROR: *{told}"] if told else [])


def test_what_a_skipped_test_would_drive_need_not_be_there(suite):
    test = """
import pytest
from pytest_drive_robust import requirement

@pytest.mark.skipif("True", reason="not on this machine")
@pytest.mark.drive_robust(agent="elsewhere")
def test_skipped(drive):
    drive.check(requirement("DS") >= 1)
"""
    run(suite("DS under clean >= 90", test=test)).assert_outcomes(passed=1, skipped=1)


def test_what_a_requirement_measured_reaches_junit(suite):
    folder = suite(RED)
    run(folder, "--junitxml", "junit.xml")
    text = (folder.path / "junit.xml").read_text()
    assert '<property name="drive_requirement" value="RD under throttle 0.3 &lt;= 0.30" />' in text
    assert '<property name="drive_verdict" value="fail" />' in text


TWO_STATED = """
import pytest
from pytest_drive_robust import requirement, requirements

GREEN, RED = requirements(
    "RD under throttle 0.9 <= 0.30",
    "DS under throttle 0.3 >= 60",
)


@pytest.mark.parametrize("first, second", [(GREEN, RED)])
def test_of_two(drive, first, second):
    drive.check(first)
    drive.check(second)


@pytest.mark.parametrize("first", [GREEN])
def test_of_one_and_another(drive, first):
    drive.check(first)
    drive.check(requirement("DS") <= 5)
"""


@pytest.mark.parametrize("reading", [(), ("--drive-reading", "released")], ids=["paper", "released"])
def test_a_failure_names_the_line_of_the_requirement_that_is_broken(suite, reading):
    folder = suite(test=TWO_STATED)
    result = run(folder, "-o", "junit_family=xunit1", "--junitxml=junit.xml", *reading)
    result.assert_outcomes(failed=2)
    assert [line for line in result.outlines if "stated:" in line] == ["  stated:  test_suite.py:7"]
    lines = [case.get("line") for case in ElementTree.parse(folder.path / "junit.xml").getroot().iter("testcase")]
    assert lines == ["6", "16"], "from 0: of the sentence, and of the test that has none for what is broken"


def test_a_sentence_behind_the_end_of_a_line_in_a_string_is_found(suite):
    test = """
from pytest_drive_robust import requirements

def test_it(drive):
    for stated in requirements("DS under clean >= 1\\nDS under throttle 0.3 >= 60"):
        drive.check(stated)
"""
    run(suite(test=test)).stdout.fnmatch_lines(["  stated:  test_suite.py:5"])


def test_a_sentence_that_two_tests_state_is_that_of_the_test(suite):
    test = """
import pytest
from pytest_drive_robust import requirements

@pytest.mark.parametrize("stated", requirements("DS under throttle 0.3 >= 60"))
def test_before(drive, stated):
    drive.check(stated)
@pytest.mark.drive_robust(seeds=[0])
@pytest.mark.parametrize("stated", requirements("DS under throttle 0.3 >= 60"))
def test_behind(drive, stated):
    drive.check(stated)
"""
    told = [line for line in run(suite(test=test)).outlines if "stated:" in line]
    assert told == ["  stated:  test_suite.py:5", "  stated:  test_suite.py:9"]


STATED_ELSEWHERE = """
from pathlib import Path
import pytest
from pytest_drive_robust import requirements

@pytest.mark.parametrize("requirement", requirements(Path("limits.txt")))
def test_it(drive, requirement, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    drive.check(requirement)
"""


def test_a_failure_names_the_file_of_its_requirement_wherever_the_test_has_gone(suite):
    folder = suite(test=STATED_ELSEWHERE)
    (folder.path / "limits.txt").write_text(f"# limits\n{RED}\n")
    run(folder).stdout.fnmatch_lines(["  stated:  limits.txt:2"])


@pytest.mark.parametrize("call", ["check", "minimal"])
def test_a_sentence_in_place_of_a_requirement_is_explained(suite, call):
    result = run(suite(test=f"def test_it(drive):\n    drive.{call}('DS under clean >= 1')\n"))
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines([f"E*drive.{call} expects a requirement, as requirements(...) gives them, not 'DS*"])


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


def test_progress_is_a_few_plain_lines_where_there_is_no_terminal(suite):
    result = run(suite(GREEN, RED))
    lines = [line for line in result.outlines if line.startswith("drive-robust: steady under")]
    assert lines
    assert len(lines) <= 3
    assert not any("\x1b" in line for line in result.outlines)


def test_quiet_runs_write_no_progress(suite):
    result = run(suite(GREEN), "-q")
    result.stdout.no_fnmatch_line("drive-robust: steady under*")


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


@processes
def test_control_c_ends_with_the_table_of_what_is_there(suite, plugin_args, workers):
    test = """
from pathlib import Path

def test_slow(drive):
    from pytest_drive_robust import Setting
    drive.episodes(Setting.CLEAN)
    Path("ready").touch()
    import time
    for _ in range(12000):
        time.sleep(0.05)
"""
    folder = suite(test=test)
    command = [sys.executable, "-m", "pytest", "--drive-robust", *workers]
    with subprocess.Popen(
        command, cwd=folder.path, stdout=subprocess.PIPE, text=True, preexec_fn=heed_interrupts
    ) as process:
        while not (folder.path / "ready").exists() and process.poll() is None:
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 2, output
    assert "steady" in output
    assert "KeyboardInterrupt" in output


def test_a_report_that_cannot_be_written_is_not_green(suite):
    test = """
def test_it(drive):
    import os
    from pytest_drive_robust import requirement
    drive.check(requirement("DS") >= 90)
    os.rmdir("reports")
"""
    folder = suite(test=test)
    (folder.path / "reports").mkdir()
    result = run(folder, "--drive-json", "reports/run.json")
    assert result.ret == 1
    result.stdout.fnmatch_lines(["ERROR: *run.json was not written: *"])


def test_a_mode_of_distribution_without_workers_drives_here(suite):
    run(suite("DS under clean >= 1"), "--dist", "loadfile").assert_outcomes(passed=1)
