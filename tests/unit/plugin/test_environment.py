"""Which variables a warning names: those that a test has changed, and nobody else."""

from __future__ import annotations

import os
from types import SimpleNamespace
from typing import Any

import pytest

from pytest_drive_robust.plugin.environment import environment_of, keep_environment, variables_of_tests_told


@pytest.fixture
def item(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A test, after collection, that keeps what it is warned of."""
    for name in ("OF_A_TEST", "OF_A_LIBRARY"):
        monkeypatch.setenv(name, "")  # so that it is put back
        monkeypatch.delenv(name)
    warnings: list[str] = []
    config = SimpleNamespace(stash=pytest.Stash())
    keep_environment(config)  # type: ignore[arg-type]
    return SimpleNamespace(config=config, warn=lambda warning: warnings.append(str(warning)), warnings=warnings)


def drive(item: Any, **variables: str) -> None:
    with variables_of_tests_told(item):
        os.environ.update(variables)


def test_a_variable_of_a_test_is_told_once_also_where_it_is_put_back(item: Any) -> None:
    os.environ["OF_A_TEST"] = "1"
    drive(item)
    del os.environ["OF_A_TEST"]
    drive(item)
    assert [warning.count("collected: OF_A_TEST. The agent") for warning in item.warnings] == [1]
    assert "OF_A_TEST" not in environment_of(item.config)


def test_what_a_library_sets_while_something_drives_is_nobodys(item: Any) -> None:
    drive(item, OF_A_LIBRARY="True")
    drive(item)
    assert item.warnings == []


def test_many_variables_are_told_by_the_first_ones(item: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    for number in range(7):
        monkeypatch.setenv(f"AA{number}", "1")
    drive(item)
    assert ["AA0, AA1, AA2, AA3, AA4 and 2 more. The agent" in warning for warning in item.warnings] == [True]
