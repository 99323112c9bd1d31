"""`reproduce`: make weights like the shipped ones from nothing: data, training, rounds of DAgger, a choice.

Each step is one of the other commands, printed before it runs. Every command continues after an interruption, and so
does `reproduce`.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from drive_robust_agents.training.prerequisites import TRAINING, require_device, require_packages
from pytest_drive_robust.errors import UsageError

__all__ = ["CURRICULA", "Curriculum", "Dagger", "add_arguments", "commands", "run"]

_TYPES = 44


@dataclass(frozen=True, slots=True)
class Dagger:
    """One DAgger round: the best weights so far share the driving on routes of another seed, then train on all data."""

    route_seed: int
    per_type: int
    visits: int
    lr: float
    beta: float = 0.5


@dataclass(frozen=True, slots=True)
class Curriculum:
    """The recipe of shipped weights: `per_type` routes of each of the 44 scenario types, frames seen, and rounds."""

    per_type: int
    visits: int
    rounds: tuple[Dagger, ...] = ()

    @property
    def routes(self) -> int:
        """Number of routes that the expert drives alone."""
        return _TYPES * self.per_type


CURRICULA: Mapping[str, Curriculum] = MappingProxyType(
    {"tcp": Curriculum(per_type=10, visits=500_000, rounds=(Dagger(2, 5, 200_000, 6e-4),))}
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `reproduce`."""
    parser.add_argument("--agent", required=True, choices=sorted(CURRICULA), help="whose weights")
    parser.add_argument("--out", type=Path, required=True, help="folder of everything; goes on where it stopped")
    parser.add_argument("--share", type=float, default=1.0, help="of the routes and frames, for a first look")
    parser.add_argument("--routes", default="1", help="what candidates are chosen on, as `evaluate` understands it")
    parser.add_argument("--device", default="cpu", help="cpu, cuda or cuda:N")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes that drive (all cores)")


def run(given: argparse.Namespace) -> int:
    """Run all steps in order; return the exit code of the first step that fails, else 0. Raises `UsageError`."""
    from drive_robust_agents.training.__main__ import main

    if not 0.0 < given.share <= 1.0:
        raise UsageError(f"--share is {given.share!r}, expected more than 0 and at most 1.")
    _check(given)
    for command in commands(given):
        print(f"\n$ python -m drive_robust_agents.training {shlex.join(command)}", flush=True)
        code = main(command)
        if code != 0:
            return code
    print(f"\nthe best weights: {_best(given, len(CURRICULA[given.agent].rounds))}")
    return 0


def _check(given: argparse.Namespace) -> None:
    """Raise `UsageError` early for options that a later step would refuse hours later."""
    require_packages(*TRAINING)
    require_device(given.device)
    from drive_robust_agents.training.evaluate import evaluation_routes

    evaluation_routes(given.routes)


def commands(given: argparse.Namespace) -> Iterator[list[str]]:
    """Yield the arguments of each step; later steps read the results of earlier steps."""
    whole, agent, out = CURRICULA[given.agent], ["--agent", given.agent], given.out
    driving = ["--workers", str(given.workers)]
    data = [out / "expert"]
    yield ["collect", *agent, "--out", str(data[0]), *_routes(given, whole.per_type), *driving]
    yield from _learnt(given, 0, data, whole.visits)
    for number, dagger in enumerate(whole.rounds, 1):
        best = _best(given, number - 1)
        data.append(out / f"dagger{number}")
        mixed = ["--route-seed", str(dagger.route_seed), "--dagger", str(best), "--beta", str(dagger.beta)]
        yield ["collect", *agent, "--out", str(data[-1]), *_routes(given, dagger.per_type), *mixed, *driving]
        yield from _learnt(given, number, data, dagger.visits, "--start", str(best), "--lr", str(dagger.lr))


def _learnt(given: argparse.Namespace, number: int, data: list[Path], visits: int, *more: str) -> Iterator[list[str]]:
    """Yield the arguments of a training and of the evaluation of its candidates."""
    agent, run = ["--agent", given.agent], ["--run", str(_run(given, number))]
    seen = ["--frames", *map(str, data), "--visits", str(max(1, round(visits * given.share)))]
    yield ["train", *agent, *seen, *run, "--device", given.device, *more]
    kept = ["--store", str(given.out / "store"), "--workers", str(given.workers)]
    yield ["evaluate", *agent, *run, "--routes", given.routes, *kept]


def _routes(given: argparse.Namespace, per_type: int) -> list[str]:
    count = max(1, round(_TYPES * per_type * given.share))
    return ["--per-type", str(per_type), "--routes", str(count)]


def _run(given: argparse.Namespace, number: int) -> Path:
    folder: Path = given.out / f"run{number}"
    return folder


def _best(given: argparse.Namespace, number: int) -> Path:
    """Return the weights with the best driving score after round `number`."""
    run = _run(given, number)
    found = json.loads((run / "evaluation.json").read_text(encoding="utf-8"))
    file: str = found["candidates"][found["best"]]["file"]
    return run / file
