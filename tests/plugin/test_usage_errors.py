"""What cannot be used ends with exit code 4, a sentence, and nothing driven."""

from __future__ import annotations

import re
import sys

import pytest
from suite_runs import processes

GREEN = "DS under clean >= 90"


def refused(suite, *args):
    result = suite.runpytest_inprocess("--drive-robust", *args)
    assert result.ret == 4
    output = "\n".join((*result.outlines, *result.errlines))
    assert "Traceback" not in output
    assert "INTERNALERROR" not in output
    return output


@processes
def test_an_unknown_agent_is_named_with_the_nearest_one(suite, driven, workers):
    output = refused(suite(GREEN), "--drive-agent", "stedy", *workers)
    assert "there is no agent named 'stedy'. Did you mean 'steady'?" in output
    assert driven() == []


@pytest.mark.parametrize("name", ["xdist", "xdist.plugin"])
def test_workers_report_usage_errors_by_whatever_name_xdist_is_loaded(suite, monkeypatch, name):
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    folder = suite(GREEN)
    output = refused(folder, "-p", "pytest_drive_robust.plugin", "-p", name, "-n1", "--drive-agent", "stedy")
    assert "there is no agent named 'stedy'. Did you mean 'steady'?" in output


@pytest.mark.parametrize(
    ("agent", "message"),
    [
        ("blind:speed=-3", "blind has the speed -3.0, expected m/s above 0"),
        ("constant:throttle=2", "constant has the throttle 2.0, expected 0 to 1"),
        ("tcp:mode=fussed", "Did you mean 'fused'?"),
        ("vad:tuning=publishd", "Did you mean 'published'?"),
        ("uniad:engine=onx", "Did you mean 'onnx'?"),
        ("simlingo:commentary=true+position_filter=elapst", "Did you mean 'elapsed'?"),
        ("simlingo:instruction=drive at warp 8", "drive at"),
        ("my_agent:MyAgent:speed=8", "Options need a registered name: register my_agent:MyAgent under a NAME"),
    ],
)
def test_a_value_that_an_agent_would_not_take_is_refused_before_anything_ran(suite, driven, agent, message):
    output = refused(suite(GREEN), "--drive-agent", agent)
    assert message in output
    assert driven() == []


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (("--drive-sim", "fak"), "there is no simulator named 'fak'. Did you mean 'fake'?"),
        (("--drive-routes", "dev11"), "Did you mean 'dev10'?"),
        (("--drive-routes", "routs.xml"), "Did you mean 'routes.xml'?"),
        (("--drive-seeds", "0,x"), "--drive-seeds is '0,x', expected whole numbers >= 0"),
        (("--drive-seeds", "1,1"), "holds seed 1 twice"),
        (("--drive-metrics", "bench2drve"), "Did you mean 'bench2drive'?"),
        (("--drive-stuck-stop", "-3"), "expected seconds > 0"),
        (("--drive-json", "missing/run.json"), "there is no folder"),
        (("--drive-json", "."), "which is a folder"),
    ],
    ids=lambda value: value[0][8:] + value[1] if isinstance(value, tuple) else "",
)
def test_a_bad_option_is_refused_before_anything_ran(suite, driven, args, message):
    output = refused(suite(GREEN), *args)
    assert message in output
    assert driven() == []


def test_an_ini_value_is_checked_like_an_option(suite):
    folder = suite(GREEN)
    with (folder.path / "tox.ini").open("a") as ini:
        ini.write("drive_seeds = -1\n")
    assert "--drive-seeds is '-1'" in refused(folder)


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("drive_agnt", "there is no ini key named 'drive_agnt'. Did you mean 'drive_agent'?"),
        ("drive-agent", "Did you mean 'drive_agent'?"),
        ("drive_robust", "--drive-robust is for the command line only. Give it there, or in addopts."),
        ("drive-fresh", "--drive-fresh is for the command line only"),
        ("drive_frsh", "--drive-fresh is for the command line only"),
    ],
)
def test_a_misspelt_ini_key_is_refused_as_another_agent_would_be_judged(suite, driven, key, message):
    folder = suite(GREEN)
    with (folder.path / "tox.ini").open("a") as ini:
        ini.write(f"{key} = true\n")
    assert message in refused(folder)
    assert driven() == []
    assert folder.runpytest_inprocess().ret == 0  # without the switch it is none of our business


def test_a_misspelt_ini_key_is_refused_on_the_command_line_too(suite, driven):
    assert "there is no ini key named 'drive_agnt'" in refused(suite(GREEN), "-o", "drive_agnt=steady")
    spaced = "there is no ini key named 'drive_agent '. Did you mean 'drive_agent'?"
    assert spaced in refused(suite(GREEN), "-o", "drive_agent = steady")
    assert driven() == []


def test_an_ini_key_of_another_plugin_is_its_own(suite):
    conftest = """
def pytest_addoption(parser):
    parser.addini("drive_train", "of the vehicle", type="bool", default=False)
"""
    folder = suite(GREEN, conftest=conftest)
    with (folder.path / "tox.ini").open("a") as ini:
        ini.write("drive_train = front\n")
    assert folder.runpytest_inprocess("--drive-robust").ret == 0


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        ("--drive-agnt=steady", "--drive-agent"),
        ("--drive-robst", "--drive-robust"),
        ("--drive_verdict=list", "--drive-verdict"),
    ],
)
@processes
def test_a_misspelt_option_is_refused_with_the_nearest_one(suite, driven, given, meant, workers):
    output = refused(suite(GREEN), given, *workers)
    assert f"there is no option named '{given.partition('=')[0]}'. Did you mean '{meant}'?" in output
    assert driven() == []


def test_an_option_of_a_conftest_may_begin_as_ours(suite, pytester):
    made, conftest = suite(GREEN), pytester.path / "conftest.py"
    with conftest.open("a") as file:
        file.write("\ndef pytest_addoption(parser):\n    parser.addoption('--drive-mine')\n")
    assert made.runpytest_inprocess("--drive-robust", "--drive-mine=3").ret == 0


@pytest.mark.parametrize("name", ["drive_robst", "driverobust"])
@processes
def test_a_misspelt_marker_is_refused_and_a_registered_one_is_its_own(suite, driven, name, workers):
    test = f"import pytest\n@pytest.mark.{name}(agent='faulty')\ndef test_it(drive): pass"
    folder = suite(GREEN, test=test)
    output = refused(folder, "-W", "default", *workers)
    assert f"test_suite.py::test_it: there is no marker named '{name}'. Did you mean 'drive_robust'?" in output
    assert driven() == []
    with (folder.path / "tox.ini").open("a") as ini:
        ini.write(f"markers = {name}(agent): of somebody else\n")
    assert folder.runpytest_inprocess("--drive-robust", "-k", "requirement").ret == 0


@pytest.mark.parametrize("args", [("--drive-robust",), (), ("-n2",)], ids=["driving", "inert", "inert-two-workers"])
def test_a_bad_sentence_ends_the_collection_with_the_nearest_valid_one(suite, driven, args):
    folder = suite("RD under 200 ms latencie <= 0.30")
    result = folder.runpytest_inprocess(*args)
    output = "\n".join((*result.outlines, *result.errlines))
    assert result.ret == 4
    assert "ERROR: test_suite.py: " in output
    assert "200 ms latency" in output
    assert "Traceback" not in output
    assert driven() == []


@pytest.mark.parametrize(
    ("marker", "message"),
    [
        ("agnet='steady'", "the marker drive_robust has no option 'agnet'. Did you mean 'agent'?"),
        ("agent='stedy'", "there is no agent named 'stedy'. Did you mean 'steady'?"),
        ("'steady'", "Did you mean drive_robust(agent='steady')?"),
        ("seeds='01'", "expected whole numbers >= 0"),
        ("routes='nowhere.xml'", "there is no route file named 'nowhere.xml'"),
    ],
)
def test_a_bad_marker_is_refused_at_collection(suite, driven, marker, message):
    test = f"import pytest\n@pytest.mark.drive_robust({marker})\ndef test_it(drive): pass"
    output = refused(suite(test=test))
    assert message in output
    assert "test_suite.py::test_it" in output
    assert driven() == []


def test_a_bad_marker_of_a_test_that_asks_for_the_fixture_itself_is_an_error_without_our_traceback(suite):
    test = """
import pytest

@pytest.mark.drive_robust(agent="stedy")
def test_it(request):
    request.getfixturevalue("drive")
"""
    result = suite(GREEN, test=test).runpytest_inprocess("--drive-robust")
    assert result.ret == 1
    result.assert_outcomes(passed=1, errors=1)
    result.stdout.fnmatch_lines(
        ["ERROR: not judged: test_it", "there is no agent named 'stedy'. Did you mean 'steady'?*"]
    )
    result.stdout.no_fnmatch_line("*pytest_drive_robust/*")


def test_all_problems_are_named_at_once(suite):
    test = """
import pytest
@pytest.mark.drive_robust(agnet="steady")
def test_one(drive): pass
@pytest.mark.drive_robust(sead=1)
def test_two(drive): pass
"""
    output = refused(suite(test=test))
    assert "'agnet'" in output
    assert "'sead'. Did you mean 'seeds'?" in output


def test_two_hooks_that_claim_one_name_are_both_named(suite):
    folder = suite(GREEN)
    other = folder.mkdir("other")
    (other / "conftest.py").write_text(
        "def steady2(): pass\ndef pytest_drive_robust_register(registry): registry.register_agent('steady', steady2)"
    )
    (other / "test_other.py").write_text("def test_it(drive): pass")
    output = refused(folder)
    assert "'steady' of agents is registered twice" in output


def test_a_conftest_that_is_loaded_late_counts(suite):
    folder = suite()
    late = folder.mkdir("suites").joinpath("late")
    late.mkdir()
    (late / "conftest.py").write_text(
        "from pytest_drive_robust import Control\n"
        "from pytest_drive_robust.testing import ScriptedAgent\n"
        "def late(): return ScriptedAgent([Control(throttle=1.0)])\n"
        "def pytest_drive_robust_register(registry): registry.register_agent('late', late)\n"
    )
    (late / "test_late.py").write_text(
        "from pytest_drive_robust import requirement\n"
        "def test_it(drive):\n    assert drive.agent == 'late'\n    drive.check(requirement('DS') >= 90)\n"
    )
    result = folder.runpytest_inprocess("--drive-robust", "--drive-agent", "late")
    assert result.ret == 0
    result.assert_outcomes(passed=1)


def test_a_broken_third_party_agent_is_named_and_stops_nothing_else(suite, monkeypatch):
    folder = suite(GREEN)
    site = folder.mkdir("site")
    info = site / "sad_agents-1.2.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: sad-agents\nVersion: 1.2\n")
    (info / "entry_points.txt").write_text("[pytest_drive_robust.agents]\nsad = sad_agents:Sad\n")
    (site / "sad_agents.py").write_text("import not_there\n")
    monkeypatch.syspath_prepend(site)
    assert folder.runpytest_inprocess("--drive-robust").ret == 0
    output = refused(folder, "--drive-agent", "sad")
    assert "sad-agents 1.2" in output
    assert "not_there" in output


@processes
def test_a_severity_below_one_tick_is_refused_before_anything_is_driven(suite, driven, workers):
    output = refused(suite("RD under 20 ms latency <= 0.30"), *workers)
    assert "InferenceLatency: ms is 20.0, expected 0 or at least one tick, which lasts 0.05 s" in output
    assert driven() == []


def test_an_environment_that_keeps_kernels_from_being_compiled_is_refused(suite, pytester, monkeypatch):
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    output = refused(suite(GREEN), "--drive-sim", "embedded", "--drive-agent", "steady", "--drive-routes", "101")
    assert "NUMBA_DISABLE_JIT is set, but the world needs compiled kernels: unset it" in output
    checked = pytester.run(sys.executable, "-m", "pytest_drive_robust.cli", "routes", "check", "101")
    assert checked.ret == 4
    checked.stderr.fnmatch_lines("*NUMBA_DISABLE_JIT is set, but the world needs compiled kernels: unset it*")
    checked.stderr.no_fnmatch_line("*Traceback*")


WANTS_A_RIG = """
from pytest_drive_robust import CameraSpec

@dataclass
class DirtyFront(Perturbation):
    gain: float = 0.5
    phrase = "dirty front {gain}"
    def reset(self, context):
        self.front = context.cameras[0].name
    def observe(self, observation):
        return observation.map_images(lambda name, image: replace(image, pixels=image.pixels // 2))

@dataclass
class Mistyped(Perturbation):
    gain: float = 0.5
    phrase = "mistyped {gain}"
    def reset(self, context):
        context.draw()

def seeing():
    return ScriptedAgent([Control(throttle=1.0)], cameras=[CameraSpec("front", width_px=8, height_px=6)])

AGENTS.append(seeing)

@pytest.hookimpl(optionalhook=True)
def pytest_drive_robust_register(registry, _known=pytest_drive_robust_register):
    _known(registry)
    registry.register_perturbation(DirtyFront)
    registry.register_perturbation(Mistyped)
"""


@processes
def test_a_reset_that_wants_the_cameras_is_given_them_before_it_is_judged(suite, driven, workers):
    folder = suite("RD under dirty front 0.6 <= 0.30", conftest=WANTS_A_RIG)
    result = folder.runpytest_inprocess("--drive-robust", "--drive-agent=seeing", *workers)
    assert result.ret == 0
    assert len(driven()) == 6


@processes
def test_a_reset_that_raises_is_an_error_of_its_test(suite, workers):
    folder = suite("RD under mistyped 0.6 <= 0.30", "DS under clean >= 1", conftest=WANTS_A_RIG)
    result = folder.runpytest_inprocess("--drive-robust", *workers)
    assert result.ret == 1
    result.stdout.fnmatch_lines(["*'EpisodeContext' object has no attribute 'draw'*"])
    result.stdout.no_fnmatch_line("*INTERNALERROR*")


@processes
def test_a_severity_that_no_tick_shows_is_refused_also_behind_a_reset_that_raises(suite, driven, workers):
    output = refused(suite("RD under mistyped 0.6 and 20 ms latency <= 0.30", conftest=WANTS_A_RIG), *workers)
    assert "ms is 20.0, expected 0 or at least one tick" in output
    assert driven() == []


ANNOTATED = """

@dataclass
class Dimmed(Perturbation):
    gain: float = 0.5
    phrase: str = "dimmed camera {gain}"

@pytest.hookimpl(optionalhook=True)
def pytest_drive_robust_register(registry, _known=pytest_drive_robust_register):
    _known(registry)
    registry.register_perturbation(Dimmed)
"""


def test_a_phrase_that_became_a_severity_is_refused_before_anything_ran(suite, driven):
    output = refused(suite(GREEN, conftest=ANNOTATED))
    assert "Dimmed has 'phrase' as a severity, because it is annotated" in output
    assert driven() == []


MUTE = """
class Mute(FakeSimulator):
    def versions(self):
        raise RuntimeError("no map")

class Careful(ScriptedAgent):
    @classmethod
    def check(cls):
        raise OSError("no file")

@pytest.hookimpl(optionalhook=True)
def pytest_drive_robust_register(registry, _known=pytest_drive_robust_register):
    _known(registry)
    registry.register_simulator("mute", Mute)
    registry.register_agent("careful", Careful)
"""


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (("--drive-sim", "mute"), "raised RuntimeError: no map (conftest.py:"),
        (("--drive-agent", "careful"), "`check` of the agent 'careful' raised OSError: no file (conftest.py:"),
    ],
)
def test_what_a_world_or_an_agent_raises_before_it_is_driven_is_told_with_its_place(suite, driven, args, message):
    assert message in refused(suite(GREEN, conftest=MUTE), *args)
    assert driven() == []


MISSPELT = """
import pytest

@pytest.hookimpl(optionalhook=True)
def pytest_drive_robust_registr(registry):
    registry.register_agent("steady", faulty)
"""


@pytest.mark.parametrize(
    "args", [("--drive-robust",), (), ("--drive-robust", "-n1")], ids=["driving", "inert", "xdist"]
)
def test_an_optional_hook_that_is_misspelt_is_refused_as_it_would_be_called_by_nobody(suite, driven, args):
    output = refused(suite(GREEN, conftest=MISSPELT), *args)
    assert "no hook named 'pytest_drive_robust_registr'. Did you mean 'pytest_drive_robust_register'?" in output
    assert driven() == []


def test_a_misspelt_hook_in_a_conftest_that_is_loaded_late_is_refused_too(suite, driven):
    folder = suite(GREEN)
    late = folder.mkdir("late")
    (late / "conftest.py").write_text(MISSPELT)
    (late / "test_late.py").write_text("def test_it(): pass")
    assert "no hook named 'pytest_drive_robust_registr'" in refused(folder)
    assert driven() == []


OTHERS = """
import pytest

pytest_drive_robust_options = {"agent": "steady"}

@pytest.hookimpl(optionalhook=True)
def pytest_drive_nails(wall):
    pass
"""


def test_hooks_and_names_that_only_begin_as_ours_are_their_own(suite):
    assert suite(GREEN, conftest="import pytest_drive_robust\n" + OTHERS).runpytest_inprocess("--drive-robust").ret == 0


@pytest.mark.parametrize(
    ("call", "message"),
    [
        ("registry.register_agents('a', steady)", "has no attribute 'register_agents' (.*conftest.py:[0-9]+)"),
        ("registry.register_agents('a', steady)", "Did you mean 'register_agent'?"),
        ("registry.register_metric(len, 'length')", "raised TypeError: .*conftest.py:[0-9]+"),
        ("1 / 0", "pytest_drive_robust_register raised ZeroDivisionError: division by zero (.*conftest.py:[0-9]+)"),
    ],
)
def test_what_a_hook_raises_is_told_with_its_line(suite, driven, call, message):
    hook = f"""
def pytest_drive_robust_register(registry, _known=pytest_drive_robust_register):
    _known(registry)
    {call}
"""
    pattern = message.replace("(", r"\(").replace(")", r"\)").replace("?", r"\?")
    assert re.search(pattern, refused(suite(GREEN, conftest=hook)))
    assert driven() == []
