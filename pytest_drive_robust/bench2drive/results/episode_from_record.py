"""Turn official records into episodes, so that all code for episodes also works on official results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import prod
from pathlib import Path
from typing import Any

from pytest_drive_robust.bench2drive.results.motion_log import LONGEST_S, TICK_S, find_log, logged_trace
from pytest_drive_robust.bench2drive.results.official_record import (
    LISTS,
    SPEED_LIST,
    STATUSES,
    OfficialRecord,
    outside_lanes_pct,
    place_of,
    ratios_pct,
)
from pytest_drive_robust.bench2drive.results.safe_json import printable
from pytest_drive_robust.bench2drive.results.writing import record_of
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import Infraction, InfractionKind
from pytest_drive_robust.domain.result import EpisodeResult, Trace
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.metrics.score import PENALTIES
from pytest_drive_robust.store.episode_fields import NO_TICKS, result_of
from pytest_drive_robust.store.record_files import read_episode

EPISODE_FILE = "drive_robust.episode"
"""The file beside a route's log in our exports that holds the whole episode with every tick."""
_LANES = InfractionKind.OUTSIDE_LANES.value
_SHARE_TOLERANCE_PCT = 0.0051
"""Tolerance of a share of the route, because the sentences give two digits."""
_SCORE_TOLERANCE = 2e-6
_VERSIONS = {"bench2drive": "results"}
"""The versions of an official record, which tells none; so two sets of official records may be compared."""


def episode_of(record: OfficialRecord, *, agent: str, setting: str, folders: Sequence[Path] = ()) -> EpisodeResult:
    """Return the episode of a record, whose repetition is the seed. `folders` may hold the logs of motion.

    A record of the official evaluator lacks some facts. The ticks of its infractions are 0, which stands for unknown
    (`verdict.explain.infraction_s`). Controls and progress in the trace are 0, and the trace is empty without a log of
    every tick. `junction_passed` is False, which `metrics.ability` takes for unknown. A record of our exports loses
    nothing; `agent` and `setting` must be those of the export. Raises `UsageError` for a record whose score does not
    follow from its infractions, or that was edited.
    """
    if record.own is not None:
        return _own(record, record.own, agent=agent, setting=setting, folders=folders)
    outcome, end = STATUSES[record.status]
    return EpisodeResult(
        episode=Episode(agent, record.route, setting, record.repetition),
        scenario=record.scenario,
        outcome=outcome,
        end=end,
        end_detail=record.status,
        route_completion_pct=record.route_pct,
        route_length_m=record.length_m,
        infractions=_infractions(record),
        speed_ratios_pct=tuple(ratios_pct(record)),
        ticks=round(min(record.game_s, LONGEST_S) / TICK_S),
        dt_s=TICK_S,
        wall_s=record.wall_s,
        trace=logged_trace(record, folders),
        versions=_VERSIONS,
    )


def episode_from_fields(fields: Mapping[str, Any], trace: Trace = NO_TICKS, *, where: str) -> EpisodeResult:
    """Return the episode from the fields of an export or a `--drive-json` file. Raises `UsageError` for bad fields."""
    try:
        return result_of(fields, trace=trace)
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise UsageError(
            f"{where} is damaged: {type(error).__name__}: {printable(str(error), quotes=False)}. Export the run again."
        ) from None


def _infractions(record: OfficialRecord) -> tuple[Infraction, ...]:
    """Return the infractions. Raises `UsageError` for a message in an unknown list, which officially is a failure."""
    unknown = [name for name, messages in record.infractions.items() if messages and name not in LISTS]
    if unknown:
        raise UsageError(f"{record.where} has infractions of a kind that is not known: {unknown[0]!a}.")
    shares = lane_shares_pct(record)
    if shares is None and not record.is_harness_error:
        raise UsageError(
            f"{record.where}: the score {record.score:g} does not follow from the route completion "
            f"{record.route_pct:g} and the infractions. Expected the rules of Bench2Drive 0.0.3 or later; "
            "`drive-robust score` prints the totals of such a file."
        )
    found = []
    for kind in InfractionKind:
        if kind.value == SPEED_LIST:
            continue
        for number, message in enumerate(record.infractions[kind.value]):
            share = shares[number] if shares and kind is InfractionKind.OUTSIDE_LANES else 0.0
            found.append(Infraction(kind, 0, message, *place_of(message), share))
    return tuple(found)


def _own(
    record: OfficialRecord, fields: Mapping[str, Any], *, agent: str, setting: str, folders: Sequence[Path]
) -> EpisodeResult:
    """Return the episode that the export kept. Raises `UsageError` if the official part does not agree with it."""
    where = f"{record.where}: what the export kept"
    told = episode_from_fields(fields, where=where)
    for name, given, wanted in (("agent", told.episode.agent, agent), ("setting", told.episode.setting, setting)):
        if given != wanted:
            hint = f" Give --drive-agent {given}." if name == "agent" else ""
            raise UsageError(f"{record.where} was driven with the {name} {given!a}, but is given for {wanted!a}.{hint}")
    _require_same(record, told)
    stored = _stored(record, folders)
    if stored is not None and stored.episode == told.episode and stored.trace.digest == fields.get("trace_digest"):
        _require_same(record, stored)
        return stored
    return episode_from_fields(fields, logged_trace(record, folders), where=where)


def _require_same(record: OfficialRecord, result: EpisodeResult) -> None:
    """Raise `UsageError` if the official part was edited after the export, because either part may be true."""
    written = record_of(result, index=0, town="", stamp="")
    scores = record.route_pct, record.score
    same = (
        written["route_id"] == record.route_id
        and result.scenario == record.scenario
        and written["status"] == record.status
        and {name: tuple(messages) for name, messages in written["infractions"].items()} == dict(record.infractions)
        and all(
            abs(written["scores"][name] - score) <= 1e-9
            for name, score in zip(("score_route", "score_composed"), scores, strict=True)
        )
    )
    if not same:
        raise UsageError(f"{record.where} was edited after its export: its scores and what it kept disagree.")


def _stored(record: OfficialRecord, folders: Sequence[Path]) -> EpisodeResult | None:
    for folder in folders:
        log = find_log(folder, record.save_name)
        path = None if log is None else log.with_name(EPISODE_FILE)
        if path is not None and path.is_file():
            try:
                return read_episode(path)
            except (OSError, ValueError) as error:
                raise UsageError(f"{str(path)!a} is damaged: {error}. Export the run again, or remove it.") from None
    return None


def lane_shares_pct(record: OfficialRecord) -> tuple[float, ...] | None:
    """Return the share of the route outside its lanes of each sentence, 0..100, the last one exact from the score.

    Return None when the score does not follow from the infractions.
    """
    told = [outside_lanes_pct(message) for message in record.infractions[_LANES]]
    if None in told:
        return None
    shares = [share for share in told if share is not None]
    counts = {kind: len(record.infractions[kind.value]) for kind in PENALTIES}
    rest = record.route_pct * prod(factor ** counts[kind] for kind, factor in PENALTIES.items())
    for share in shares[:-1]:
        rest *= 1.0 - share / 100.0
    if not shares or rest <= 0.0:
        expected = rest * (1.0 - shares[-1] / 100.0) if shares else rest
        return tuple(shares) if abs(record.score - expected) <= _SCORE_TOLERANCE else None
    last = 100.0 * (1.0 - record.score / rest)
    # A small score tells the share only roughly, because the score is rounded to six digits.
    tolerance = _SHARE_TOLERANCE_PCT * max(len(shares), 1) + 100.0 * _SCORE_TOLERANCE / rest
    if abs(last - shares[-1]) > tolerance:
        return None
    return (*shares[:-1], min(max(last, 0.0), 100.0))
