"""`drive-robust check-agent`."""

from __future__ import annotations

import pytest

from pytest_drive_robust.cli.main import main
from pytest_drive_robust.simulators.routes import resolve_routes

FAKE = "pytest_drive_robust.testing:FakeSimulator"

pytestmark = pytest.mark.usefixtures("agents_folder")


def test_an_agent_that_keeps_the_contract_exits_with_0(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check-agent", "cli_agents:Good", "--sim", FAKE]) == 0
    shown = capsys.readouterr().out
    assert "keeps the contract" in shown
    assert "determinism" in shown


def test_an_agent_that_breaks_the_contract_exits_with_1(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check-agent", "cli_agents:Bad", "--sim", FAKE]) == 1
    shown = capsys.readouterr().out
    assert "breaks the contract" in shown
    assert "act returned None" in shown


def test_every_route_that_is_named_is_checked(capsys: pytest.CaptureFixture[str]) -> None:
    ids = [route.id for route in resolve_routes("full")[:2]]
    assert main(["check-agent", "cli_agents:Good", "--sim", FAKE, "--routes", ",".join(ids)]) == 0
    assert capsys.readouterr().out.count("keeps the contract") == 2


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["nobody"], "no agent named 'nobody'"),
        (["cli_agents:Good", "--sim", "embeded"], "Did you mean 'embedded'"),
        (["cli_agents:Good", "--sim", FAKE, "--routes", "dev11"], "Did you mean 'dev10'"),
    ],
)
def test_what_cannot_be_checked_exits_with_4(
    arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check-agent", *arguments]) == 4
    shown = capsys.readouterr().err
    assert told in shown
    assert shown.startswith("drive-robust: ")


@pytest.mark.parametrize("seed", [-1, 2**53])
def test_a_seed_that_no_run_takes_is_refused(capsys: pytest.CaptureFixture[str], seed: int) -> None:
    assert main(["check-agent", "cli_agents:Good", "--sim", FAKE, f"--seed={seed}"]) == 4
    assert f"--seed holds {seed}, expected" in capsys.readouterr().err
