"""`--drive-save` and `--drive-compare`: a run is stored, and the next one is judged against it."""

from __future__ import annotations

import errno
import json
import re
import shlex

import jsonschema
import pytest
from compared_runs import ALSO, EVIDENCE, HOLDS, many_routes, slow_down, stored
from published_schema import run_schema
from report_pages import data_of
from suite_runs import processes, run

from pytest_drive_robust.cli.main import main


@pytest.fixture
def both(suite):
    """Two settings that hold by far, on three routes."""
    return suite(HOLDS, ALSO)


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


def test_an_agent_has_not_changed_when_pytest_is_called_in_another_folder(both, monkeypatch):
    run(both, "--drive-save=before")
    folder = both.path / "elsewhere"
    folder.mkdir()
    monkeypatch.chdir(folder)
    told = run(both, "..", "--drive-compare=before").stdout.str()
    assert "not one score changed in 2 settings against before" in told
    assert "note: the agent" not in told


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


@processes
def test_an_empty_override_sets_a_value_of_the_ini_file_aside_for_one_run(suite, workers):
    folder = suite(HOLDS)
    run(folder, "--drive-json=base.json", "--drive-seeds=3", "--drive-verdict=point")
    with (folder.path / "tox.ini").open("a") as ini:
        ini.write("drive_compare = base.json\ndrive_json = run.json\ndrive_seeds = 3\n")
    slow_down(folder)
    assert run(folder, *workers).ret == 1
    (folder.path / "run.json").unlink()
    aside = [word for key in ("compare", "json", "seeds") for word in ("-o", f"drive_{key}=")]
    result = run(folder, *aside, *workers)
    assert result.ret == 0
    result.stdout.fnmatch_lines(["drive-robust: * seeds=0 *"])
    result.stdout.no_fnmatch_line("*compare*")
    assert not (folder.path / "run.json").exists()


def test_a_run_that_cannot_be_stored_at_its_end_is_not_green(suite, monkeypatch):
    def full(*arguments):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("pytest_drive_robust.regression.references.write_whole", full)
    result = run(suite(HOLDS), "--drive-save=before")
    assert result.ret == 1
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(["ERROR: the run was not stored: *No space left on device"])


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


def test_every_report_says_that_a_run_could_not_be_compared(suite, monkeypatch):
    folder = suite(HOLDS)
    run(folder, "--drive-save=before")
    summary = folder.path / "summary.md"
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(summary))
    folder.makepyfile(
        test_body="""
        from pytest_drive_robust import requirement

        def test_it(drive):
            drive.check(requirement("DS") >= 1)
        """
    )
    result = run(folder, "--drive-compare=before", "test_body.py", "--drive-json=run.json", "--drive-report=look")
    assert result.ret == 1
    told = "ERROR: not compared with before: there is nothing to compare: before holds steady under throttle 0.9"
    result.stdout.fnmatch_lines([f"{told}*"])
    assert [note.startswith(told) for note in json.loads((folder.path / "run.json").read_text())["notes"]] == [True]
    assert [note.startswith(told) for note in data_of(folder.path / "look")["notes"]] == [True]
    assert f"\n- {told}" in summary.read_text()


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
