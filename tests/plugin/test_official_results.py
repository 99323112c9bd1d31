"""`--drive-results`: the same suite on results that were driven elsewhere."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

LISTS = (
    "collisions_layout", "collisions_pedestrian", "collisions_vehicle", "red_light", "stop_infraction",
    "outside_route_lanes", "min_speed_infractions", "yield_emergency_vehicle_infractions", "scenario_timeouts",
    "route_dev", "vehicle_blocked", "route_timeout",
)  # fmt: skip

SUITE = '''
import pytest
from pytest_drive_robust import requirements


@pytest.mark.parametrize("requirement", requirements("""
RD under 200 ms latency <= 0.60
RD under 200 ms latency <= 0.10
SR under clean >= 0.90
"""))
def test_requirement(drive, requirement):
    drive.check(requirement)
'''


def write_results(
    path: Path,
    *repetitions: dict[str, float],
    scenario: str = "ParkedObstacle",
    planned: int | None = None,
) -> None:
    """Official records of routes that were driven so far [%] without any infraction; `planned` are all that were."""
    wall_s = 300.0 + len(path.stem) / 1000  # no two drives take as long to the millisecond
    records = [
        {
            "index": number,
            "route_id": f"RouteScenario_{route}_rep{repetition}",
            "scenario_name": f"{scenario}_1",
            "weather_id": "3",
            "save_name": f"RouteScenario_{route}_rep{repetition}_Town12_ParkedObstacle_1_3_01_02_03_04_05",
            "town_name": "Town12",
            "status": "Completed" if completion == 100.0 else "Failed - Agent got blocked",
            "num_infractions": 0,
            "infractions": {name: [] for name in LISTS},
            "scores": {"score_route": completion, "score_penalty": 1.0, "score_composed": completion},
            "meta": {"route_length": 120.5, "duration_game": 42.0, "duration_system": wall_s},
        }
        for repetition, completions in enumerate(repetitions)
        for number, (route, completion) in enumerate(completions.items())
    ]
    progress = [len(records), len(records) if planned is None else planned]
    status = "Finished" if progress[0] == progress[1] else "Crashed"
    path.write_text(json.dumps({"_checkpoint": {"records": records, "progress": progress}, "entry_status": status}))


@pytest.fixture
def results(pytester, monkeypatch, plugin_args):
    monkeypatch.setenv("COLUMNS", "120")
    pytester.makepyfile(test_suite=SUITE)
    pytester.makeini("[pytest]\ndrive_verdict = point\n")
    write_results(pytester.path / "clean.json", {"1": 100.0, "2": 100.0, "3": 100.0, "4": 100.0})
    write_results(pytester.path / "late.json", {"1": 100.0, "2": 60.0, "3": 30.0, "4": 10.0})

    def run(text: str, *arguments: str):
        return pytester.runpytest_inprocess(*plugin_args, "--drive-robust", "--drive-results", text, *arguments)

    return run


BOTH = "clean=clean.json,200 ms latency=late.json"


@pytest.mark.parametrize("workers", [(), ("-n2",)], ids=["alone", "xdist"])
def test_paths_of_the_ini_file_start_from_the_root_folder(results, pytester, plugin_args, monkeypatch, workers):
    pytester.makeini(f"[pytest]\ndrive_verdict = point\ndrive_results = {BOTH}\n")
    elsewhere = pytester.mkdir("elsewhere")
    monkeypatch.chdir(elsewhere)
    result = pytester.runpytest_inprocess(*plugin_args, "--drive-robust", str(pytester.path), *workers)
    result.assert_outcomes(passed=2, failed=1)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ("--drive-sim=typo", "--drive-sim typo"),
        ("--drive-sim=bench2drive", "--drive-sim bench2drive"),
        ("--drive-sim=gymnasium:merge-v0", "--drive-sim gymnasium:merge-v0"),
        ("--drive-fresh", "--drive-fresh"),
        ("--drive-stuck-stop=30", "--drive-stuck-stop 30"),
        ("--drive-store=x", "--drive-store x"),
        ("--drive-workers=7", "--drive-workers 7"),
        ("--drive-lockstep=8", "--drive-lockstep 8"),
        ("--drive-episode-timeout=5s", "--drive-episode-timeout 5s"),
        ("--drive-act-timeout=5s", "--drive-act-timeout 5s"),
        ("--drive-memory=4", "--drive-memory 4"),
        ("--drive-executor=ray", "--drive-executor ray"),
        ("--drive-executor=processes", "--drive-executor processes"),
        ("--drive-probe", "--drive-probe"),
    ],
)
def test_what_is_asked_for_and_only_driving_heeds_is_refused(results, given, told):
    result = results(BOTH, given)
    assert result.ret == 4
    result.stderr.fnmatch_lines([f"*{told} has no effect with --drive-results, which judges what was driven before*"])


def test_what_the_ini_file_says_of_other_runs_and_what_asks_for_nothing_is_let_be(results, pytester):
    other = "drive_sim = bench2drive\ndrive_stuck_stop = 30\ndrive_store = x\ndrive_workers = 7\ndrive_lockstep = 8\n"
    pytester.makeini(f"[pytest]\ndrive_verdict = point\n{other}drive_act_timeout = 5s\ndrive_executor = ray\n")
    nothing = ("--drive-store=off", "--drive-workers=auto", "--drive-lockstep=none", "--drive-executor=auto")
    results(BOTH, *nothing, "--drive-episode-timeout=none", "-s").assert_outcomes(passed=2, failed=1)
    assert not (pytester.path / "x").exists()


@pytest.mark.parametrize("workers", [(), ("-n2",)], ids=["alone", "xdist"])
def test_requirements_are_judged_without_a_simulator(results, pytester, workers):
    result = results(BOTH, "--drive-json", "run.json", *workers)
    result.assert_outcomes(passed=2, failed=1)
    document = json.loads((pytester.path / "run.json").read_text())
    values = {item["requirement"]: item["value"] for item in document["requirements"]}
    assert values["RD under 200 ms latency <= 0.60"] == pytest.approx(0.5)
    assert values["SR under clean >= 0.90"] == 1.0
    assert not (pytester.path / ".drive-robust").exists()
    result.stdout.no_fnmatch_line("*drive-robust replay*")  # nobody can drive them again


def test_variables_are_nothing_to_agents_that_have_driven(results, pytester):
    pytester.makeconftest(
        "import pytest\n\n@pytest.fixture(autouse=True)\ndef variable(monkeypatch):\n"
        "    monkeypatch.setenv('HOW_FAST', '0.1')\n"
    )
    results(BOTH).assert_outcomes(passed=2, failed=1, warnings=0)


def test_what_only_a_map_tells_is_stated_as_bounds(results, pytester):
    for name in ("clean.json", "late.json"):
        write_results(pytester.path / name, {"1": 100.0, "2": 60.0, "3": 0.0, "4": 10.0}, scenario="T_Junction")
    results(BOTH, "--drive-json", "run.json")
    document = json.loads((pytester.path / "run.json").read_text())
    summary = document["summaries"][0]["summary"]
    assert summary["abilities"]["Traffic_Signs"] is None
    assert summary["signs_between"] == [0.25, 0.75]


def test_results_of_the_released_code_are_named_in_its_reading(results, pytester):
    named = "clean=clean.json,0 ms latency=clean.json,200 ms latency=late.json"
    result = results(named, "--drive-reading", "released", "--drive-json", "run.json")
    result.assert_outcomes(passed=2, failed=1)
    document = json.loads((pytester.path / "run.json").read_text())
    assert "RD under 200 ms latency (reading=released) <= 0.60" in {
        row["requirement"] for row in document["requirements"]
    }
    spelled = named.replace("200 ms latency", "200 ms latency (mode=hold, warmup_ticks=20)")
    results(spelled, "--drive-reading", "released").assert_outcomes(passed=2, failed=1)


def test_some_routes_can_be_judged_by_their_ids(results):
    result = results(BOTH, "--drive-routes", "1,2")
    result.stdout.fnmatch_lines(["RD under 200 ms latency = 0.20, limit <= 0.10*2 routes x 1 seed*"])


def test_one_drive_does_not_stand_for_two_settings(results, pytester):
    result = results("clean=clean.json,200 ms latency=clean.json")
    assert result.ret == 4
    assert "'clean' in 'clean.json' and '200 ms latency' in 'clean.json' have the same drive of" in result.stderr.str()


def test_what_the_results_lack_is_named_at_once(results):
    result = results("clean=clean.json")
    assert result.ret == 4
    result.stderr.fnmatch_lines(["*--drive-results cannot answer:*", "*200 ms latency*"])


def test_a_folder_that_is_not_there_is_named_at_once(results):
    result = results("clean=cleen.json,200 ms latency=late.json")
    assert result.ret == 4
    assert "--drive-results, 'clean': 'cleen.json' cannot be read" in result.stderr.str()


@pytest.mark.parametrize("workers", [(), ("-n1",)], ids=["alone", "xdist"])
def test_an_evaluation_that_has_not_ended_is_no_pass(results, pytester, workers):
    for name in ("clean.json", "late.json"):
        write_results(pytester.path / name, {"1": 100.0, "2": 100.0}, planned=220)
    result = results(BOTH, *workers)
    assert result.ret == 4
    text = result.stdout.str() + result.stderr.str()
    assert "--drive-results names an evaluation that has not ended:" in text
    assert "the results of 'clean': 'clean.json' holds 2 of 220 episodes" in text
    assert "Finish the evaluation, or name the routes to judge, with --drive-routes FILE.xml or id,id." in text
    named = results(BOTH, "--drive-routes", "1,2")
    named.assert_outcomes(passed=3)


@pytest.mark.parametrize("planned", ['["1", "2", "3"]', "{}"], ids=["unfinished", "damaged"])
def test_an_evaluation_of_ours_that_has_not_ended_is_no_pass(results, pytester, planned):
    folder = pytester.mkdir("official")
    for route in ("1", "2"):  # a file of each route, as our evaluator leaves them
        write_results(folder / f"{route}.json", {route: 100.0})
    (folder / "drive_robust.planned").write_text(planned)
    result = results("clean=official,200 ms latency=late.json")
    assert result.ret == 4
    text = result.stdout.str() + result.stderr.str()
    told = "'official/drive_robust.planned' is damaged" if planned == "{}" else "holds 2 of 3 episodes, without 3"
    assert told in text


def test_results_that_do_not_say_how_many_were_planned_are_told(results, pytester):
    write_results(pytester.path / "merged.json", {"1": 100.0, "2": 100.0})
    merged = json.loads((pytester.path / "merged.json").read_text())
    del merged["_checkpoint"]["progress"]
    (pytester.path / "merged.json").write_text(json.dumps(merged))
    write_results(pytester.path / "slow.json", {"1": 100.0, "2": 100.0})
    both = "clean=merged.json,200 ms latency=slow.json"
    result = results(both)
    result.assert_outcomes(passed=3)
    told = "drive-robust: the results of 'clean' in 'merged.json' do not say how many routes were planned; those of 2 *"
    result.stdout.fnmatch_lines([told])
    assert "were planned" not in results(both, "--drive-routes", "1,2").stdout.str()
    assert "were planned" not in results(BOTH).stdout.str()


def test_a_plan_finds_everything_there(results):
    result = results(BOTH, "--drive-plan")
    assert result.ret == 0
    result.stdout.fnmatch_lines(["Every episode that the verdicts need is stored: nothing would be driven."])


def test_a_part_of_an_evaluation_that_is_empty_is_none_that_ended(results, pytester):
    folder = pytester.mkdir("parts")
    write_results(folder / "eval_0.json", {"1": 100.0, "2": 100.0})
    (folder / "eval_1.json").touch()
    result = results("clean=parts,200 ms latency=late.json")
    assert result.ret == 4
    result.stderr.fnmatch_lines(["*eval_1.json' is empty: its evaluator ended before the first route"])


def test_routes_that_are_named_must_all_be_there(results):
    result = results(BOTH, "--drive-routes", "1,77")
    assert result.ret == 4
    result.stderr.fnmatch_lines(["*there is no route of results named '77'*"])
    file = results(BOTH, "--drive-routes", "dev10")
    assert file.ret == 4
    assert "lack 10 of 10 episodes" in file.stderr.str()
    missing = results(BOTH, "--drive-routes", "roads.xml")
    assert missing.ret == 4
    assert "there is no route file named 'roads.xml'" in missing.stderr.str()


@pytest.mark.parametrize("workers", [(), ("-n1",)], ids=["alone", "xdist"])
def test_without_seeds_all_repetitions_are_judged(results, pytester, workers):
    whole = {"1": 100.0, "2": 100.0, "3": 100.0, "4": 100.0}
    write_results(pytester.path / "clean.json", whole, dict.fromkeys(whole, 10.0))
    run = ("--drive-json", "run.json", "-k", "clean", *workers)
    result = results("clean=clean.json", *run)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["drive-robust: agent=results *seeds=0,1 *", "*4 routes x 2 seeds*"])
    document = json.loads((pytester.path / "run.json").read_text())
    assert document["settings"]["seeds"] == [0, 1]
    assert document["summaries"][0]["summary"]["ds"] == 55.0
    chosen = results("clean=clean.json", "--drive-seeds", "0", *run)
    chosen.assert_outcomes(passed=1)
    told = "drive-robust: not judged: 4 records of repetition 1. The seeds are given as 0; without seeds all *"
    chosen.stdout.fnmatch_lines(["drive-robust: agent=results *seeds=0 *", told])
    assert chosen.stdout.str().count("not judged: ") == 1


@pytest.mark.parametrize("given", ["ini", "marker"])
def test_seeds_of_the_ini_file_and_of_a_marker_are_given_too(results, pytester, given):
    whole = {"1": 100.0, "2": 100.0, "3": 100.0, "4": 100.0}
    write_results(pytester.path / "clean.json", whole, dict.fromkeys(whole, 10.0), dict.fromkeys(whole, 0.0))
    if given == "ini":
        pytester.makeini("[pytest]\ndrive_verdict = point\ndrive_seeds = 0\n")
    else:
        suite = SUITE.replace("@pytest", "@pytest.mark.drive_robust(seeds=[0])\n@pytest")
        pytester.makepyfile(test_suite=suite)
    result = results("clean=clean.json", "-k", "clean")
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(["*not judged: 4 records of repetition 1, 4 records of repetition 2. The seeds *"])


def test_repetitions_that_one_setting_lacks_are_named(results, pytester):
    whole = {"1": 100.0, "2": 100.0, "3": 100.0, "4": 100.0}
    write_results(pytester.path / "clean.json", whole, whole)
    result = results(BOTH)
    assert result.ret == 4
    text = result.stderr.str()
    assert "route 1 has no repetition 1, only 0" in text
    assert "--drive-seeds 0" in text
    results(BOTH, "--drive-seeds", "0").assert_outcomes(passed=2, failed=1)


def test_a_failure_does_not_round_value_and_limit_into_agreement(results, pytester):
    whole = {str(number): 100.0 for number in range(4)}
    write_results(pytester.path / "clean.json", whole)
    write_results(pytester.path / "late.json", dict.fromkeys(whole, 69.97))
    pytester.makepyfile(test_suite=SUITE.replace("<= 0.60", "<= 0.30").replace("RD under 200 ms latency <= 0.10", ""))
    result = results(BOTH)
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(
        ["RD under 200 ms latency = 0.3003, limit <= 0.30", "*(95 % interval 0.3003 to 0.3003, *"]
    )
