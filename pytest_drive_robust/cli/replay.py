"""`drive-robust replay`: drives one route again, clean and perturbed, and films both side by side."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from pytest_drive_robust.cli.pytest_options import add_pytest_option
from pytest_drive_robust.cli.replay_check import Before, before_of, read_episode_file
from pytest_drive_robust.domain.agent import Agent
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.metrics.score import driving_score
from pytest_drive_robust.options.option import GivenText
from pytest_drive_robust.options.parsers import check_seeds, seconds
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.registry.registry import Registry, default_registry
from pytest_drive_robust.report.film.file_name import film_name
from pytest_drive_robust.report.video import EXTRA, has_encoder, write_png, write_video
from pytest_drive_robust.runner.before_driving import check_route, routes_of
from pytest_drive_robust.runner.driver import make_agent
from pytest_drive_robust.runner.episode.stored_controls import StoredControls
from pytest_drive_robust.runner.episode.threads import OneThread
from pytest_drive_robust.runner.replay.recording import Tape, record_episode
from pytest_drive_robust.runner.scopes import check_severities
from pytest_drive_robust.simulators.base import Simulator, SimulatorOptions
from pytest_drive_robust.simulators.embedded.route_sets import ALL_ROUTES
from pytest_drive_robust.simulators.routes import own_routes
from pytest_drive_robust.verdict.explain import first_divergence
from pytest_drive_robust.verdict.infraction_words import infraction_words

_SUFFIXES = (".mp4", ".png")
_DESCRIPTION = """Drives ROUTE clean and under a setting, and writes one video with both side by side: what the agent
was given, the view from above with its plan, speed and controls, infractions, the first divergence. Without an encoder
(pip install 'pytest-drive-robust[video]') it writes a PNG of the telling moments instead."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `replay`."""
    parser.description = _DESCRIPTION
    parser.add_argument("route", metavar="ROUTE", help="the id of a route, or the .episode file of a stored episode")
    parser.add_argument("--agent", metavar="NAME", help="a name from `drive-robust list agents`, or module:Class")
    parser.add_argument(
        "--setting", metavar="SENTENCE", help='drive under this, as in "200 ms latency"; default: clean'
    )
    parser.add_argument("--seed", type=int, help="seed of the episode; default: 0")
    add_pytest_option(parser, "--sim")
    parser.add_argument(
        "--routes",
        metavar="SET",
        help="look for ROUTE here: a set (full, one-per-scenario, dev10) or a file; default: all routes of --sim",
    )
    add_pytest_option(parser, "--stuck-stop", help="give the --drive-stuck-stop of the run that is replayed")
    parser.add_argument("--tick-cap", type=int, metavar="N", help="end both episodes after N ticks")
    parser.add_argument(
        "--run",
        metavar="RUN",
        help="compare with the episodes of a stored run or of a folder; exit code 1 when they differ",
    )
    parser.add_argument(
        "--stored-controls",
        action="store_true",
        help="ask no agent: drive the controls of the .episode file again, the same bits on any machine",
    )
    parser.add_argument(
        "--out",
        metavar="FILE",
        help="write this .mp4, or a .png strip; default: a .mp4 with agent, route, setting and seed in its name",
    )
    parser.add_argument("--no-video", action="store_true", help="write no film, only print what happened")
    parser.set_defaults(command=_replay)


@dataclass(frozen=True, slots=True)
class _Wanted:
    """The episode to drive, from the command line and a stored episode (`stored`, if one was given)."""

    agent: str
    route: str
    setting: Setting
    seed: int
    stored: EpisodeResult | None

    @property
    def episodes(self) -> dict[Episode, Setting]:
        """The episodes to drive, each with its setting: the baseline and the setting, once if they are the same."""
        settings = dict.fromkeys((self.setting.baseline, self.setting))
        return {Episode(self.agent, self.route, str(setting), self.seed): setting for setting in settings}


def _replay(options: argparse.Namespace) -> int:
    registry = default_registry()
    wanted = _wanted(options, registry)
    stuck_stop_s = seconds(GivenText("--stuck-stop", options.stuck_stop))
    if options.tick_cap is not None and options.tick_cap < 1:
        raise UsageError(f"--tick-cap is {options.tick_cap}, expected at least 1.")
    earlier = wanted.stored if wanted.stored is not None and wanted.stored.episode in wanted.episodes else None
    before = before_of(
        options.run, earlier, simulator=options.sim, stuck_stop_s=stuck_stop_s, tick_cap=options.tick_cap
    )
    if before is not None:
        before.check_holds_any(wanted.episodes)
    target = None if options.no_video else _target(options, wanted)
    if not options.stored_controls:
        registry.require("agents", wanted.agent)
    caps = {} if options.tick_cap is None else {"tick_cap": options.tick_cap}
    simulator = registry.simulator(options.sim, SimulatorOptions(stuck_stop_s=stuck_stop_s, **caps))
    try:
        route = _route(options, wanted.route, simulator)
        check_severities(wanted.setting, simulator.dt_s)
        again = options.stored_controls and wanted.stored is not None
        tapes = [_drive_again(simulator, wanted, route)] if again else _drive(registry, simulator, wanted, route)
        measured = wanted.setting.measures_inference and not options.stored_controls
        if len(tapes) == 2:
            _print_divergence(*(tape.result for tape in tapes))
        same = before is None or _is_as_before(tapes, route, before, measured=measured)
        if target is not None:
            _film(tapes, target)
    finally:
        simulator.close()
    return 0 if same else 1


def _wanted(options: argparse.Namespace, registry: Registry) -> _Wanted:
    """Return the episode to drive: options of the command line win over a stored episode. Raises `UsageError`."""
    stored = read_episode_file(options.route) if options.route.endswith(".episode") else None
    if options.stored_controls:
        if stored is None:
            raise UsageError("--stored-controls needs a stored episode. Give its .episode file as ROUTE.")
        given = [f"--{name}" for name in ("agent", "setting", "seed") if getattr(options, name) is not None]
        if given:
            raise UsageError(
                f"--stored-controls and {given[0]} cannot be combined: the episode was driven as {stored.episode}. "
                "Leave one of them out."
            )
    agent = options.agent or (stored.episode.agent if stored else None)
    if agent is None:
        raise UsageError("--agent is missing. Give a name from `drive-robust list agents`, or module:Class.")
    sentence = options.setting if options.setting is not None else stored.episode.setting if stored else "clean"
    seed = options.seed if options.seed is not None else stored.episode.seed if stored else 0
    check_seeds([seed], source="--seed")
    return _Wanted(
        agent=agent,
        route=stored.episode.route_id if stored else options.route,
        setting=Setting.parse(sentence, registry.perturbations()),
        seed=seed,
        stored=stored,
    )


def _target(options: argparse.Namespace, wanted: _Wanted) -> Path:
    """Return the file to write, checked before anything is driven. Without an encoder a strip replaces the video."""
    episode = Episode(wanted.agent, wanted.route, str(wanted.setting), wanted.seed)
    target = Path(options.out or film_name(episode))
    if target.suffix.lower() not in _SUFFIXES:
        raise UsageError(f"--out is {options.out!r}, expected the name of a .mp4 or .png file.")
    if not target.parent.is_dir():
        raise UsageError(f"--out is {options.out!r}, but there is no folder {str(target.parent)!r}.")
    if target.is_dir():
        raise UsageError(f"--out is {options.out!r}, which is a folder.")
    if target.suffix.lower() == ".mp4" and not has_encoder():
        strip = target.with_suffix(".png")
        print(f"drive-robust: no H.264 encoder is installed, so the telling moments go to {strip}.", file=sys.stderr)
        print(f"drive-robust: to get a video, pip install '{EXTRA}'", file=sys.stderr)
        return strip
    return target


def _route(options: argparse.Namespace, name: str, simulator: Simulator) -> Route:
    spec = options.routes or (ALL_ROUTES if own_routes(simulator) is None else name)
    routes = {route.id: route for route in routes_of(spec, simulator)}
    if name not in routes:
        listed_by = "" if own_routes(simulator) is not None else f"drive-robust routes list {spec}"
        raise UnknownNameError.of("route", name, routes, hint="Name its file with --routes.", listed_by=listed_by)
    check_route(simulator, routes[name])
    return routes[name]


def _drive(registry: Registry, simulator: Simulator, wanted: _Wanted, route: Route) -> list[Tape]:
    """Drive the baseline and the setting with the same simulator and agent; a baseline setting is driven once."""
    with OneThread() as one_thread:  # as in a run: sums over several threads differ in the last bits
        agent = make_agent(registry, wanted.agent)
        one_thread.limit()  # also the libraries that the agent loaded
        return [
            _tape(f"under {setting}", simulator, agent, setting, route, episode)
            for episode, setting in wanted.episodes.items()
        ]


def _drive_again(simulator: Simulator, wanted: _Wanted, route: Route) -> Tape:
    """Drive the controls that the vehicle got in the stored episode, clean: the setting has changed them already."""
    stored = wanted.stored
    assert stored is not None
    agent = StoredControls.of(stored)
    return _tape("the stored controls", simulator, agent, Setting.CLEAN, route, stored.episode)


def _tape(what: str, simulator: Simulator, agent: Agent, setting: Setting, route: Route, episode: Episode) -> Tape:
    """Drive under `setting`, print the result under the name of `episode`, and return the recording."""
    with _progress(f"driving {what}") as step:
        tape = record_episode(
            simulator,
            agent,
            route=route,
            setting=setting,
            seed=episode.seed,
            agent_name=episode.agent,
            ticked=lambda _: step(),
        )
    _print_result(replace(tape.result, episode=episode))
    if tape.plan_problem:
        print(f"  no plan is shown: {tape.plan_problem}")
    return replace(tape, result=replace(tape.result, episode=episode))


def _print_divergence(clean: EpisodeResult, perturbed: EpisodeResult) -> None:
    parted = first_divergence(clean, perturbed)
    if parted is not None:
        print(f"first divergence at {parted.second:.2f} s {parted.signal}")
    elif clean.trace.digest == perturbed.trace.digest:
        print("both drove the same")
    else:
        shared_s = min(clean.game_s, perturbed.game_s)
        until = "" if clean.ticks == perturbed.ticks else f" in the {shared_s:.2f} s that both drove"
        print(f"no divergence{until}: never 0.5 m or 1 m/s apart")


def _is_as_before(tapes: list[Tape], route: Route, before: Before, *, measured: bool) -> bool:
    """Print for each tape whether it equals the earlier episode; return False if the user asked and a tape differs.

    `measured`: the setting's latency is measured, so its tape may differ. Raises `UsageError` if the user asked and no
    earlier episode was found.
    """
    all_same = True
    compared_any = False
    for tape in tapes:
        compared = before.compared_with(tape.result, route=route)
        if compared is not None:
            compared_any = True
            same, clause = compared
            print(f"{tape.result.episode.setting}: {clause}")
            if not same and measured and tape is tapes[-1]:
                print("a measured latency is never the same twice")
                same = True
            all_same = all_same and same
        elif before.asked and before.episode is None:
            print(f"{tape.result.episode.setting}: not in {before.label}")
    if before.asked and not compared_any:
        raise UsageError(f"{before.label} holds nothing of what was driven, so nothing was compared: {before.holds}.")
    return all_same or not before.asked


def _film(tapes: list[Tape], target: Path) -> None:
    from pytest_drive_robust.report.film.film import Film

    film = Film(*tapes)
    if target.suffix.lower() == ".png":
        sheet = film.sheet()
        write_png(target, sheet)
        print(f"{target}: {sheet.shape[1]} x {sheet.shape[0]} pixels")
        return
    count = len(film.positions)
    with _progress("filming", total=count) as step:
        write_video(target, film.pictures(), rate_hz=film.rate_hz, wrote=step)
    print(f"{target}: {count / film.rate_hz:.0f} s, {target.stat().st_size / 1e6:.1f} MB")


@contextmanager
def _progress(what: str, *, total: int | None = None) -> Iterator[Callable[[], None]]:
    """Show a progress bar on a terminal, nothing elsewhere; give the function to call for each tick or picture.

    A debugger ends the bar, which would be drawn over the prompt.
    """
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    debugger = sys.breakpointhook
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:

        def debug(*args: object, **options: object) -> object:
            progress.stop()
            return debugger(*args, **options)

        bar = progress.add_task(what, total=total)
        sys.breakpointhook = debug
        try:
            yield lambda: progress.advance(bar)
        finally:
            sys.breakpointhook = debugger


def _print_result(result: EpisodeResult) -> None:
    """Print one paragraph: outcome, score, end, and every infraction with its second."""
    scored = result.outcome is not Outcome.INFRA_ERROR
    way = f"{result.route_completion_pct:.1f} % of {result.route_length_m:.0f} m"
    print(f"{result.episode} ({result.scenario})")
    print(f"  {result.outcome.value}: {f'DS {driving_score(result):.1f}, {way}' if scored else 'not scored'}")
    print(f"  ended after {result.game_s:.2f} s ({result.wall_s:.2f} s on the clock): {result.end_detail}")
    for infraction in result.infractions:
        print(
            f"  {infraction.tick * result.dt_s:7.2f} s  {infraction.kind.value}: {infraction_words(infraction.detail)}"
        )
    print(f"  trajectory {result.trace.digest}")
