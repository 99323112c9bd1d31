"""Private names of pytest that we use for want of public ones: where a new pytest moves one, a test says what broke."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from _pytest.config import findpaths
from suite_runs import GREEN, run

import pytest_drive_robust

SOURCE = Path(pytest_drive_robust.__file__).parent


def test_nothing_else_is_imported_from_what_is_private():
    lines = [
        (path.relative_to(SOURCE).as_posix(), line.strip())
        for path in sorted(SOURCE.rglob("*.py"))
        for line in re.findall(r"(?m)^\s*(?:from|import) _pytest\b.*$", path.read_text(encoding="utf-8"))
    ]
    assert lines == [
        ("plugin/driving.py", "from _pytest._code.code import TerminalRepr"),  # for types only
        ("plugin/moved_root.py", "from _pytest.config.findpaths import determine_setup"),
    ]


def test_pytest_finds_its_ini_file_where_we_ask_for_it():
    assert callable(getattr(findpaths, "determine_setup", None)), (
        "mend `found_for` in plugin/moved_root.py: until then a path that exists and stands alone after an option is "
        "refused, though it may be harmless, and two suites with ini files of their own are driven by that of the first"
    )


def test_a_path_after_an_option_is_refused_where_pytest_does_not_say_what_it_does(suite, driven, monkeypatch):
    folder = suite(GREEN)
    folder.mkdir("kept")
    monkeypatch.delattr(findpaths, "determine_setup")
    refused = run(folder, "--drive-store", "kept")
    assert refused.ret == 4
    refused.stderr.fnmatch_lines(["*takes 'kept' for a folder of tests, so it may read another ini file. Write an *"])
    assert driven() == []
    run(folder, "--drive-store=kept").assert_outcomes(passed=1)


def test_a_test_still_knows_the_definitions_of_its_fixtures(request):
    assert hasattr(getattr(request.node, "_fixtureinfo", None), "name2fixturedefs"), (
        "mend `uses_drive` in plugin/fixtures.py: until then a project's own fixture named `drive` counts as ours"
    )


def test_pytest_still_tells_the_keys_of_its_ini_file(pytestconfig):
    given = getattr(pytestconfig, "_inicfg", None) or getattr(pytestconfig, "inicfg", ())
    assert "markers" in given or "addopts" in given, (
        "mend `_given_keys` in plugin/misspelt_names.py: until then a misspelt `drive_...` key is not refused"
    )


@pytest.mark.parametrize("name", ["skipping", "runner"])
def test_the_plugins_of_pytest_that_we_ask_about_marks_have_their_names(pytestconfig, name):
    assert pytestconfig.pluginmanager.has_plugin(name), "mend plugin/skip_marks.py: its answers come from these plugins"
