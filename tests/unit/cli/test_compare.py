"""`drive-robust runs`, `compare` and `bless`, in the process and from outside."""

from __future__ import annotations

import functools
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from result_factory import crashed_simulation, scored

from pytest_drive_robust.cli.main import main
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.regression.runs import StoredRuns
from pytest_drive_robust.report.json_file import json_text, run_as_json
from pytest_drive_robust.report.run_result import RunResult
from pytest_drive_robust.store.events import Asked, Event, Identified, Used

SCORES = [100.0, 60.0, 100.0, 36.0] * 10
SETTING = "200 ms latency"


@pytest.fixture(autouse=True)
def _at_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("CI", raising=False)
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    monkeypatch.setenv("GIT_CONFIG_GLOBAL", str(tmp_path / "gitconfig"))


@functools.cache
def document(*, factor: float = 1.0, crash: bool = False, digest: str = "d0") -> dict[str, object]:
    """A run of one agent, clean and under latency; `factor` is what becomes of the scores under latency."""
    episodes: dict[str, EpisodeResult] = {}
    asked: list[Event] = []
    for setting, scale in (("clean", 1.0), (SETTING, factor)):
        results = [scored(str(n), score * scale, setting=setting) for n, score in enumerate(SCORES, start=1)]
        if crash:
            results[3] = crashed_simulation("4", setting=setting)
        keys = {f"{setting} {result.episode.route_id}": result for result in results}
        episodes.update(keys)
        asked += [Asked("driver", "routes.xml", setting, (0,), tuple(keys)), Used(tuple(keys))]
    routes = tuple(f"{n}={digest}" for n in range(1, len(SCORES) + 1))
    identified = Identified("driver", "agents 1", "abc", "", routes)
    run = RunResult.of(RunOptions(simulator="embedded"), [identified, *asked], episodes.get, versions={})
    return run_as_json(run)


def store(name: str, **given: object) -> Path:
    return StoredRuns(Path.cwd()).save(document(**given), json_text, name=name)  # type: ignore[arg-type]


def test_runs_are_listed_with_their_size_the_oldest_first(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["runs", "list"]) == 0
    assert "no stored run" in capsys.readouterr().out
    first, second = store("zebra"), store("ant")
    os.utime(first, (1, 1))
    os.utime(second, (2, 2))
    (first.parent / "torn.json").write_text("{")
    assert main(["runs", "list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[:4]] == ["name", "zebra", "ant", "torn"]
    assert lines[1].split()[-3:] == ["driver", "2", "80"]
    assert "torn.json' is no JSON" in lines[4]


def test_a_run_that_is_no_worse_exits_with_0(capsys: pytest.CaptureFixture[str]) -> None:
    store("a")
    store("b", factor=0.99)
    assert main(["compare", "a", "b"]) == 0
    shown = capsys.readouterr().out
    assert "no regression shown in 2 settings against a" in shown
    assert all(len(line) <= 100 for line in shown.splitlines() if "replay" not in line)


def test_a_regression_exits_with_1_and_shows_the_routes(capsys: pytest.CaptureFixture[str]) -> None:
    store("a")
    path = store("b", factor=0.5)
    assert main(["compare", "a", str(path)]) == 1
    shown = capsys.readouterr().out
    assert "REGRESSION: 1 of 2 settings against a: driver under 200 ms latency" in shown
    assert "broken: DS drops by 5 % at most; 74.00 -> 37.00 (-50.0 %) on 40 routes" in shown
    assert shown.count("newly failing: ") == 6
    assert "15 more newly failing" in shown
    assert 'replay:  drive-robust replay 1 --agent driver --setting "200 ms latency" --seed 0' in shown


@pytest.mark.parametrize(
    ("limit", "code"), [("ds:-60%", 0), ("ds:-40", 0), ("ds:-10", 1), ("sr:-0.1", 1), ("rd:+0.05", 1), ("rd:+0.6", 0)]
)
def test_fail_on_says_what_may_get_worse(limit: str, code: int) -> None:
    store("a")
    store("b", factor=0.5)
    assert main(["compare", "a", "b", "--fail-on", limit]) == code


def test_fail_on_may_be_repeated() -> None:
    store("a")
    store("b", factor=0.5)
    assert main(["compare", "a", "b", "--fail-on", "ds:-60%", "--fail-on", "rd:+0.05"]) == 1


def test_other_routes_are_refused_unless_allowed(capsys: pytest.CaptureFixture[str]) -> None:
    store("a")
    store("b", digest="d1")
    assert main(["compare", "a", "b"]) == 4
    shown = capsys.readouterr().out
    assert "NOT COMPARED with a: 40 of 40 routes are others by the same id" in shown
    assert "DS" not in shown.splitlines()[1]
    assert main(["compare", "a", "b", "--on-mismatch", "warn"]) == 0


def test_a_blessed_run_is_a_reference_for_later_ones(capsys: pytest.CaptureFixture[str]) -> None:
    store("a")
    store("b", factor=0.5)
    Path("gitconfig").write_text("[user]\n\tname = Planning Team\n\temail = planning@example.org\n")
    assert main(["bless", "a", "--reason", "first baseline"]) == 0
    assert "80 scores added, 0 replaced, 0 others kept" in capsys.readouterr().out
    told = json.loads(Path("suites/baselines/driver.json").read_text())
    (blessing,) = told["blessings"].values()
    assert (blessing["by"], blessing["reason"], blessing["run"]) == (
        "Planning Team <planning@example.org>",
        "first baseline",
        "a",
    )
    assert main(["compare", "baseline", "a"]) == 0
    assert main(["compare", "baseline:driver", "latest"]) == 1
    assert main(["compare", "suites/baselines/driver.json", "b"]) == 1


def test_nobody_is_made_up_where_git_knows_nobody() -> None:
    store("a")
    assert main(["bless", "a", "--reason", "why"]) == 0
    (blessing,) = json.loads(Path("suites/baselines/driver.json").read_text())["blessings"].values()
    assert blessing["by"] is None
    assert blessing["commit"] is None


def test_ci_never_blesses(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    store("a")
    monkeypatch.setenv("CI", "true")
    assert main(["bless", "a", "--reason", "why"]) == 4
    assert "CI never blesses" in capsys.readouterr().err
    assert not Path("suites").exists()


def test_a_run_with_a_broken_simulator_is_not_blessed(capsys: pytest.CaptureFixture[str]) -> None:
    store("a", crash=True)
    assert main(["bless", "a", "--reason", "why"]) == 4
    assert "broke in the simulator" in capsys.readouterr().err


def test_a_baseline_is_not_blessed_again(capsys: pytest.CaptureFixture[str]) -> None:
    store("a")
    main(["bless", "a", "--reason", "why"])
    for reference in ("baseline", "suites/baselines/driver.json"):
        assert main(["bless", reference, "--reason", "why"]) == 4
        assert "is a baseline, expected a run" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["compare", "before", "befor"], "Did you mean 'before'"),
        (["compare", "before", "x.json"], "no run file named 'x.json'"),
        (["compare", "before", "other.json"], "is no run"),
        (["compare", "before", "old.json"], "has schema 99"),
        (["compare", "before", "torn.json"], "is damaged"),
        (["compare", "baseline", "before"], "no baseline was blessed yet"),
        (["compare", "before", "before", "--fail-on", "ds"], "--fail-on is 'ds'"),
        (["compare", "before", "before", "--verdict", "evidnce"], "Did you mean 'evidence'"),
        (["compare", "before", "before", "--on-mismatch", "wrn"], "Did you mean 'warn'"),
        (["bless", "befor", "--reason", "why"], "Did you mean 'before'"),
        (["bless", "before", "--reason", " "], "needs a reason"),
    ],
)
def test_what_cannot_be_used_exits_with_4(arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    store("before")
    Path("other.json").write_text("{}")
    Path("old.json").write_text(json.dumps({"schema": 99, "settings": {}, "summaries": [], "episodes": []}))
    torn = {"schema": 1, "settings": {}, "summaries": [{}], "episodes": []}
    Path("torn.json").write_text(json.dumps(torn))
    assert main(arguments) == 4
    shown = capsys.readouterr().err
    assert told in shown
    assert shown.startswith("drive-robust: ")


def test_runs_are_found_from_a_folder_below(monkeypatch: pytest.MonkeyPatch) -> None:
    store("a")
    Path("deep/er").mkdir(parents=True)
    monkeypatch.chdir("deep/er")
    assert main(["compare", "a", "a"]) == 0


def test_the_commands_work_as_a_program(tmp_path: Path) -> None:
    store("a")
    store("b", factor=0.5)
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    command = [sys.executable, "-m", "pytest_drive_robust.cli"]
    codes = {
        ("compare", "a", "a"): 0,
        ("compare", "a", "b"): 1,
        ("compare", "a", "nothing"): 4,
        ("bless", "a", "--reason", "why"): 0,
    }
    for arguments, code in codes.items():
        done = subprocess.run(
            [*command, *arguments], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == code, done.stdout + done.stderr
        assert "Traceback" not in done.stderr
