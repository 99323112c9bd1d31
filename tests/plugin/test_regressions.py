"""`--drive-save` and `--drive-compare`: a run is stored, and the next one is judged against it."""

from __future__ import annotations

import errno
import json
import re
import shlex

import jsonschema
import pytest
from published_schema import run_schema
from suite_runs import processes, run

from pytest_drive_robust.cli.main import main
from pytest_drive_robust.simulators.embedded.route_xml import save_routes
from pytest_drive_robust.testing import fake_route

HOLDS = "DS under throttle 0.9 >= 1"
ALSO = "DS under clean >= 1"
EVIDENCE = "--drive-verdict=evidence"


@pytest.fixture
def both(suite):
    """Two settings that hold by far, on three routes."""
    return suite(HOLDS, ALSO)


def many_routes(folder):
    """40 routes: enough for evidence."""
    routes = [fake_route(str(number), length_m=5.0 + 0.15 * number) for number in range(1, 41)]
    save_routes(routes, folder.path / "routes.xml")


def slow_down(folder):
    """The same agent, worse: its code has changed, and its length, else Python may run what it compiled before."""
    conftest = folder.path / "conftest.py"
    conftest.write_text(
        conftest.read_text().replace(
            "ScriptedAgent([Control(throttle=1.0)])", "ScriptedAgent([Control(throttle=0.25)])"
        )
    )


def stored(folder, name):
    return json.loads((folder.path / ".drive-robust" / "runs" / f"{name}.json").read_text())


@processes
def test_a_run_is_stored_with_its_fingerprint(both, workers):
    result = run(both, "--drive-save=before", *workers)
    assert result.ret == 0
    result.stdout.fnmatch_lines(["stored as before; *--drive-compare=before or drive-robust bless before *"])
    document = stored(both, "before")
    assert document["schema"] == 1
    assert document["stored"]["name"] == "before"
    assert {(item["agent"], item["setting"]) for item in document["summaries"]} == {
        ("steady", "throttle 0.9"),
        ("steady", "clean"),
    }
    assert len(document["episodes"]) == 6
    fingerprint = document["fingerprint"]
    assert len(set(fingerprint["routes"].values())) == 3
    assert len(fingerprint["agents"]["steady"]["source"]) == 12
    assert [path.name for path in (both.path / ".drive-robust" / "runs").iterdir()] == ["before.json"]
    assert (both.path / ".drive-robust" / ".gitignore").read_text() == "*\n"


def test_the_advice_on_a_run_that_was_stored_elsewhere_leads_there(both, monkeypatch, capsys):
    """As of one suite of several in a repository, with an ini file of its own."""
    above = both.path.parent
    monkeypatch.chdir(above)
    told = run(both, str(both.path), "--drive-save=before").stdout.str()
    assert f'or cd {both.path} && drive-robust bless before --reason "..."' in told
    capsys.readouterr()
    assert main(["bless", "before", "--reason", "agreed"]) == 4
    assert f"Looked in '{above / '.drive-robust' / 'runs'}'." in capsys.readouterr().err


def test_the_advice_on_a_run_names_the_baselines_of_the_ini_file(both, monkeypatch):
    monkeypatch.chdir(both.path)
    monkeypatch.delenv("CI", raising=False)
    with (both.path / "tox.ini").open("a") as ini:
        ini.write("drive_baselines = accepted runs\n")
    told = run(both, "--drive-save=before").stdout.str()
    (advice,) = re.findall("or drive-robust (bless before .*)", told)
    assert main(shlex.split(advice)) == 0
    assert run(both, "--drive-compare=baseline").ret == 0


def test_without_the_options_no_run_is_stored(both):
    assert run(both).ret == 0
    assert not (both.path / ".drive-robust" / "runs").exists()


def test_a_name_is_made_up_of_date_and_time(suite):
    folder = suite(HOLDS)
    run(folder, "--drive-save")
    run(folder, "--drive-save")
    names = sorted(path.stem for path in (folder.path / ".drive-robust" / "runs").iterdir())
    assert len(names) == 2
    assert all(name.startswith("20") for name in names)


@processes
def test_a_worse_agent_is_red_although_its_requirements_hold(both, workers):
    run(both, "--drive-save=before")
    slow_down(both)
    result = run(both, "--drive-compare=before", *workers)
    assert result.ret == 1
    result.assert_outcomes(passed=2)
    result.stdout.fnmatch_lines(
        [
            "*compared with before*",
            "note: the agent steady changed: source * became *",
            "steady under *: 3 of 3 routes changed",
            "  broken: DS drops by 5 % at most; *",
            "  newly going wrong: * Straight",
            "    was  100.0  completed",
            "    is * out of time at 3.0 s",
            "    replay:  drive-robust -p conftest.py replay * --agent steady --setting * --seed 0 "
            "--routes routes.xml --sim fake",
            "REGRESSION: 2 of 2 settings against before: *",
        ]
    )
    section = result.outlines[next(n for n, line in enumerate(result.outlines) if "compared with before" in line) + 1 :]
    assert all(len(line) <= 100 for line in section if line.startswith("steady "))


def test_evidence_drives_every_route_and_judges_an_unchanged_and_a_worse_agent(suite):
    folder = suite(HOLDS)
    many_routes(folder)
    run(folder, EVIDENCE, "--drive-save=before")
    assert len(stored(folder, "before")["episodes"]) == 40, "a verdict after a few routes does not cut a run short"
    same = run(folder, EVIDENCE, "--drive-compare=before")
    assert same.ret == 0
    same.stdout.fnmatch_lines(
        ["*100.0 -> 100.0*40  pass", "no regression: not one score changed in 1 setting against before"]
    )
    same.stdout.no_fnmatch_line("warning: *")
    slow_down(folder)
    worse = run(folder, EVIDENCE, "--drive-compare=before")
    assert worse.ret == 1
    worse.stdout.fnmatch_lines(["steady*throttle 0.9*40  fail", "REGRESSION: 1 of 1 setting against before: *"])


def test_a_comparison_comes_before_the_run_of_that_name_is_replaced(suite):
    folder = suite(HOLDS)
    run(folder, "--drive-save=main")
    slow_down(folder)
    assert run(folder, "--drive-compare=main", "--drive-save=main").ret == 1
    assert run(folder, "--drive-compare=main").ret == 0


@pytest.mark.parametrize(
    ("compare", "save", "told"),
    [("main", "main", True), ("latest", "now", True), ("auto", "now", True), ("main", "now", False)],
)
def test_a_worse_run_that_the_next_one_is_compared_with_says_so(suite, compare, save, told):
    folder = suite(HOLDS)
    run(folder, "--drive-save=main")
    first = run(folder, f"--drive-compare={compare}", f"--drive-save={save}")
    first.stdout.no_fnmatch_line("warning: the next run with --drive-compare*")
    slow_down(folder)
    worse = run(folder, f"--drive-compare={compare}", f"--drive-save={save}")
    assert worse.ret == 1
    warning = f"warning: the next run with --drive-compare={compare} compares with this run, and so does not show *"
    if told:
        worse.stdout.fnmatch_lines([warning])
    else:
        worse.stdout.no_fnmatch_line(warning)
    assert run(folder, f"--drive-compare={compare}").ret == (0 if told else 1)


def test_alone_the_option_takes_the_newest_run(suite):
    folder = suite(HOLDS)
    run(folder, "--drive-save=one")
    result = run(folder, "--drive-compare")
    assert result.ret == 0
    result.stdout.fnmatch_lines(["*compared with one*"])


@pytest.mark.parametrize(
    ("args", "told"),
    [
        (("--drive-compare=befor",), "there is no stored run named 'befor'."),
        (("--drive-compare=baseline",), "no baseline was blessed yet"),
        (("--drive-compare=missing.json",), "there is no run file named 'missing.json'"),
        (("--drive-compare", "test_suite.py"), "If it was meant as a path to collect, put it before --drive-compare"),
        (("--drive-compare",), "no stored run. Store one with --drive-save"),
        (("--drive-save", "test_suite.py"), "If it was meant as a path to collect, put it before --drive-save"),
        (("--drive-save=latest",), "is a reserved word"),
        (("--drive-fail-on=ds:+5%",), "--drive-fail-on is 'ds:+5%', but DS gets worse"),
        (("--drive-on-mismatch=wrn",), "Did you mean 'warn'?"),
        (("--drive-fail-on=ds:-5%",), "--drive-fail-on says how runs are compared. Add --drive-compare RUN, or"),
        (("--drive-on-mismatch=warn",), "--drive-on-mismatch says how runs are compared"),
        (("--drive-agent", ""), "--drive-agent is empty, expected NAME: drive this agent: "),
        (("-o", "drive_agent="), "-o drive_agent is empty, expected NAME: drive this agent: "),
        (("--drive-compare=",), "--drive-compare is empty, expected REF: judge every setting against a stored run"),
        (("--drive-results", " "), "--drive-results is empty, expected LIST: judge official results"),
        (("--drive-save", "a" * 300), "aaa', which cannot be used: File name too long."),
        (("--drive-agent", f"{'a' * 300}:Mine"), ":Mine' needs the module 'aaa"),
        (("-s", "--drive-act-timeout", "1s"), "--drive-act-timeout needs worker processes"),
        (("--drive-executor", "inline", "--drive-memory", "4"), "--drive-memory needs worker processes"),
        (("--drive-ray-address", "auto"), "--drive-ray-address needs --drive-executor ray"),
        (("--drive-waivers=none.toml",), "there is no file"),
        (("--drive-baselines=blessed",), "--drive-baselines is read to compare runs. Add --drive-compare"),
        (("--drive-b2d-root=x",), "--drive-b2d-root needs --drive-sim bench2drive: add that, or leave"),
        (("--drive-b2d-python=python3",), "--drive-b2d-python needs --drive-sim bench2drive"),
        (("--drive-sim=bench2driv",), "there is no simulator named 'bench2driv'. Did you mean 'bench2drive'?"),
    ],
    ids=lambda value: " ".join(value)[:40] if isinstance(value, tuple) else "",
)
def test_what_cannot_be_used_is_refused_before_anything_was_driven(suite, driven, args, told):
    result = run(suite(HOLDS), *args)
    assert result.ret == 4
    assert told in "\n".join((*result.outlines, *result.errlines))
    assert driven() == []


def test_a_store_that_cannot_be_written_is_refused_before_a_run_is_driven_for_it(suite, driven):
    folder = suite(HOLDS)
    (folder.path / ".drive-robust").write_text("a file")
    result = run(folder, "--drive-store=off", "--drive-save")
    assert result.ret == 4
    result.stderr.fnmatch_lines(["*--drive-save is 'auto', but '*.drive-robust' cannot be written to."])
    assert driven() == []


def test_a_run_that_cannot_be_stored_at_its_end_is_not_green(suite, monkeypatch):
    def full(*arguments):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("pytest_drive_robust.regression.references.write_whole", full)
    result = run(suite(HOLDS), "--drive-save=before")
    assert result.ret == 1
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(["ERROR: the run was not stored: *No space left on device"])


def test_a_run_of_another_simulator_is_refused_before_anything_was_driven(suite, driven):
    folder = suite(HOLDS)
    run(folder, "--drive-save=before")
    (folder.path / "driven.log").unlink()
    result = run(folder, "--drive-sim=broken", "--drive-compare=before")
    assert result.ret == 4
    result.stderr.fnmatch_lines(["*this run cannot be compared with before: the simulator was fake and is broken*"])
    assert driven() == []


def refused(folder, driven, *args):
    """Return what a run says that is refused before it drives."""
    before = len(driven())
    result = run(folder, *args)
    assert result.ret == 4
    assert len(driven()) == before
    return "\n".join((*result.outlines, *result.errlines))


@processes
def test_routes_that_became_others_refuse_the_comparison(suite, driven, workers):
    folder = suite(HOLDS)
    run(folder, "--drive-save=before")
    save_routes([fake_route(str(number), length_m=7.0) for number in (1, 2, 3)], folder.path / "routes.xml")
    told = refused(folder, driven, "--drive-compare=before", *workers)
    assert (
        "could not be compared with before: 3 of 3 routes have changed under the same id: 1, 2, 3. Drive both" in told
    )
    assert "or give --drive-on-mismatch=warn" in told
    assert run(folder, "--drive-compare=before", "--drive-on-mismatch=warn").ret == 0


@processes
def test_fewer_routes_than_before_are_refused(both, driven, workers):
    run(both, "--drive-save=before")
    one = ("--drive-routes", "routes.xml:1", "--drive-compare=before")
    told = refused(both, driven, *one, *workers)
    assert "this run could not be compared with before: this run lacks routes of before: 2 of 3 under " in told
    assert "Drive these routes, too, or give --drive-on-mismatch=warn." in told
    allowed = run(both, *one, "--drive-on-mismatch=warn", "-k", "clean")
    assert allowed.ret == 0
    allowed.stdout.fnmatch_lines(
        ["no regression on 1 of 3 routes in 1 of 2 settings against before: not one score changed"]
    )


def test_what_a_test_asks_for_in_its_body_is_compared_once_it_is_driven(suite):
    folder = suite(HOLDS)
    run(folder, "--drive-save=before")
    folder.makepyfile(
        test_body="""
        def test_it(drive):
            assert drive.ds("throttle 0.9") >= 1
        """
    )
    one = ("--drive-routes", "routes.xml:1", "--drive-compare=before", "test_body.py")
    result = run(folder, *one)
    assert result.ret == 1
    result.stdout.fnmatch_lines(["NOT COMPARED with before: this run lacks routes of before: 2 of 3 under *"])
    assert "Drive these routes, too, or give" in result.stdout.str()
    folder.makepyfile(
        test_stated="""
        import pytest
        from pytest_drive_robust import requirements

        @pytest.mark.parametrize("stated", requirements("DS under throttle 0.3 >= 1"))
        def test_it(drive, stated):
            drive.check(stated)
        """
    )
    result = run(folder, "--drive-compare=before", "test_body.py", "test_stated.py")
    assert result.ret == 0, "only what the other test asks for is in both runs"
    result.stdout.fnmatch_lines(["no regression in 1 of 2 settings against before: not one score changed"])


def test_another_time_of_standing_is_refused(suite, driven):
    folder = suite(HOLDS)
    run(folder, "--drive-save=before")
    told = refused(folder, driven, "--drive-compare=before", "--drive-stuck-stop=60")
    assert "episodes of a stuck agent were never stopped early and are stopped after 60 s" in told


def test_another_version_of_the_simulator_is_refused(suite, driven):
    folder = suite(HOLDS)
    run(folder, "--drive-save=before")
    path = folder.path / ".drive-robust" / "runs" / "before.json"
    document = stored(folder, "before")
    version = document["episodes"][0]["versions"]["fake"]
    for episode in document["episodes"]:
        episode["versions"]["fake"] = "of last year"
    path.write_text(json.dumps(document))
    told = refused(folder, driven, "--drive-compare=before")
    assert f"the simulator was fake (of last year) and is fake ({version})" in told


def test_other_versions_are_refused_before_driving_where_that_was_asked_for(suite, driven):
    folder = suite(HOLDS)
    run(folder, "--drive-save=before")
    path = folder.path / ".drive-robust" / "runs" / "before.json"
    document = stored(folder, "before")
    (python,) = {episode["versions"]["python"] for episode in document["episodes"]}
    for episode in document["episodes"]:
        episode["versions"]["python"] = "3.0"
    path.write_text(json.dumps(document))
    assert run(folder, "--drive-compare=before").ret == 0
    told = refused(folder, driven, "--drive-compare=before", "--drive-on-mismatch=refuse")
    assert f"python was 3.0 and is {python}" in told


def test_a_run_with_nothing_in_common_is_refused(both, driven):
    run(both, "--drive-save=before", "-k", "clean")
    told = refused(both, driven, "--drive-compare=before", "-k", "0.9")
    assert "they have no agent, setting and route in common. This run drives steady under throttle 0.9" in told
    assert "before holds steady under clean." in told


def test_a_run_that_ended_early_replaces_no_complete_one(both):
    run(both, "--drive-save=before")
    kept = stored(both, "before")
    conftest = both.path / "conftest.py"
    interrupt = """

def pytest_runtest_logreport(report):
    if report.when == "call":
        raise KeyboardInterrupt
"""
    conftest.write_text(conftest.read_text() + interrupt)
    told = both.runpytest_subprocess("--drive-robust", "--drive-save=before").stdout.str()
    assert "not stored: this run is incomplete, so the stored run before stays as it was" in told
    assert stored(both, "before") == kept
    told = both.runpytest_subprocess("--drive-robust", "--drive-save=early").stdout.str()
    assert "stored as early, incomplete: run again before you compare with it" in told
    assert "next:" not in told


BROKEN = "DS under throttle 0.9 >= 100"


@processes
def test_a_run_that_its_first_failure_ended_replaces_no_complete_one(suite, workers):
    folder = suite(BROKEN, *(f"DS under throttle 0.{number} >= 1" for number in range(1, 9)))
    run(folder, "--drive-save=before", *workers)
    kept = stored(folder, "before")
    told = run(folder, "--drive-save=before", "--drive-json=run.json", "-x", *workers).stdout.str()
    assert "not stored: this run is incomplete, so the stored run before stays as it was" in told
    assert stored(folder, "before") == kept
    (note,) = json.loads((folder.path / "run.json").read_text())["notes"]
    assert re.match(r"the run (ended early|was interrupted): requirements whose tests had not ended by then", note)


@processes
def test_a_run_that_its_first_failure_ended_is_not_taken_for_whole(suite, driven, monkeypatch, capsys, workers):
    monkeypatch.delenv("CI", raising=False)
    folder = suite(HOLDS, BROKEN, *(f"DS under throttle 0.{number} >= 1" for number in range(1, 9)))
    run(folder, "--drive-save=before")
    run(folder, "--drive-save=early", "-x", *workers)
    assert stored(folder, "early")["ended_early"] is True
    assert stored(folder, "before")["ended_early"] is False
    capsys.readouterr()
    assert main(["compare", "before", "early"]) == 1
    told = capsys.readouterr().out.splitlines()
    assert re.match(r"NOT JUDGED: \d of \d+ settings against before: steady under throttle 0\.\d: not sc", told[-1])
    assert "not scored: not all tests of the run came to their verdicts" in told[-1]
    assert main(["compare", "early", "before"]) == 4
    lacks = "not all tests of early came to their verdicts, and it lacks steady"
    assert f"NOT COMPARED with early: {lacks}" in capsys.readouterr().out
    assert main(["bless", "early", "--reason", "why"]) == 4
    assert "early is incomplete: not all of its tests came to their verdicts." in capsys.readouterr().err
    assert main(["-p", "conftest.py", "limits", "--run", "early", "--agent", "steady"]) == 4
    assert "'early' is incomplete: not all of its tests came to their verdicts, so" in capsys.readouterr().err
    told = refused(folder, driven, "--drive-compare=early")
    assert f"this run could not be compared with early: {lacks}" in told
    assert run(folder, "--drive-compare=early", "-k", "throttle-0.9 and not 100").ret == 0  # all of this is in it


@pytest.mark.parametrize(
    ("workers", "crash", "told"),
    [
        ((), "def pytest_runtest_logfinish():\n    raise RuntimeError('a plugin that breaks')\n", "ended early"),
        (
            ("-n1", "--max-worker-restart=0"),
            "@pytest.hookimpl(trylast=True)\ndef pytest_runtest_teardown(nextitem):\n    os._exit(3)\n",
            "lost a worker process",
        ),
    ],
    ids=["pytest", "worker"],
)
def test_a_run_that_a_crash_ended_is_not_taken_for_whole(suite, workers, crash, told):
    folder = suite(HOLDS, ALSO, conftest=f"\n\n{crash}")
    folder.runpytest_subprocess("--drive-robust", "--drive-save=early", *workers)
    document = stored(folder, "early")
    assert document["ended_early"] is True
    assert document["notes"] == [
        f"the run {told}: requirements whose tests had not ended by then are not in this report"
    ]


@pytest.mark.parametrize("workers", [(), ("-n1",)], ids=["one-process", "one-worker"])
def test_a_run_of_which_a_test_broke_before_it_asked_is_not_taken_for_whole(suite, monkeypatch, workers):
    flaky = "\n\n@pytest.fixture(autouse=True)\ndef network(request):\n"
    flaky += '    assert "throttle" not in request.node.name or "DOWN" not in os.environ, "no network"\n'
    folder = suite(HOLDS, ALSO, conftest=flaky)
    run(folder, "--drive-save=before")
    kept = stored(folder, "before")
    monkeypatch.setenv("DOWN", "today")
    result = run(folder, "--drive-save=before", "--drive-compare=before", *workers)
    result.assert_outcomes(passed=1, errors=1)
    result.stdout.fnmatch_lines(["*NOT JUDGED: 1 of 2 settings against before: steady under throttle 0.9: *"])
    assert stored(folder, "before") == kept
    run(folder, "--drive-save=down", *workers)
    document = stored(folder, "down")
    assert document["ended_early"] is True
    (note,) = document["notes"]
    assert re.match(r"test_suite.py::test_requirement\[ds-throttle\S+ broke: what it had not judged ", note)


def test_a_run_without_a_file_that_cannot_be_collected_is_not_taken_for_whole(suite):
    folder = suite(HOLDS)
    (folder.path / "test_other.py").write_text("import nothing_of_that_name")
    run(folder, "--drive-save=early", "--continue-on-collection-errors")
    document = stored(folder, "early")
    assert document["ended_early"] is True
    assert document["notes"] == ["test_other.py broke: what it had not judged by then is not in this report"]


def test_a_run_of_which_a_test_broke_between_two_verdicts_is_not_taken_for_whole(suite):
    body = "    drive.ds('clean')\n    open('missing.txt')\n    drive.ds('throttle 0.9')\n"
    folder = suite(HOLDS, test=f"\n\ndef test_both(drive):\n{body}")
    run(folder, "--drive-save=early").assert_outcomes(passed=1, failed=1)
    document = stored(folder, "early")
    assert document["ended_early"] is True
    assert document["notes"] == ["test_suite.py::test_both broke: what it had not judged by then is not in this report"]


def test_a_run_with_a_test_that_fails_for_itself_is_complete(suite):
    own = "    assert False\n\ndef test_plain():\n    assert False\n"
    folder = suite(HOLDS, test=f"\n\ndef test_own(drive):\n    drive.ds('throttle 0.9')\n{own}")
    run(folder, "--drive-save=before").assert_outcomes(passed=1, failed=2)
    assert stored(folder, "before")["ended_early"] is False


def test_a_run_whose_last_test_failed_is_complete_with_x_too(suite):
    folder = suite(ALSO, BROKEN)
    result = run(folder, "--drive-save=before", "--drive-json=run.json", "-x")
    result.stdout.fnmatch_lines(["stored as before; *"])
    assert json.loads((folder.path / "run.json").read_text())["notes"] == []


def test_a_run_whose_time_was_spent_is_no_reference(suite, driven):
    folder = suite(HOLDS)
    run(folder, "--drive-save=before")
    document = stored(folder, "before")
    del document["episodes"][1:]
    document["summaries"][0]["episodes_finished"] = 1
    (folder.path / "early.json").write_text(json.dumps(document))
    told = refused(folder, driven, "--drive-compare=early.json")
    assert "could not be compared with early.json: early.json is incomplete under throttle 0.9: 2 episodes were" in told
    assert "Run the command of that run again, or give --drive-on-mismatch=warn." in told


def test_an_inconclusive_comparison_is_red_where_that_was_asked_for(suite):
    folder = suite(test='def test_it(drive): assert drive.ds("throttle 0.9") >= 1')
    run(folder, "--drive-save=before")
    slow_down(folder)
    found = (EVIDENCE, "--drive-compare=before")
    assert run(folder, *found, "--drive-json=found.json").ret == 0
    document = json.loads((folder.path / "found.json").read_text())
    jsonschema.validate(document, run_schema())
    comparison = document["comparison"]
    assert [cell["verdict"] for cell in comparison["cells"]] == ["inconclusive"]
    result = run(folder, *found, "--drive-inconclusive=fail")
    assert result.ret == 1
    result.stdout.fnmatch_lines(["INCONCLUSIVE: 1 of 1 setting against before: steady under throttle 0.9"])


def test_a_run_that_stopped_at_its_verdicts_is_no_reference(suite, driven):
    folder = suite(HOLDS)
    many_routes(folder)
    run(folder, EVIDENCE, "--drive-json=early.json")
    told = refused(folder, driven, EVIDENCE, "--drive-compare=early.json")
    assert "with early.json: early.json was driven only until its verdicts were clear" in told
    assert "Drive that run with --drive-save or --drive-verdict=point, or" in told
    run(folder, "--drive-verdict=point", "--drive-json=whole.json")
    assert run(folder, EVIDENCE, "--drive-compare=whole.json").ret == 0


def test_episodes_that_broke_in_the_simulator_are_no_pass(suite):
    folder = suite(ALSO)
    run(folder, "--drive-save=before")
    conftest = folder.path / "conftest.py"
    whole = "return LoggedSimulator(replace(options, tick_cap=60))"
    conftest.write_text(conftest.read_text().replace(whole, "return broken(options)"))
    result = run(folder, "--drive-compare=before")
    assert result.ret == 1
    result.stdout.fnmatch_lines(["ERROR: not compared with before: there is nothing to compare*"])


def test_a_file_that_the_ini_file_compares_with_starts_from_the_root_folder_and_a_name_stays_one(both, monkeypatch):
    assert run(both, "--drive-save=before", "--drive-json=run.json").ret == 0
    ini = both.path / "tox.ini"
    known = ini.read_text()
    monkeypatch.chdir(both.mkdir("below"))
    for compared, told in (("run.json", str(both.path / "run.json")), ("before", "before")):
        ini.write_text(f"{known}drive_compare = {compared}\n")
        result = run(both, "..")
        assert result.ret == 0
        result.stdout.fnmatch_lines([f"*compare={told}*"])
    refused = run(both, "..", "--drive-compare=run.json")  # the command line starts from here
    assert refused.ret == 4
    refused.stderr.fnmatch_lines(["*there is no run file named 'run.json'*"])
