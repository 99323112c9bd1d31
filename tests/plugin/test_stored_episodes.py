"""What a second run takes over from the first one, through the front door."""

from __future__ import annotations

import re

import pytest

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.results.run import read_run
from pytest_drive_robust.store.maintenance import statistics

SENTENCES = ("DS under clean >= 90", "RD under throttle 0.9 <= 0.30")
AGENT = """
from pytest_drive_robust import Control
from pytest_drive_robust.testing import ScriptedAgent

def own():
    return ScriptedAgent([Control(throttle=1.0)])
"""
MOODY = """

def moody(options):
    breaks = {"raises": RuntimeError("no map"), "raises_in": "step", "raises_at": 3}
    return LoggedSimulator(replace(options, tick_cap=60), **(breaks if "NO_MAP" in os.environ else {}))


@pytest.hookimpl(optionalhook=True)
def pytest_drive_robust_register(registry, _known=pytest_drive_robust_register):
    _known(registry)
    registry.register_simulator("moody", moody)
"""
"""A world that breaks while the environment says so, of which the keys of episodes know nothing."""


@pytest.fixture
def rerun(suite, driven):
    """`rerun(arguments)` runs the suite and tells how many episodes it drove, and how it ended."""
    folder = suite(*SENTENCES, conftest=MOODY)
    folder.makepyfile(agent_module=AGENT)

    def run(*arguments: str):
        before = len(driven())
        result = folder.runpytest_inprocess("--drive-robust", *arguments)
        return len(driven()) - before, result

    run.folder = folder
    return run


@pytest.fixture
def below(rerun, monkeypatch):
    """The suite in a folder `project` of its own, in which pytest is called."""
    folder = rerun.folder.path / "project"
    folder.mkdir()
    for name in ("conftest.py", "test_suite.py", "routes.xml", "tox.ini"):
        (rerun.folder.path / name).rename(folder / name)
    monkeypatch.chdir(folder)
    return folder


def test_a_second_run_drives_nothing_and_says_the_same(rerun):
    first, before = rerun()
    second, after = rerun()
    assert (first, second) == (6, 0)
    assert before.ret == after.ret == 0
    store = rerun.folder.path / ".drive-robust"
    assert statistics(store).records == 6
    assert (store / ".gitignore").read_text() == "*\n"
    assert not list(store.glob("claims/*"))


def test_fresh_runs_and_runs_without_a_store_drive_again(rerun):
    assert rerun("--drive-store", "off")[0] == 6
    assert not (rerun.folder.path / ".drive-robust").exists()
    store = ("--drive-store", "elsewhere")
    assert [rerun(*store)[0], rerun(*store, "--drive-fresh")[0], rerun(*store)[0]] == [6, 6, 0]
    assert statistics(rerun.folder.path / "elsewhere").records == 6


@pytest.mark.parametrize("workers", [(), ("-n1",)], ids=["one-process", "one-worker"])
def test_a_store_outside_is_found_again_though_it_moves_the_root_folder(rerun, below, plugin_args, workers):
    """Without an ini file pytest takes the store for a folder of tests, once it is there."""
    (below / "tox.ini").unlink()
    line = [*plugin_args, "-W", "ignore:Module already imported", *workers]
    line += ["--drive-robust", "--drive-sim=fake", "--drive-agent=steady", "--drive-routes=routes.xml"]
    line += ["--drive-verdict=point", "--drive-executor=inline", "--drive-store", "../store"]
    results = [rerun.folder.runpytest_inprocess(*line) for _ in range(2)]
    assert [result.ret for result in results] == [0, 0]
    first, second = (next(text for text in result.outlines if text.startswith("rootdir: ")) for result in results)
    assert first != second, "else this shows nothing"
    assert len((below / "driven.log").read_text().splitlines()) == 6
    assert statistics(rerun.folder.path / "store").records == 6


@pytest.mark.parametrize("addopts", ["", "--drive-store ../store"], ids=["command-line", "environment"])
def test_a_store_outside_that_would_hide_the_ini_file_is_refused(rerun, below, monkeypatch, plugin_args, addopts):
    """The ini file names the agent: another one would be judged, from the second run on."""
    (rerun.folder.path / "store").mkdir()
    monkeypatch.setenv("PYTEST_ADDOPTS", addopts)
    line = [*plugin_args, "--drive-robust"]
    result = rerun.folder.runpytest_inprocess(*line, *([] if addopts else ["--drive-store", "../store"]))
    told = "\n".join(result.errlines)
    assert result.ret == 4
    assert f"takes '../store' for a folder of tests, so it reads no ini file instead of '{below}/tox.ini'" in told
    assert "as one word, as in --drive-store=FOLDER." in told
    monkeypatch.setenv("PYTEST_ADDOPTS", addopts.replace(" ", "="))
    assert rerun.folder.runpytest_inprocess(*line, *([] if addopts else ["--drive-store=../store"])).ret == 0


@pytest.mark.parametrize(
    ("options", "first", "again"),
    [
        ("--drive-store ../elsewhere", "--drive-save=one", "--drive-compare=one"),
        ("--drive-json ../elsewhere/run.json", "", ""),
    ],
    ids=["runs", "episodes"],
)
def test_nothing_is_stored_where_the_value_of_an_option_has_moved_the_root_folder(
    rerun, below, plugin_args, options, first, again
):
    (below / "tox.ini").unlink()
    if "json" in options:
        (rerun.folder.path / "elsewhere").mkdir()
    line = [*plugin_args, "-W", "ignore:Module already imported", "--drive-robust", "--drive-sim=fake"]
    line += ["--drive-agent=steady", "--drive-routes=routes.xml", "--drive-executor=inline"]
    drove = rerun.folder.runpytest_inprocess(*line, *options.split(), *first.split())
    moved = rerun.folder.runpytest_inprocess(*line, *options.split(), *again.split())
    mended = rerun.folder.runpytest_inprocess(*line, options.replace(" ", "="), *again.split())
    assert [drove.ret, moved.ret, mended.ret] == [0, 4, 0]
    said = f"it keeps episodes and runs in '{below.parent}' instead of '{below}'"
    assert said in "".join(moved.errlines)
    assert len((below / "driven.log").read_text().splitlines()) == 6, "the third run drives nothing"


def test_a_byte_of_the_agent_drives_again_and_a_test_of_another_name_does_not(rerun):
    arguments = ("--drive-agent", "agent_module:own")
    suite_file, agent_file = rerun.folder.path / "test_suite.py", rerun.folder.path / "agent_module.py"
    text = agent_file.read_text()
    assert rerun(*arguments)[0] == 6
    suite_file.write_text(suite_file.read_text().replace("test_requirement", "test_by_another_name"))
    assert rerun(*arguments)[0] == 0
    agent_file.write_text(text + "#")
    assert rerun(*arguments)[0] == 6
    agent_file.write_text(text)
    assert rerun(*arguments)[0] == 0


def test_what_the_agent_breaks_is_taken_over_and_what_the_simulator_breaks_is_not(rerun):
    assert [rerun("--drive-agent", "faulty")[0] for _ in range(2)] == [6, 0]
    first, second = (rerun("--drive-sim", "broken")[1] for _ in range(2))
    assert first.ret == second.ret == 1
    assert statistics(rerun.folder.path / ".drive-robust").reusable == 6


@pytest.mark.parametrize("workers", [(), ("-n2",)], ids=["one process", "two workers"])
def test_a_world_that_breaks_today_takes_no_drive_away_from_earlier_runs(rerun, monkeypatch, workers):
    arguments = ("--drive-sim", "moody")
    monkeypatch.chdir(rerun.folder.path)
    assert rerun(*arguments, "--drive-save=one")[1].ret == 0
    monkeypatch.setenv("NO_MAP", "today")
    result = rerun(*arguments, "--drive-fresh", "--drive-save=two", *workers)[1]
    result.assert_outcomes(errors=2)
    monkeypatch.delenv("NO_MAP")
    count, result = rerun(*arguments)
    assert (count, result.ret) == (0, 0)
    driven, broken = read_run("one").episodes, read_run("two").episodes
    assert Outcome.INFRA_ERROR not in {item.outcome for item in driven}
    assert all(len(item.trace.rows) == item.ticks > 3 for item in driven)
    assert {item.outcome for item in broken} == {Outcome.INFRA_ERROR}
    assert all("no map" in item.end_detail for item in broken)


def test_a_damaged_record_is_driven_again_and_said_so(rerun):
    rerun()
    path = sorted((rerun.folder.path / ".drive-robust").glob("episodes/*/*.episode"))[0]
    path.write_bytes(path.read_bytes()[:-3])
    count, result = rerun()
    assert (count, result.ret) == (1, 0)
    assert f"{path.name} is damaged" in result.stdout.str().replace("\n", "")


def test_a_store_that_cannot_be_written_costs_only_the_store(rerun):
    (rerun.folder.path / "store").mkdir()
    (rerun.folder.path / "store" / "episodes").write_text("a file where a folder should be")
    count, result = rerun("--drive-store", "store")
    assert (count, result.ret) == (6, 0)
    progress, table = result.stdout.str().split("= drive-robust =")
    assert re.search(r"drive-robust: .*cannot be written to.*\n(.*\n)*drive-robust: steady under clean done", progress)
    assert "cannot be written to" in " ".join(table.split())  # wrapped where the path ends
    count, result = rerun("--drive-store", "store", "-n2")
    assert (count, result.ret) == (6, 0)


def test_weights_of_a_class_behind_a_function_are_asked_for_and_then_driven_anew(rerun):
    module = """
from pathlib import Path
from pytest_drive_robust import Control
from pytest_drive_robust.testing import ScriptedAgent

class Loads(ScriptedAgent):
    weights = ("share.txt",)
    def __init__(self):
        super().__init__([Control(throttle=float(Path("share.txt").read_text()))])

def own():
    return Loads()
"""
    weights = rerun.folder.path / "share.txt"
    weights.write_text("1.0")
    rerun.folder.makepyfile(loading_module=module, named_module=module + "own.weights = Loads.weights")
    driven, result = rerun("--drive-agent=loading_module:own")
    assert (driven, result.ret) == (0, 1)
    result.stdout.fnmatch_lines(["*has weights = ('share.txt',)*with `own.weights = Loads.weights`*"])
    assert rerun("--drive-agent=named_module:own")[0] == 6
    weights.write_text("0.1")
    assert rerun("--drive-agent=named_module:own")[0] == 6


def test_code_that_cannot_be_known_is_driven_by_every_run_of_one_process(suite, driven):
    holding = """

def holding(handle):
    def make():
        assert handle is not None
        return steady()
    return make


@pytest.hookimpl(optionalhook=True)
def pytest_drive_robust_register(registry, _known=pytest_drive_robust_register):
    _known(registry)
    registry.register_agent("holding", holding(iter("what an iterator gives, nobody can compare")))
"""
    folder = suite("DS under clean >= 60", conftest=holding)
    for count in (3, 6):
        assert folder.runpytest_inprocess("--drive-robust", "--drive-agent", "holding").ret == 0
        assert len(driven()) == count


RETRAINED = """

class Learned(ScriptedAgent):
    weights = "learned.txt"

    def __init__(self):
        with open("learned.txt") as file:
            super().__init__([Control(throttle=float(file.read()))])


class Learning(Learned):
    def reset(self, route, seed):
        with open("learned.txt", "w") as file:
            file.write("0.3")
        super().reset(route, seed)


@pytest.hookimpl(optionalhook=True)
def pytest_drive_robust_register(registry, _known=pytest_drive_robust_register):
    _known(registry)
    registry.register_agent("learned", Learned)
    registry.register_agent("learning", Learning)


@pytest.fixture(scope="session", autouse=True)
def trained(pytestconfig):
    if (text := os.environ.get("TRAINED")) is not None:
        (pytestconfig.rootpath / "learned.txt").write_text(text)
"""


@pytest.mark.parametrize(
    ("trained", "args", "code"),
    [("1", (), 0), ("0.3", (), 1), ("0.3", ("--drive-fresh",), 1), ("1", ("--drive-store", "off"), 0)],
    ids=["the same again", "others", "others, and nothing is taken over", "nothing is kept"],
)
def test_weights_that_a_fixture_writes_take_no_episodes_of_others(suite, driven, monkeypatch, trained, args, code):
    folder = suite("DS under clean >= 60", conftest=RETRAINED)
    weights = folder.path / "learned.txt"
    weights.write_text("1")
    asked = ("--drive-robust", "--drive-agent", "learned", *args)
    assert folder.runpytest_inprocess(*asked).ret == 0
    monkeypatch.setenv("TRAINED", trained)
    weights.write_text("1")
    result = folder.runpytest_inprocess(*asked)
    assert result.ret == code
    if code:
        result.assert_outcomes(errors=1)
        result.stdout.fnmatch_lines(["*the weights of the agent 'learned' changed after the tests were collected*"])
        assert len(driven()) == 3, "the first run drove them, the second one none"


EDITING = """
from pathlib import Path

CODE = Path(__file__).with_name("edited.py")


def test_that_edits():
    CODE.write_text(CODE.read_text().replace("1.0", "0.3"))
"""


def test_code_that_was_edited_before_it_is_loaded_drives_nothing_under_the_key_of_what_it_was(rerun):
    folder, asked = rerun.folder, ("--drive-executor", "processes", "--drive-agent", "edited:own")
    folder.makepyfile(edited=AGENT, test_a=EDITING)
    result = folder.runpytest_subprocess("--drive-robust", *asked, "test_a.py", "test_suite.py")
    result.assert_outcomes(passed=1, errors=2)
    result.stdout.fnmatch_lines(["*edited.py, a file of the agent 'edited:own', changed after the tests *"])
    assert statistics(folder.path / ".drive-robust").records == 0


@pytest.mark.parametrize("named", ["learned.txt", "."], ids=["a file", "a folder"])
def test_what_was_driven_with_other_weights_than_its_key_says_is_not_stored(suite, driven, named):
    folder = suite("DS under clean >= 60", conftest=f"{RETRAINED}\n\nLearning.weights = {named!r}\n")
    (folder.path / "learned.txt").write_text("1")
    result = folder.runpytest_inprocess("--drive-robust", "--drive-agent", "learning")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*the weights of the agent 'learning' changed after the tests were collected*"])
    assert driven()
    assert statistics(folder.path / ".drive-robust").records == 0


def test_weights_are_looked_for_in_the_folder_of_the_call_wherever_a_test_has_gone(suite):
    elsewhere = """
import pytest
from pytest_drive_robust import requirements


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_clean(drive):
    drive.check(requirements("DS under clean >= 60")[0])
"""
    folder = suite(test=elsewhere, conftest=f"{RETRAINED}\n\nLearned.weights = 'learned.txt'\n")
    (folder.path / "learned.txt").write_text("1")
    folder.runpytest_inprocess("--drive-robust", "--drive-agent", "learned").assert_outcomes(passed=1)
