"""A session of pytest inside another one, as tests of plugins run it, knows its own names and leaves the others."""

from __future__ import annotations

TEST = """
import pytest
from pytest_drive_robust import requirements

INNER = '''
def test_it():
    from pytest_drive_robust.registry.registry import default_registry
    assert "steady" not in dict(default_registry().names("agents"))
'''

def test_inner(pytester):
    pytester.makepyfile(INNER)
    pytester.runpytest_inprocess({arguments}).assert_outcomes(passed=1)

@pytest.mark.parametrize("agent", ["steady", "seer"])
def test_after(drive, agent):
    drive.check(requirements("DS under throttle 0.8 >= 60")[0])
"""


def test_a_session_inside_another_one_leaves_its_names(suite, plugin_args):
    arguments = ", ".join(map(repr, ("--noconftest", *plugin_args)))
    folder = suite(test=TEST.format(arguments=arguments), conftest="\npytest_plugins = ['pytester']\n")
    result = folder.runpytest_subprocess("--drive-robust", "--drive-report", "pages")
    assert result.ret == 0
    result.assert_outcomes(passed=3)
    result.stdout.fnmatch_lines("report: *pages*")
