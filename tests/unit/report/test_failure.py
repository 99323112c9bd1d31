from __future__ import annotations

import shlex
from dataclasses import replace

import pytest
from result_factory import infraction, make_result, scored, trace_of

from pytest_drive_robust.domain.outcome import End, InfractionKind
from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.metrics.table import Metric
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.perturbations import InferenceLatency, PartialObservation, Setting
from pytest_drive_robust.report.failure import failure_text
from pytest_drive_robust.verdict.evaluate import evaluate
from pytest_drive_robust.verdict.object_form import requirement
from pytest_drive_robust.verdict.requirement import Requirement

LATENCY = Setting.of(InferenceLatency(ms=200))


def text_of(wanted, clean, perturbed, *, options=None, routes_spec="dev10", privileged=False):
    verdict = evaluate(wanted, agent="driver", clean=clean, perturbed=perturbed)
    return failure_text(verdict, options or RunOptions(), routes_spec=routes_spec, privileged=privileged)


def hit(route_id, *, scenario="HardBreakRoute", setting=str(LATENCY)):
    crash = infraction(InfractionKind.COLLISION_VEHICLE, second=1.5)
    return make_result(
        route_id,
        scenario=scenario,
        setting=setting,
        end=End.BLOCKED,
        completion_pct=20.0,
        infractions=[crash],
        trace=trace_of(40, speed_mps=5.0, x_m=range(0, 80, 2)),
    )


CLEAN = [scored(str(number), 100.0) for number in range(501, 505)]
PERTURBED = [hit("501"), *(scored(str(number), 100.0, setting=str(LATENCY)) for number in (502, 503, 504))]


def test_the_message_has_value_limit_interval_summaries_worst_routes_and_replay():
    lines = text_of(requirement("RD", LATENCY) <= 0.10, CLEAN, PERTURBED).splitlines()
    assert lines[0].startswith("RD under 200 ms latency = 0.22, limit <= 0.10   (95 % interval ")
    assert lines[0].endswith(", 4 routes x 1 seed)")
    assert lines[1].split() == ["clean", "perturbed"]
    assert lines[2].split() == ["DS", "100.00", "78.00"]
    assert lines[3].split() == ["SR", "1.00", "0.75"]
    assert lines[4].split() == ["worst", "routes"]
    assert lines[5].startswith("  501 HardBreakRoute, diverged at ")
    assert lines[6].split() == ["clean", "100.0", "completed"]
    assert lines[7].startswith("    perturbed   12.0  collision with vehicle at 1.5 s")
    assert lines[-1] == ('  replay:  drive-robust replay 501 --agent driver --setting "200 ms latency" --seed 0')


def test_value_and_limit_are_not_rounded_into_agreement():
    perturbed = [replace(scored("1", 100.0, setting=str(LATENCY)), route_completion_pct=69.97)]
    first = text_of(requirement("RD", LATENCY) <= 0.30, [scored("1", 100.0)], perturbed).partition("\n")[0]
    assert first.startswith("RD under 200 ms latency = 0.3003, limit <= 0.30   (")
    first = text_of(requirement("DS", LATENCY) >= 69.971, [], perturbed).partition("\n")[0]
    assert first.startswith("DS under 200 ms latency = 69.97, limit >= 69.971   (")


@pytest.mark.parametrize(
    ("limit", "decision", "ends"), [(0.34, "fail", "0.341 to 0.47"), (0.37, "pass", "0.34 to 0.467")]
)
def test_an_interval_is_not_rounded_into_containing_a_limit_that_it_excludes(limit, decision, ends):
    clean = [scored(str(number), 100.0) for number in range(40)]
    perturbed = [scored(str(number), 40.0 + 10.0 * (number % 5), setting=str(LATENCY)) for number in range(40)]
    rule = VerdictRule("evidence")
    wanted = requirement("RD", LATENCY) <= limit
    verdict = evaluate(wanted, agent="driver", clean=clean, perturbed=perturbed, verdict_rule=rule, decision=decision)
    text = failure_text(verdict, RunOptions(), routes_spec="dev10", privileged=False)
    assert f"(90 % interval {ends}, 40 routes x 1 seed)" in text


@pytest.mark.parametrize(
    ("wanted", "told"),
    [
        (requirement("DS") >= 5, "neither DS < 5 nor DS > 2.5 is shown"),
        (requirement("DS") >= 60, "neither DS < 60 nor DS > 50 is shown"),
        (requirement("SR") >= 0.05, "neither SR < 0.05 nor SR > 0.025 is shown"),
        (requirement("RD", LATENCY) <= 0.90, "neither RD > 0.90 nor RD < 0.95 is shown"),
        (requirement("RD", LATENCY) <= 0.30, "neither RD > 0.30 nor RD < 0.40 is shown"),
    ],
    ids=str,
)
def test_the_margin_that_is_told_is_the_one_that_is_judged(wanted, told):
    clean = [scored(str(number), 100.0) for number in range(20)]
    perturbed = [scored(str(number), 100.0, setting=str(wanted.setting)) for number in range(20)]
    rule = VerdictRule("evidence")
    verdict = evaluate(
        wanted, agent="driver", clean=clean, perturbed=perturbed, verdict_rule=rule, decision="inconclusive"
    )
    assert told in failure_text(verdict, RunOptions(), routes_spec="dev10", privileged=False)
    assert verdict.margin == pytest.approx(abs(float(told.split()[-3]) - wanted.limit))


def test_an_absolute_requirement_needs_no_clean_column():
    lines = text_of(requirement("SR", LATENCY) >= 0.9, [], PERTURBED).splitlines()
    assert lines[0].startswith("SR under 200 ms latency = 0.75, limit >= 0.90")
    assert lines[1].split() == ["perturbed"]
    assert lines[4].split() == ["worst", "routes"]


def test_a_clean_requirement_calls_its_column_clean():
    clean = [scored("1", 40.0), scored("2", 100.0)]
    lines = text_of(requirement("DS") >= 90, [], clean).splitlines()
    assert lines[1].split() == ["clean"]


def test_a_long_stack_of_failures_leaves_room_for_value_and_limit():
    stack = Setting.of(*[PartialObservation(ratio=0.5)] * 9)
    under = str(stack)
    perturbed = [hit("501", setting=under), *(scored(str(number), 100.0, setting=under) for number in (502, 503, 504))]
    first = text_of(requirement("RD", stack) <= 0.10, CLEAN, perturbed).partition("\n")[0]
    assert first.startswith("RD under occlusion 0.5 and occlusion 0.5")
    assert first.endswith("... = 0.22, limit <= 0.10")
    assert len(first) == 100


@pytest.mark.parametrize("seeds", [1, 2])
def test_nothing_but_the_replay_command_is_wider_than_a_hundred_columns(seeds):
    setting = Setting.of(PartialObservation(ratio=0.5), InferenceLatency(ms=200))
    name = str(setting)
    long = "VanillaNonSignalizedTurnEncounterStopsign" * 2
    clean = [
        replace(scored("26406", 100.0, scenario=long, seed=seed), infractions=(infraction(InfractionKind.RED_LIGHT),))
        for seed in range(seeds)
    ]
    worse = hit("26406", scenario=long, setting=name)
    perturbed = [replace(worse, episode=replace(worse.episode, seed=seed)) for seed in range(seeds)]
    lines = text_of(requirement("RD", setting) <= 0.10, clean, perturbed).splitlines()
    assert lines[-1].startswith("  replay:")
    assert max(map(len, lines[:-1])) <= 100


def test_the_replay_command_survives_a_shell():
    options = RunOptions(simulator="my sim")
    wanted = requirement("RD", LATENCY) <= 0.10
    last = text_of(wanted, CLEAN, PERTURBED, options=options, routes_spec='a "b" $c.xml').splitlines()[-1]
    words = shlex.split(last.removeprefix("  replay:"))
    assert words[words.index("--setting") + 1] == "200 ms latency"
    assert words[words.index("--routes") + 1] == 'a "b" $c.xml'
    assert words[words.index("--sim") + 1] == "my sim"


@pytest.mark.parametrize("simulator", ["bench2drive", "results"])
def test_no_replay_is_offered_where_others_drive(simulator):
    text = text_of(requirement("RD", LATENCY) <= 0.10, CLEAN, PERTURBED, options=RunOptions(simulator=simulator))
    assert "501 HardBreakRoute" in text
    assert "replay" not in text


def test_a_privileged_agent_is_said_to_be_one():
    assert "driver is privileged" in text_of(requirement("RD", LATENCY) <= 0.1, CLEAN, PERTURBED, privileged=True)


@pytest.mark.parametrize("decision", ["fail", "inconclusive"])
def test_routes_without_data_are_told_apart_from_those_behind_the_value(decision):
    driven = [make_result(str(number), speed_ratios_pct=[40.0] if number % 4 else []) for number in range(24)]
    wanted, rule = requirement("efficiency") >= 50, VerdictRule("evidence")
    verdict = evaluate(wanted, agent="driver", clean=[], perturbed=driven, verdict_rule=rule, decision=decision)
    text = failure_text(verdict, RunOptions(), routes_spec="dev10", privileged=False)
    assert ", 24 routes x 1 seed, 6 without data)" in text
    assert ("is shown by 18 routes with data" in text) == (decision == "inconclusive")


def test_one_route_is_no_interval():
    text = text_of(requirement("RD", LATENCY) <= 0.1, CLEAN[:1], PERTURBED[:1])
    assert "(95 % interval unknown, 1 route x 1 seed)" in text


def test_what_a_route_is_blamed_for_stands_beside_its_outcome():
    late = [make_result("7", setting=str(LATENCY), trace=trace_of(40, speed_mps=12.0))]
    metric = Metric.from_function("fastest", lambda results: float(results[0].trace.column("speed_mps").max()))
    lines = text_of(Requirement(metric, LATENCY, "<=", 10.0), [], late).splitlines()
    assert lines[-2] == "    perturbed  100.0  fastest 12.00, completed"
    assert lines[-1].startswith("  replay:  drive-robust replay 7 ")
