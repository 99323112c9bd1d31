from __future__ import annotations

import sys

from pytest_drive_robust.runner.cache_key.distributions import versions_of


def test_the_minor_version_of_python_counts():
    assert versions_of([]) == {"python": f"{sys.version_info.major}.{sys.version_info.minor}"}


def test_a_module_that_is_not_there_is_absent():
    assert versions_of(["no_such_module"])["no_such_module"] == "absent"


def test_a_part_of_a_library_has_the_version_of_the_whole():
    assert versions_of(["numpy.linalg"])["numpy.linalg"] == versions_of(["numpy"])["numpy"]
