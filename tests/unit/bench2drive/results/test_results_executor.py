"""Requirements on results that were produced elsewhere: which record answers which task, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from official_records import document, motion_step, record, write

from pytest_drive_robust.bench2drive.results.results_executor import ResultsExecutor
from pytest_drive_robust.bench2drive.results.results_source import ResultsSource
from pytest_drive_robust.domain.outcome import End, InfractionKind, Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import ComparisonError, UsageError
from pytest_drive_robust.metrics.degradation import robustness_degradation
from pytest_drive_robust.metrics.score import driving_score, is_success
from pytest_drive_robust.metrics.summary import summarize
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.report.csv_file import episode_fields
from pytest_drive_robust.runner.plan import EpisodeRequest, Scope
from pytest_drive_robust.verdict.explain import infraction_s


def scope_of(executor: ResultsExecutor, *, seeds: tuple[int, ...] = (0,)) -> Scope:
    return Scope("driver", "results", executor.routes, seeds)


def tasks_of(executor: ResultsExecutor, setting: str = "clean", *, clean: bool = False, seeds: Any = (0,)) -> Any:
    return scope_of(executor, seeds=seeds).need(Setting.parse(setting), clean=clean).requests


def answered(executor: ResultsExecutor, tasks: tuple[EpisodeRequest, ...]) -> list[EpisodeResult]:
    return [executor.submit(task).result(timeout=0) for task in tasks]


def one(tmp_path: Path, item: dict[str, Any]) -> EpisodeResult:
    executor = ResultsExecutor.read(f"clean={write(tmp_path / 'one.json', document(item))}")
    (result,) = answered(executor, tasks_of(executor))
    return result


def test_degradation_of_results_from_elsewhere(tmp_path: Path) -> None:
    clean = write(tmp_path / "clean" / "a.json", document(record("1"), record("2"), record("3", red_light=1)))
    late = [record("1", collisions_vehicle=1), record("2", share=12.3456), record("3", red_light=1, wall_s=301.0)]
    late_folder = write(tmp_path / "late" / "a.json", document(*late)).parent
    executor = ResultsExecutor.read(f"clean={clean},latency 200 ms={late_folder}")
    tasks = tasks_of(executor, "200 ms latency", clean=True)
    executor.check(tasks)
    results = answered(executor, tasks)
    scores = [driving_score(result) for result in results]
    assert scores == [100.0, 100.0, 70.0, 60.0, late[1]["scores"]["score_composed"], 70.0]
    rd = robustness_degradation(results[:3], results[3:])
    assert rd == pytest.approx(1 - (60 + 87.6544 + 70) / 270)
    executor.close()


def test_a_record_becomes_the_episode_that_it_tells_of(tmp_path: Path) -> None:
    given = record("4", share=12.3456, collisions_vehicle=1, completion=80.5, status="Failed - TickRuntime")
    result = one(tmp_path, given)
    assert (result.outcome, result.end) == (Outcome.FAILED, End.TICK_CAP)
    assert driving_score(result) == given["scores"]["score_composed"]
    assert not is_success(result)
    assert {event.kind for event in result.infractions} == {
        InfractionKind.COLLISION_VEHICLE,
        InfractionKind.OUTSIDE_LANES,
    }
    assert (result.infractions[0].x_m, result.infractions[0].y_m) == (1.5, -2.25)
    assert [infraction_s(event, result.dt_s) for event in result.infractions] == [None, None]
    assert episode_fields(result)["first_infraction_s"] is None
    assert result.speed_ratios_pct == (80.0, 120.5)
    assert result.game_s == pytest.approx(42.0)
    assert len(result.trace.rows) == 0
    assert summarize([result]).comfort is None


def test_a_log_of_motion_becomes_the_trace(tmp_path: Path) -> None:
    item = record("4", game_s=1.0)
    log = {str(n): motion_step(forward=0.5, turn_degps=90.0, x_m=0.4 * n) for n in range(20)}
    write(tmp_path / item["save_name"] / "metric_info.json", log)
    trace = one(tmp_path, item).trace
    assert trace.column("speed_mps") == pytest.approx(8.0)
    assert trace.column("forward_mps2") == pytest.approx(0.5)
    assert trace.column("yaw_rate_radps") == pytest.approx(1.5707963)


@pytest.mark.parametrize(
    ("ticks", "steps"),
    [(2, 1), (4, 1), (10, 10)],
    ids=["hold of 100 ms", "hold of 200 ms", "asked in every tick, logs every tenth"],
)
def test_a_log_of_some_ticks_only_is_no_trace_and_has_no_comfort(tmp_path: Path, ticks: int, steps: int) -> None:
    item = record("4", game_s=8.0)
    log = {str(n * steps): motion_step(x_m=0.4 * n * ticks) for n in range(160 // ticks)}
    write(tmp_path / item["save_name"] / "metric_info.json", log)
    result = one(tmp_path, item)
    assert len(result.trace.rows) == 0
    assert summarize([result]).comfort is None


@pytest.mark.parametrize("ticks", [range(1, 160), range(151)], ids=["the first is missing", "saved every tenth"])
def test_a_log_may_lack_a_few_ticks(tmp_path: Path, ticks: range) -> None:
    item = record("4", game_s=8.0)
    write(tmp_path / item["save_name"] / "metric_info.json", {str(n): motion_step(x_m=0.4 * n) for n in ticks})
    assert one(tmp_path, item).trace.column("speed_mps") == pytest.approx(8.0)


@pytest.mark.parametrize("status", ["Failed - Simulation crashed", "Failed", "Started"])
def test_a_fault_of_the_harness_is_never_a_score(tmp_path: Path, status: str) -> None:
    result = one(tmp_path, record("1", status=status, completion=0.0, ratios=()))
    assert result.outcome is Outcome.INFRA_ERROR
    with pytest.raises(ComparisonError):
        summarize([result])


@pytest.mark.parametrize(
    "status",
    ["Failed - Agent crashed", "Failed - Agent couldn't be set up", "Failed - Agent's sensors were invalid"],
)
def test_a_fault_of_the_agent_is_scored(tmp_path: Path, status: str) -> None:
    result = one(tmp_path, record("1", status=status, completion=30.0))
    assert result.outcome is Outcome.AGENT_ERROR
    assert driving_score(result) == 30.0


@pytest.mark.parametrize(
    ("status", "end"),
    [
        ("Failed - Agent deviated from the route", End.DEVIATED),
        ("Failed - Agent got blocked", End.BLOCKED),
        ("Failed - Agent timed out", End.TICK_CAP),
        ("Failed - TickRuntime", End.TICK_CAP),
    ],
)
def test_a_route_that_was_not_driven_to_its_end_is_scored_and_no_success(tmp_path: Path, status: str, end: End) -> None:
    result = one(tmp_path, record("1", status=status, completion=30.0))
    assert (result.outcome, result.end) == (Outcome.FAILED, end)
    assert driving_score(result) == 30.0
    assert not is_success(result)


@pytest.mark.parametrize(("status", "missed"), [("Perfect", {}), ("Completed", {"red_light": 1})])
def test_a_route_that_was_driven_to_its_end_succeeds_without_infractions_only(
    tmp_path: Path, status: str, missed: dict[str, int]
) -> None:
    result = one(tmp_path, record("1", status=status, **missed))
    assert (result.outcome, result.end) == (Outcome.COMPLETED, End.COMPLETED)
    assert is_success(result) is not bool(missed)


def test_repetitions_are_seeds(tmp_path: Path) -> None:
    path = write(tmp_path / "r.json", document(record("1"), record("1", repetition=1, red_light=1)))
    executor = ResultsExecutor.read(f"clean={path}")
    assert [driving_score(result) for result in answered(executor, tasks_of(executor, seeds=(0, 1)))] == [100.0, 70.0]
    (task,) = tasks_of(executor, seeds=(2,))
    with pytest.raises(UsageError, match="has no repetition 2, only 0, 1"):
        executor.submit(task).result(timeout=0)


def test_everything_that_is_missing_is_told_at_once(tmp_path: Path) -> None:
    clean = write(tmp_path / "c.json", document(*(record(str(n)) for n in range(1, 15))))
    late = write(tmp_path / "l.json", document(*(record(route, wall_s=301.0) for route in ("1", "2", "2"))))
    executor = ResultsExecutor.read(f"clean={clean},200 ms latency={late}")
    tasks = (*tasks_of(executor, "200 ms latency"), *tasks_of(executor, "400 ms latency"))
    with pytest.raises(UsageError) as caught:
        executor.check(tasks)
    text = str(caught.value)
    assert "lack 13 of 14 episodes" in text
    assert "route 2 has 2 records of repetition 0, expected one" in text
    assert "route 3 is missing" in text
    assert "and 3 more" in text
    assert "no result set of the setting named '400 ms latency'" in text
    with pytest.raises(UsageError, match="400 ms latency"):
        executor.submit(tasks[-1]).result(timeout=0)


def test_a_record_that_was_copied_into_the_results_of_another_setting_is_noticed(tmp_path: Path) -> None:
    clean = write(tmp_path / "clean.json", document(record("1"), record("2")))
    late = write(tmp_path / "late.json", document(record("1", wall_s=299.5), record("2")))
    with pytest.raises(UsageError, match=r"'clean' .* and '200 ms latency' .* have the same drive of route 2,"):
        ResultsExecutor.read(f"clean={clean},200 ms latency={late}")


def test_an_agent_that_broke_before_anything_was_timed_has_no_drive_in_common(tmp_path: Path) -> None:
    broken = record("1", status="Failed - Agent couldn't be set up", completion=0.0, game_s=0.0, wall_s=0.0)
    clean, late = (write(tmp_path / name, document(broken)) for name in ("clean.json", "late.json"))
    ResultsExecutor.read(f"clean={clean},200 ms latency={late}").check(())


def test_another_route_of_the_same_id_is_noticed(tmp_path: Path) -> None:
    first = write(tmp_path / "a.json", document(record("1", scenario="HighwayExit")))
    other = write(tmp_path / "b.json", document(record("1", scenario="InvadingTurn")))
    executor = ResultsExecutor.read(f"clean={first},200 ms latency={other}")
    with pytest.raises(UsageError, match="is of type InvadingTurn, the test's route of that id HighwayExit"):
        executor.check(tasks_of(executor, "200 ms latency"))


def test_scores_of_other_rules_are_refused(tmp_path: Path) -> None:
    other = record("1", red_light=1)
    other["scores"]["score_composed"] = 49.0
    with pytest.raises(UsageError, match="does not follow from the route completion 100 and the infractions"):
        one(tmp_path, other)


def test_an_infraction_of_an_unknown_kind_is_refused(tmp_path: Path) -> None:
    other = record("1")
    other["infractions"]["collisions_unicorn"] = ["it was there"]
    with pytest.raises(UsageError, match="collisions_unicorn"):
        one(tmp_path, other)


def test_an_export_answers_only_for_its_own_agent_and_setting(tmp_path: Path) -> None:
    from result_factory import make_result

    from pytest_drive_robust.bench2drive.results.writing import record_of

    own = record_of(make_result("1", agent="driver", setting="clean"), index=0, town="Town12", stamp="x")
    path = write(tmp_path / "r.json", document(own))
    executor = ResultsExecutor([ResultsSource.read("200 ms latency", path)])
    with pytest.raises(UsageError, match="driven with the setting 'clean', but is given for '200 ms latency'"):
        answered(executor, tasks_of(executor, "200 ms latency"))
    clean = ResultsExecutor([ResultsSource.read("clean", path)])
    (task,) = Scope("someone", "results", clean.routes, (0,)).need(Setting.CLEAN, clean=False).requests
    with pytest.raises(UsageError, match=r"agent 'driver', but is given for 'someone'\. Give --drive-agent driver"):
        clean.submit(task).result(timeout=0)
