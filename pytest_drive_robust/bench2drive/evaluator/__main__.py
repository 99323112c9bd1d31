"""`python -m pytest_drive_robust.bench2drive.evaluator run`: official routes under a setting, without pytest."""

from __future__ import annotations

import argparse
import json
import os
import sys
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path
from queue import SimpleQueue

from pytest_drive_robust.bench2drive.evaluator.attempt import Patience
from pytest_drive_robust.bench2drive.evaluator.checkout import Checkout
from pytest_drive_robust.bench2drive.evaluator.drive import DrivenRoute, EvaluatorSetup, RunFolder, drive_route
from pytest_drive_robust.bench2drive.evaluator.executor import AGENT_PREFIX, read_agent
from pytest_drive_robust.bench2drive.results.statuses import STATUSES
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.errors import DriveRobustError, UnknownNameError, UsageError
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.simulators.embedded.route_xml import load_routes
from pytest_drive_robust.store.whole_file import write_whole

__all__ = ["main"]

_USAGE_ERROR = 4
_INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Returns 0 when every route has a score, 1 when harness errors left some without, 4 for misuse, 130 when interrupted.
    """
    options = _parser().parse_args(arguments)
    try:
        return _run(options)
    except DriveRobustError as error:
        print(f"bench2drive: {error}", file=sys.stderr)
        return _USAGE_ERROR


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser("python -m pytest_drive_robust.bench2drive.evaluator", description=__doc__)
    run = parser.add_subparsers(required=True, metavar="COMMAND").add_parser("run", help="drive routes; resumes")
    run.add_argument("--root", required=True, type=Path, metavar="BENCH2DRIVE", help="a checkout of Bench2Drive")
    run.add_argument("--agent", required=True, metavar="FILE.py[+CONFIG]", help="an official agent")
    run.add_argument(
        "--setting", default="clean", help="a sentence (200 ms latency), or env: the released code's variables"
    )
    run.add_argument("--seed", type=int, default=0, help="of the perturbations and the traffic; default: 0")
    run.add_argument("--routes", metavar="FILE.xml[:id,id]", help="default: the 220 of the checkout")
    run.add_argument("--out", type=Path, metavar="FOLDER", help="default: bench2drive-runs/AGENT-SETTING-SEED")
    run.add_argument("--carla-root", type=Path, metavar="FOLDER", help="default: the variable CARLA_ROOT")
    run.add_argument("--python", default="", metavar="FILE", help="the agent's Python; default: this one")
    run.add_argument("--gpu", type=int, action="append", metavar="N", help="repeatable; slots use them in turn")
    run.add_argument("--slots", type=int, default=1, metavar="N", help="evaluators at a time; default: 1")
    run.add_argument("--port", type=int, default=2000, metavar="N", help="of the first server; default: 2000")
    run.add_argument("--tries", type=int, default=3, metavar="N", help="after harness errors; default: 3")
    run.add_argument("--route-s", type=float, default=Patience().route_s, metavar="S", help="longest route, wall time")
    run.add_argument("--silence-s", type=float, default=Patience().silence_s, metavar="S", help="longest silence")
    return parser


def _run(options: argparse.Namespace) -> int:
    checkout = Checkout.find(options.root, carla_root=options.carla_root, python=options.python)
    setting = Setting.from_env(os.environ) if options.setting == "env" else Setting.parse(options.setting)
    agent, config = read_agent(AGENT_PREFIX + options.agent)
    file, routes = _routes(options.routes or str(checkout.routes))
    for name, value in (("--slots", options.slots), ("--tries", options.tries)):
        if value < 1:
            raise UsageError(f"{name} is {value}, expected 1 or more.")
    setup = EvaluatorSetup(
        checkout, agent, config, setting, options.seed, file, port=options.port, tries=options.tries,
        patience=Patience(route_s=options.route_s, silence_s=options.silence_s),
    )  # fmt: skip
    folder = options.out or Path("bench2drive-runs") / _slug(f"{agent.stem}-{setting}-seed{options.seed}")
    run_folder = RunFolder(folder.resolve())
    _claim(run_folder.folder, setup)
    print(f"{len(routes)} routes of {file} under {setting}, seed {options.seed}, into {folder}", flush=True)
    driven, interrupted = _drive_all(setup, routes, run_folder, slots=options.slots, gpus=tuple(options.gpu or (0,)))
    unscored = [item for item in driven if item.record is None]
    print(
        f"{len(driven) - len(unscored)} of {len(routes)} routes have a score: drive-robust score {run_folder.results}"
    )
    if interrupted:
        print("interrupted; the same command goes on from here")
        return _INTERRUPTED
    if unscored:
        print(f"no score, because the harness failed: {', '.join(item.route for item in unscored)}")
    return 1 if unscored else 0


def _drive_all(
    setup: EvaluatorSetup, routes: Sequence[str], run_folder: RunFolder, *, slots: int, gpus: tuple[int, ...]
) -> tuple[list[DrivenRoute], bool]:
    """Return what came of every route, and whether somebody interrupted: then what was under way is gone."""
    stop = threading.Event()
    free: SimpleQueue[int] = SimpleQueue()
    for slot in range(slots):
        free.put(slot)

    def drive(route: str) -> DrivenRoute:
        slot = free.get()
        try:
            own = replace(setup, gpu=gpus[slot % len(gpus)])
            return drive_route(own, route, run_folder, slot=slot, stop=stop)
        finally:
            free.put(slot)

    driven: list[DrivenRoute] = []
    pool = ThreadPoolExecutor(slots)
    try:
        for future in as_completed([pool.submit(drive, route) for route in routes]):
            driven.append(future.result())
            print(_line(driven[-1]), flush=True)
    except KeyboardInterrupt:
        return driven, True
    finally:
        stop.set()
        pool.shutdown(wait=True, cancel_futures=True)
    return driven, False


def _line(driven: DrivenRoute) -> str:
    if driven.record is None:
        return f"{driven.route}: no score: {driven.troubles[-1] if driven.troubles else 'stopped'}"
    record = driven.record
    blame = ", the agent's error" if STATUSES[record.status][0] is Outcome.AGENT_ERROR else ""
    how = ", already there" if driven.resumed else f", try {len(driven.troubles) + 1}" if driven.troubles else ""
    return f"{driven.route}: {record.score:.2f} ({record.status}{blame}{how})"


def _routes(spec: str) -> tuple[Path, list[str]]:
    """Return the file and the ids to drive. Raises `UsageError`."""
    name, colon, wanted = spec.rpartition(":")
    if not colon or Path(spec).is_file():
        name, wanted = spec, ""
    known = [route.id for route in load_routes(Path(name))]
    chosen = [item.strip() for item in wanted.split(",") if item.strip()] or known
    for item in chosen:
        if item not in known:
            raise UnknownNameError.of(f"route in {name}", item, known)
    return Path(name).resolve(), chosen


def _claim(folder: Path, setup: EvaluatorSetup) -> None:
    """Refuse a folder with the results of another drive, else note this one in it. Raises `UsageError`."""
    own = setup.identity
    path = folder / "run.json"
    if path.is_file():
        try:
            before = json.loads(path.read_text(encoding="utf-8"))
        except ValueError:
            raise UsageError(f"{str(path)!r} is damaged. Give another --out.") from None
        differing = [name for name in own if not isinstance(before, dict) or before.get(name) != own[name]]
        if differing:
            raise UsageError(f"{str(folder)!r} holds results of another {' and '.join(differing)}. Give another --out.")
        return
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(path, json.dumps(own, indent=2))


def _slug(text: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-." else "_" for letter in text)


if __name__ == "__main__":
    sys.exit(main())
