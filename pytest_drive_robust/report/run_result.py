"""The result of one run as one frozen object, of which every report is a pure function."""

from __future__ import annotations

import platform
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from pytest_drive_robust.arithmetic.signals import mean
from pytest_drive_robust.domain.result import MACHINE_FACTS, EpisodeResult, merged_versions
from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.metrics.degradation import paired_driving_scores
from pytest_drive_robust.metrics.episodes import values_by_route
from pytest_drive_robust.metrics.score import driving_score
from pytest_drive_robust.metrics.summary import Summary, summarize
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.report.numbers import counted
from pytest_drive_robust.stats.intervals import evidence_interval, mean_evidence_interval
from pytest_drive_robust.stats.multiple_verdicts import late_fails
from pytest_drive_robust.store.base import Find
from pytest_drive_robust.store.events import (
    EpisodesNeeded,
    Event,
    Finished,
    Identified,
    Judged,
    NamesRegistered,
    Planned,
    Searched,
    Spared,
    StoreTroubled,
    Used,
)

Interval = tuple[float, float]
_Scope = tuple[str, str, str, tuple[int, ...]]
_LOST = (
    "the store lost {} that verdicts rest on while the run was under way, as by `drive-robust store gc` or "
    "`git clean`: the verdicts stand, but their rows are incomplete. Run again"
)


@dataclass(frozen=True, slots=True)
class SettingRow:
    """One agent under one setting.

    `summary` is None when there is nothing to summarise, and `problem` says why; `rd` is None for clean rows and when
    the clean twins were not driven, do not compare or score below the floor of the verdict rule. `verdict` is the worst
    of the requirements on this row: `"error"`, `"fail"`, `"inconclusive"`, `"pass"`, or `"-"` when none was judged.
    `needed` counts the episodes of the row, except spared ones. If a verdict did not wait for all `planned` routes,
    `ds_interval` and `rd_interval` are the intervals of DS and RD on routes like these (alpha of the verdict rule a
    side). `judged` holds the value of every metric that a requirement on this row names.
    """

    agent: str
    routes_spec: str
    setting: str
    seeds: tuple[int, ...]
    needed: int
    results: tuple[EpisodeResult, ...]
    summary: Summary | None
    rd: float | None
    verdict: str
    problem: str = ""
    planned: int = 0
    ds_interval: Interval | None = None
    rd_interval: Interval | None = None
    judged: Mapping[str, float | None] = field(default_factory=dict)

    @property
    def is_partial(self) -> bool:
        """True when verdicts were reached before all routes were driven."""
        return self.ds_interval is not None

    @property
    def routes(self) -> int:
        """The number of routes that were driven at least once."""
        return len({result.episode.route_id for result in self.results})

    @property
    def privileged(self) -> bool:
        """True when the agent saw ground truth."""
        return any(result.privileged for result in self.results)


@dataclass(frozen=True, slots=True)
class RunResult:
    """One run. `episodes` holds by key the episodes that its verdicts rest on, in the order in which tests need them.

    An episode that was driven ahead, but that its verdict did not need, is left out, so that the result does not depend
    on the speed of the workers. `driven` is how many of `episodes` this run drove itself; the others were in the store.
    `late` are the verdicts of `judged` that were inconclusive in their test and became fails when all p-values were
    known, without those that are waived or of a test that was expected to fail. `ended_early` is True when tests were
    left at the end of the run, or broke before their verdict; the result lacks the requirements of those tests. It is
    True as well when the store no longer holds an episode that a verdict rests on; a note says so.
    `stopped_tests` are the tests that their own verdict stopped with statements left: what those may have asked is
    lacking, too. `own_verdicts` are the tests that failed by an assert of their own, of which no requirement tells.
    """

    options: RunOptions
    rows: tuple[SettingRow, ...]
    judged: tuple[Judged, ...]
    episodes: Mapping[str, EpisodeResult]
    versions: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    identified: tuple[Identified, ...] = ()
    searched: tuple[Searched, ...] = ()
    late: tuple[Judged, ...] = ()
    driven: int = 0
    ended_early: bool = False
    stopped_tests: tuple[str, ...] = ()
    own_verdicts: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        options: RunOptions,
        events: Sequence[Event],
        find: Find,
        *,
        versions: Mapping[str, str],
        notes: tuple[str, ...] = (),
    ) -> RunResult:
        """Return the result of a run from its events; `find` returns the finished episode of a key, or None."""
        needed = _merged(event for event in events if isinstance(event, EpisodesNeeded))
        scopes = _scopes(event for event in events if isinstance(event, EpisodesNeeded))
        order = {key: place for place, key in enumerate(_needed_keys(events))}
        needed.sort(key=lambda item: (item.agent, order[item.keys[0]]))
        spared = {key for event in events if isinstance(event, Spared) for key in event.keys}
        used = {key for event in events if isinstance(event, Used) for key in event.keys}
        episodes = {key: result for key in order if key in used and (result := find(key)) is not None}
        lost = len(used & order.keys()) - len(episodes)
        judged = list(dict.fromkeys(event for event in events if isinstance(event, Judged)))
        judged, late = _corrected(judged, options)
        plugins = (word for event in events if isinstance(event, NamesRegistered) for word in event.plugins)
        return cls(
            options=replace(options, plugins=tuple(dict.fromkeys((*options.plugins, *plugins)))),
            rows=tuple(
                _row(
                    item,
                    episodes,
                    [one for one in judged if _scope_of(one) in scopes[item.keys]],
                    spared,
                    options=options,
                )
                for item in needed
            ),
            judged=tuple(judged),
            episodes=episodes,
            versions={"python": platform.python_version(), **versions, **_versions_told(episodes.values())},
            notes=(*notes, *dict.fromkeys(event.sentence for event in events if isinstance(event, StoreTroubled)))
            + ((_LOST.format(counted(lost, "episode")),) if lost else ()),
            identified=tuple(dict.fromkeys(event for event in events if isinstance(event, Identified))),
            searched=tuple(dict.fromkeys(event for event in events if isinstance(event, Searched))),
            late=late,
            driven=len(episodes.keys() & {event.key for event in events if isinstance(event, Finished)}),
            ended_early=lost > 0,
        )


def row_labels(rows: Sequence[tuple[str, str, Sequence[int]]]) -> list[str]:
    """Return the label of each row (setting, routes, seeds): the setting, with routes and seeds if rows differ in them.

    >>> row_labels([("clean", "suites/night.xml", [0]), ("clean", "dev10", [0])])
    ['clean on night.xml', 'clean on dev10']
    >>> row_labels([("clean", "day/routes.xml", [0]), ("clean", "night/routes.xml", [0])])
    ['clean on day/routes.xml', 'clean on night/routes.xml']
    """
    short = _short({spec for _, spec, _ in rows})
    several_seeds = len({tuple(seeds) for _, _, seeds in rows}) > 1
    return [
        setting
        + (f" on {short[spec]}" if len(short) > 1 else "")
        + (f", seed{'s' if len(seeds) > 1 else ''} {', '.join(map(str, seeds))}" if several_seeds else "")
        for setting, spec, seeds in rows
    ]


def _short(routes_specs: Collection[str]) -> dict[str, str]:
    """Return each specification as a file name, with as many of its folders as tell it from the others."""
    parts = {spec: spec.replace("\\", "/").split("/") for spec in routes_specs}
    short = {}
    for spec, own in parts.items():
        counts = range(1, len(own))
        enough = (count for count in counts if sum(other[-count:] == own[-count:] for other in parts.values()) == 1)
        short[spec] = "/".join(own[-next(enough, len(own)) :])
    return short


def _corrected(judged: list[Judged], options: RunOptions) -> tuple[list[Judged], tuple[Judged, ...]]:
    """Return all verdicts after Holm's correction, and the verdicts that the correction turned into fails.

    See `stats.multiple_verdicts`.
    """
    known = [(place, item.p_value) for place, item in enumerate(judged) if item.p_value is not None]
    if options.correction == "none" or not known:
        return judged, ()
    verdicts, p_values = [judged[place].verdict for place, _ in known], [p_value for _, p_value in known]
    family = max(item.family for item in judged)
    late = {}
    for found in late_fails(verdicts, p_values, family=family, alpha=options.verdict_rule.alpha):
        place, p_value = known[found]
        message = f"open in its test, a fail when all p-values were known (Holm, p = {p_value:.2g})"
        late[place] = replace(judged[place], verdict="fail", message=message)
    return [late.get(place, item) for place, item in enumerate(judged)], tuple(late.values())


def _merged(needed: Iterable[EpisodesNeeded]) -> list[EpisodesNeeded]:
    """Return each set of episodes once, even if several tests need it, with clean twins if any test compared."""
    found: dict[tuple[str, ...], EpisodesNeeded] = {}
    for item in needed:
        if item.keys not in found or item.clean_keys:
            found[item.keys] = item
    return list(found.values())


def _scopes(needed: Iterable[EpisodesNeeded]) -> dict[tuple[str, ...], set[_Scope]]:
    """Return the scopes of each set of episodes, by its keys: two specifications may name equal routes."""
    found: dict[tuple[str, ...], set[_Scope]] = {}
    for item in needed:
        found.setdefault(item.keys, set()).add(_scope_of(item))
    return found


def _needed_keys(events: Sequence[Event]) -> list[str]:
    """Return the keys in the order of the plan, then of the tests, which is equal for any number of workers."""
    planned = (key for event in events if isinstance(event, Planned) for key in event.keys)
    needed = (key for event in events if isinstance(event, EpisodesNeeded) for key in (*event.clean_keys, *event.keys))
    return list(dict.fromkeys((*planned, *needed)))


def _row(
    needed: EpisodesNeeded,
    episodes: Mapping[str, EpisodeResult],
    judged: Sequence[Judged],
    spared: set[str],
    *,
    options: RunOptions,
) -> SettingRow:
    results = tuple(episodes[key] for key in needed.keys if key in episodes)
    summary, problem = None, ""
    try:
        summary = summarize(results, mode=options.metrics)
    except ComparisonError as error:
        problem = str(error)
    partial = summary is not None and any(key in spared and key not in episodes for key in needed.keys)
    rule = options.verdict_rule
    pairs = _scores_in_pairs(needed, episodes, spared, clean_floor=rule.clean_floor)
    return SettingRow(
        agent=needed.agent,
        routes_spec=needed.routes_spec,
        setting=needed.setting,
        seeds=needed.seeds,
        needed=sum(key in episodes or key not in spared for key in needed.keys),
        results=results,
        summary=summary,
        rd=None if pairs is None else 1.0 - mean(pairs[1]) / mean(pairs[0]),
        verdict=_worst(item.verdict for item in judged),
        judged={item.metric: item.value for item in judged},
        problem=problem,
        planned=len(needed.keys) // max(1, len(needed.seeds)),
        ds_interval=_ds_interval(results, rule.alpha) if partial else None,
        rd_interval=evidence_interval(*pairs, rule.alpha) if partial and pairs is not None else None,
    )


def _ds_interval(results: Sequence[EpisodeResult], alpha: float) -> Interval:
    scores = list(values_by_route(results, driving_score).values())
    return mean_evidence_interval(scores, alpha, low=0.0, high=100.0)


def _scores_in_pairs(
    needed: EpisodesNeeded, episodes: Mapping[str, EpisodeResult], spared: set[str], *, clean_floor: float
) -> tuple[list[float], list[float]] | None:
    """Return the clean and the perturbed scores of the routes that were driven clean and perturbed.

    Returns None when an episode is missing that was not spared, and when the clean score is below the floor.
    """
    if any(key not in episodes and key not in spared for key in (*needed.clean_keys, *needed.keys)):
        return None
    pairs = [
        (episodes[clean], episodes[perturbed])
        for clean, perturbed in zip(needed.clean_keys, needed.keys, strict=False)
        if clean in episodes and perturbed in episodes
    ]
    if not pairs:
        return None
    try:
        clean, perturbed = paired_driving_scores([pair[0] for pair in pairs], [pair[1] for pair in pairs])
    except ComparisonError:
        return None
    return None if mean(clean) < clean_floor else (clean, perturbed)


def _scope_of(event: Judged | EpisodesNeeded) -> _Scope:
    return event.agent, event.routes_spec, event.setting, event.seeds


def _worst(verdicts: Iterable[str]) -> str:
    found = set(verdicts)
    return next((verdict for verdict in ("error", "fail", "inconclusive", "pass") if verdict in found), "-")


def _versions_told(results: Iterable[EpisodeResult]) -> dict[str, str]:
    """Return the merged versions that episodes recorded, without Python and machine facts, which each episode tells."""
    merged = merged_versions(result.versions for result in results)
    return {name: version for name, version in merged.items() if name not in MACHINE_FACTS and name != "python"}
