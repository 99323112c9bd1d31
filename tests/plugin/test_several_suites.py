"""Several suites in one command, of which one has an ini file of its own."""

from __future__ import annotations

import shutil

import pytest
from suite_runs import GREEN, processes, run


@pytest.fixture
def two(suite):
    """A suite, and a second one in the folder `other`, whose own ini file names the agent `seer`."""
    folder = suite(GREEN)
    other = folder.mkdir("other")
    shutil.copy(folder.path / "test_suite.py", other / "test_other.py")
    (other / "pytest.ini").write_text("[pytest]\ndrive_agent = seer\n")
    return folder


@processes
def test_a_suite_is_not_driven_with_the_agent_of_another_one(two, driven, workers):
    refused = run(two, "test_suite.py", "other/test_other.py", *workers)
    assert refused.ret == 4
    refused.stderr.fnmatch_lines(
        ["*'other/test_other.py' has an ini file of its own, 'other/pytest.ini', with drive_agent = seer, but pytest*"]
    )
    assert driven() == []


@pytest.mark.parametrize("chosen", [("-c", "tox.ini"), ("--drive-agent", "steady"), ("-o", "drive_agent=steady")])
def test_several_suites_are_driven_alike_when_that_was_asked_for(two, chosen):
    run(two, "test_suite.py", "other", *chosen).assert_outcomes(passed=2)


def test_an_ini_file_without_another_value_of_ours_is_no_reason_to_refuse(two):
    (two.path / "other" / "pytest.ini").write_text("[pytest]\ndrive_agent = steady\ncache_dir = elsewhere\n")
    run(two, "test_suite.py", "other").assert_outcomes(passed=2)
