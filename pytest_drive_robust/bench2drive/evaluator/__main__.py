"""`python -m pytest_drive_robust.bench2drive.evaluator run`: official routes under a setting, without pytest."""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import as_completed
from pathlib import Path

from pytest_drive_robust.bench2drive.evaluator.attempt import Patience
from pytest_drive_robust.bench2drive.evaluator.checkout import Checkout
from pytest_drive_robust.bench2drive.evaluator.executor import AGENT_PREFIX, Bench2DriveExecutor
from pytest_drive_robust.bench2drive.evaluator.ports import DEFAULT_PORT
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import DriveRobustError, UnknownNameError, UsageError
from pytest_drive_robust.metrics.score import driving_score
from pytest_drive_robust.options.parsers import check_seeds
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.runner.plan import EpisodeRequest

_USAGE_ERROR = 4
_INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Returns 0 when every route has a score, 1 when a harness error left a route without a score or every route ended as
    an error of the agent, 4 for misuse, 130 when interrupted.
    """
    options = _parser().parse_args(arguments)
    try:
        return _run(options)
    except DriveRobustError as error:
        print(f"bench2drive: {error}", file=sys.stderr)
        return _USAGE_ERROR
    except OSError as error:  # about a file that the user named; not 1, which says that routes lack a score
        print(f"bench2drive: {error.filename or 'a file'}: {error.strerror or error}.", file=sys.stderr)
        return _USAGE_ERROR


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser("python -m pytest_drive_robust.bench2drive.evaluator", description=__doc__)
    run = parser.add_subparsers(required=True, metavar="COMMAND").add_parser("run", help="drive routes; again: go on")
    run.add_argument("--root", required=True, type=Path, metavar="BENCH2DRIVE", help="a checkout of Bench2Drive")
    run.add_argument("--agent", required=True, metavar="FILE.py[+CONFIG]", help="an official agent")
    run.add_argument(
        "--setting",
        default="clean",
        help="drive under this: a sentence (200 ms latency), or env: the environment variables of the released code",
    )
    run.add_argument("--seed", type=int, default=0, help="seed of the perturbations and the traffic; default: 0")
    run.add_argument("--routes", metavar="FILE.xml[:id,id]", help="drive these; default: the 220 of the checkout")
    run.add_argument(
        "--out", type=Path, default=Path("bench2drive-runs"), metavar="FOLDER",
        help="write results here; default: bench2drive-runs",
    )  # fmt: skip
    run.add_argument(
        "--carla-root", type=Path, metavar="FOLDER", help="the folder of CARLA; default: the variable CARLA_ROOT"
    )
    run.add_argument(
        "--python", default="", metavar="FILE", help="the Python of the agent's environment; default: this one"
    )
    run.add_argument(
        "--gpu", type=int, action="append", metavar="N",
        help="use this GPU; repeatable, slots use them in turn; default: those of CUDA_VISIBLE_DEVICES, else 0",
    )  # fmt: skip
    run.add_argument("--slots", type=int, default=1, metavar="N", help="evaluators at a time; default: 1")
    run.add_argument(
        "--port", type=int, default=DEFAULT_PORT, metavar="N", help="first port of the servers; default: 2000"
    )
    run.add_argument(
        "--tries",
        type=int,
        default=3,
        metavar="N",
        help="drive a route N times at most after harness errors; default: 3",
    )
    usual = Patience()
    run.add_argument(
        "--route-s", type=float, default=usual.route_s, metavar="S",
        help=f"longest wall time of a route; default: {usual.route_s:g}",
    )  # fmt: skip
    run.add_argument(
        "--silence-s", type=float, default=usual.silence_s, metavar="S",
        help=f"longest time in which the evaluator prints nothing; default: {usual.silence_s:g}",
    )  # fmt: skip
    return parser


def _run(options: argparse.Namespace) -> int:
    checkout = Checkout.find(options.root, carla_root=options.carla_root, python=options.python)
    checkout.require_python("--python")
    setting = Setting.from_env(os.environ) if options.setting == "env" else Setting.parse(options.setting)
    file, chosen = _file_and_ids(str(checkout.routes) if options.routes is None else options.routes)
    _check_numbers(options)
    executor = Bench2DriveExecutor(
        checkout, folder=options.out, routes=file, slots=options.slots, gpus=tuple(options.gpu or ()),
        port=options.port, tries=options.tries,
        patience=Patience(route_s=options.route_s, silence_s=options.silence_s),
    )  # fmt: skip
    known = {route.id: route for route in executor.routes}
    for route_id in chosen:
        if route_id not in known:
            listed_by = f"drive-robust routes list {file}"
            raise UnknownNameError.of(f"route in {file}", route_id, known, listed_by=listed_by)
    requests = [
        EpisodeRequest(Episode(AGENT_PREFIX + options.agent, name, str(setting), options.seed), known[name], setting)
        for name in dict.fromkeys(chosen or known)
    ]
    executor.check(requests)
    print(f"{len(requests)} routes of {file} under {setting}, seed {options.seed}", flush=True)
    outcomes: dict[str, Outcome] = {}
    try:
        for future in as_completed([executor.submit(request) for request in requests]):
            result = future.result()
            print(_line(result), flush=True)
            outcomes[result.episode.route_id] = result.outcome
    except KeyboardInterrupt:
        print("interrupted; the same command goes on from here")
        return _INTERRUPTED
    finally:
        executor.close()
    results = executor.run_folder(requests[0]).results
    names = "" if chosen else f" --routes {shlex.quote(str(file))}"  # the results tell which ids were chosen
    return _concluded(outcomes, results, f"drive-robust score {shlex.quote(str(results))}{names}")


def _concluded(outcomes: Mapping[str, Outcome], results: Path, score_command: str) -> int:
    """Print how many routes have a score, and advice for unscored and broken routes; return the exit code."""
    unscored = [name for name, outcome in outcomes.items() if outcome is Outcome.INFRA_ERROR]
    broken = [name for name, outcome in outcomes.items() if outcome is Outcome.AGENT_ERROR]
    scored = len(outcomes) - len(unscored)
    print(f"{scored} of {len(outcomes)} routes have a score: {score_command}")
    if broken:
        print(f"{len(broken)} of them ended as an error of the agent: {', '.join(broken)}")
    if broken and len(broken) == scored:
        print(
            f"no route was driven to its end; if the cause is not in the agent's files, remove {results} to try again"
        )
    if unscored:
        print(f"no score, because the harness failed: {', '.join(unscored)}")
    return 1 if unscored or len(broken) == len(outcomes) else 0


def _check_numbers(options: argparse.Namespace) -> None:
    """Raise `UsageError` for an option whose number is out of range."""
    check_seeds([options.seed], source="--seed")
    for name, value in (("--slots", options.slots), ("--tries", options.tries)):
        if value < 1:
            raise UsageError(f"{name} is {value}, expected 1 or more.")
    for gpu in options.gpu or ():
        if gpu < 0:
            raise UsageError(f"--gpu is {gpu}, expected 0 or more.")
    for name, value in (("--route-s", options.route_s), ("--silence-s", options.silence_s)):
        if not value > 0.0:  # nan too
            raise UsageError(f"{name} is {value:g}, expected seconds > 0; inf for no limit.")


def _line(result: EpisodeResult) -> str:
    if result.outcome is Outcome.INFRA_ERROR:
        return f"{result.episode.route_id}: no score: {result.end_detail}"
    return f"{result.episode.route_id}: {driving_score(result):.2f} ({result.outcome.value}: {result.end_detail})"


def _file_and_ids(spec: str) -> tuple[Path, list[str]]:
    """Return the absolute route file and the ids after its colon; without a colon no ids, which stand for all routes.

    Raises `UsageError` where the file or the ids are empty, for example from an unset variable.
    """
    if not spec.strip():
        raise UsageError("--routes is empty, expected FILE.xml or FILE.xml:id,id. Leave it out to drive all 220.")
    name, colon, wanted = spec.rpartition(":")
    if not colon or Path(spec).is_file():
        return Path(spec).resolve(), []
    ids = [item.strip() for item in wanted.split(",") if item.strip()]
    if not ids:
        raise UsageError(f"no route ids after {name!r}: give some, or leave the colon out to drive all of the file.")
    return Path(name).resolve(), ids


if __name__ == "__main__":
    sys.exit(main())
