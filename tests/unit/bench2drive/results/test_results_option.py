"""The value of `--drive-results`: which folder is read for which setting, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_drive_robust.bench2drive.results.results_option import parse_results
from pytest_drive_robust.errors import RequirementError, UsageError


def test_settings_are_read_as_sentences_and_paths_may_hold_commas() -> None:
    found = parse_results("clean=a,b/c, latency 200 ms = d=e ,occlusion 0.5 and 100ms latency=f")
    assert found == {
        "clean": Path("a,b/c"),
        "200 ms latency": Path("d=e"),
        "occlusion 0.5 and 100 ms latency": Path("f"),
    }


@pytest.mark.parametrize(
    ("text", "error", "expected"),
    [
        ("clean", UsageError, "expected SETTING=FOLDER"),
        ("clean=", UsageError, "expected SETTING=FOLDER"),
        ("=a", UsageError, "expected SETTING=FOLDER"),
        ("clean=a,CLEAN=b", UsageError, "names 'clean' twice"),
        ("latncy 200 ms=a", RequirementError, "latncy 200 ms"),
        ("claen=a", RequirementError, "there is no setting 'claen'. Did you mean 'clean'?"),
    ],
)
def test_what_does_not_name_results_is_refused(text: str, error: type[UsageError], expected: str) -> None:
    with pytest.raises(error, match=expected):
        parse_results(text)
