"""What an export keeps beside the official schema, as plain JSON: every fact of an episode but its per-tick table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from pytest_drive_robust.bench2drive.results.safe_json import finite, shown
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind, Outcome
from pytest_drive_robust.domain.result import EpisodeResult, Injection, Reception, Touch, Trace
from pytest_drive_robust.errors import UsageError


def fields_of(result: EpisodeResult) -> dict[str, Any]:
    """Return an episode as a `--drive-json` file tells it, with the seconds of inference."""
    return {
        "agent": result.episode.agent,
        "route_id": result.episode.route_id,
        "setting": result.episode.setting,
        "seed": result.episode.seed,
        "scenario": result.scenario,
        "outcome": result.outcome.value,
        "end": result.end.value,
        "end_detail": result.end_detail,
        "route_completion_pct": float(result.route_completion_pct),
        "route_length_m": float(result.route_length_m),
        "infractions": [_plain(asdict(item)) for item in result.infractions],
        "speed_ratios_pct": [float(ratio) for ratio in result.speed_ratios_pct],
        "ticks": int(result.ticks),
        "dt_s": float(result.dt_s),
        "wall_s": float(result.wall_s),
        "privileged": bool(result.privileged),
        "junction_passed": bool(result.junction_passed),
        "schedule": [_plain(asdict(item)) for item in result.schedule],
        "inference_s": [float(seconds) for seconds in result.inference_s],
        "trace_digest": result.trace.digest,
        "versions": dict(result.versions),
        "reception": None if result.reception is None else asdict(result.reception),
    }


def episode_from_fields(fields: Mapping[str, Any], trace: Trace, *, where: str) -> EpisodeResult:
    """Return the inverse, also for the episodes of a `--drive-json` file. Raises `UsageError` for damaged fields."""
    try:
        return EpisodeResult(
            episode=Episode(
                _text(fields["agent"]), _text(fields["route_id"]), _text(fields["setting"]), _whole(fields["seed"])
            ),
            scenario=_text(fields["scenario"]),
            outcome=Outcome(fields["outcome"]),
            end=End(fields["end"]),
            end_detail=_text(fields["end_detail"]),
            route_completion_pct=_number(fields["route_completion_pct"], high=100.0),
            route_length_m=_number(fields["route_length_m"]),
            infractions=tuple(_infraction(item) for item in fields["infractions"]),
            speed_ratios_pct=tuple(_number(ratio) for ratio in fields["speed_ratios_pct"]),
            ticks=_whole(fields["ticks"]),
            dt_s=_number(fields["dt_s"]),
            wall_s=_number(fields["wall_s"]),
            trace=trace,
            schedule=tuple(_injection(item) for item in fields["schedule"]),
            inference_s=tuple(_number(seconds) for seconds in fields.get("inference_s", ())),
            privileged=_truth(fields["privileged"]),
            junction_passed=_truth(fields["junction_passed"]),
            versions={_text(name): _text(version) for name, version in fields["versions"].items()},
            reception=_reception(fields.get("reception")),
        )
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise UsageError(
            f"{where} is damaged: {type(error).__name__}: {shown(str(error), quotes=False)}. Export the run again."
        ) from None


def _infraction(fields: Mapping[str, Any]) -> Infraction:
    return Infraction(
        InfractionKind(fields["kind"]),
        _whole(fields["tick"]),
        _text(fields["detail"]),
        _number(fields["x_m"], low=None),
        _number(fields["y_m"], low=None),
        _number(fields["share_pct"]),
    )


def _injection(fields: Mapping[str, Any]) -> Injection:
    first, last = _whole(fields["first_tick"]), _whole(fields["last_tick"])
    return Injection(_text(fields["perturbation"]), _text(fields["signal"]), first, last)


def _reception(fields: Mapping[str, Any] | None) -> Reception | None:
    if fields is None:
        return None
    touched = tuple(
        Touch(_text(item["signal"]), _whole(item["ticks"]), _whole(item["first_tick"])) for item in fields["touched"]
    )
    cameras, consumes = (tuple(_text(name) for name in fields[group]) for group in ("cameras", "consumes"))
    return Reception(cameras, consumes, _whole(fields["observations"]), touched)


def _plain(fields: dict[str, Any]) -> dict[str, Any]:
    """Return enumerations by value, numpy scalars as Python numbers: simulators compute with numpy."""
    return {
        name: value.value if isinstance(value, InfractionKind) else value.item() if hasattr(value, "item") else value
        for name, value in fields.items()
    }


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError(f"expected text, got {type(value).__name__}")
    return value


def _truth(value: object) -> bool:
    if not isinstance(value, bool):
        raise TypeError(f"expected true or false, got {type(value).__name__}")
    return value


def _whole(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 1 << 53:
        raise ValueError("expected a whole number of 0 or more")
    return value


def _number(value: object, *, low: float | None = 0.0, high: float | None = None) -> float:
    number = finite(value)
    if number is None or (low is not None and number < low) or (high is not None and number > high):
        raise ValueError("expected a finite number in range")
    return number
