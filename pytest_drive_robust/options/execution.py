"""How the episodes of a run are driven: in which processes, how many at a time, within which limits."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.option import GivenText, OptionSource, asked_for, option, read_fields
from pytest_drive_robust.options.parsers import folder_path, gigabytes, one_of, program, time_limit_s
from pytest_drive_robust.options.run import BENCH2DRIVE

_GUARDS = ("--drive-episode-timeout", "--drive-act-timeout", "--drive-memory")
_known_executor = one_of(("auto", "inline", "processes", "ray"), "executor")


def _executor(given: GivenText) -> str:
    """Return the executor: `inline` where `auto` meets a debugger or prints, which need the agent in this process.

    The official evaluator has the agent in a process of its own, whatever is asked for.
    """
    executor = _known_executor(given)
    if executor != "auto" or given.source is None:
        return executor
    config: Any = given.source
    if _simulator(config) == BENCH2DRIVE:
        return "processes"
    debugging = any(config.getoption(name, False) for name in ("usepdb", "trace"))
    return "inline" if debugging or config.getoption("capture", "") == "no" else "processes"


def _simulator(config: OptionSource) -> str:
    """Return the simulator that was asked for; empty for the default."""
    return str(config.getoption("drive_sim") or config.getini("drive_sim"))


def _workers(given: GivenText) -> int | None:
    if given.text == "auto":
        return None
    if not given.text.isdecimal() or int(given.text) < 1:
        raise UsageError(f"{given.flag} is {given.text!r}, expected a whole number >= 1, or auto.")
    return int(given.text)


def _width(given: GivenText) -> int | None:
    if given.text in ("", "none"):
        return None
    if not given.text.isdecimal() or int(given.text) < 4 or int(given.text) % 4:
        raise UsageError(f"{given.flag} is {given.text!r}, expected a multiple of 4 such as 8.")
    return int(given.text)


@dataclass(frozen=True, slots=True)
class ExecutionOptions:
    """The choices of one run about how its episodes are driven; none of them but `lockstep` changes a number.

    The executor `inline` drives in the process of pytest, where no limit of time or memory is kept. `lockstep` is how
    many episodes of an agent share a batch, None where all are driven one by one: a batch may round otherwise than a
    single call does. `workers` is None for as many as fit; times are in seconds, None where there is no limit, and
    `memory_bytes` too.
    """

    executor: str = option("--drive-executor", parse=_executor)
    workers: int | None = option("--drive-workers", parse=_workers)
    lockstep: int | None = option("--drive-lockstep", parse=_width)
    episode_timeout_s: float | None = option("--drive-episode-timeout", parse=time_limit_s)
    act_timeout_s: float | None = option("--drive-act-timeout", parse=time_limit_s)
    memory_bytes: int | None = option("--drive-memory", parse=gigabytes)
    ray_address: str = option("--drive-ray-address")
    b2d_root: str = option("--drive-b2d-root", parse=folder_path)
    b2d_python: str = option("--drive-b2d-python", parse=program)
    results: str = option("--drive-results")
    budget_s: float | None = option("--drive-budget", parse=time_limit_s)

    @classmethod
    def from_pytest_config(cls, config: OptionSource) -> ExecutionOptions:
        """Read the options, each with its ini key and default. Raises `UsageError` for values that cannot be used."""
        options = cls(**read_fields(cls, config))
        if options.executor == "inline":
            for flag in _GUARDS:
                if asked_for(flag, config):
                    raise UsageError(
                        f"{flag} needs a process for each episode, and these are driven in that of pytest: "
                        "--drive-executor inline, -s, --pdb or --trace asks for it. Leave one of them out."
                    )
        if options.executor != "ray" and asked_for("--drive-ray-address", config):
            raise UsageError("--drive-ray-address needs --drive-executor ray: add that, or leave the address out.")
        if _simulator(config) != BENCH2DRIVE:
            for flag in ("--drive-b2d-root", "--drive-b2d-python"):
                if asked_for(flag, config):
                    raise UsageError(f"{flag} needs --drive-sim {BENCH2DRIVE}: add that, or leave {flag} out.")
        if options.lockstep is not None and options.executor == "ray":
            raise UsageError(
                "--drive-lockstep and --drive-executor ray cannot be combined: Ray drives every episode in a process "
                "of its own. Leave one of them out."
            )
        return options

    def check_workers(self) -> None:
        """Raise `UsageError` when pytest-xdist's workers cannot drive like this."""
        if self.executor == "ray":
            raise UsageError(
                "--drive-executor ray and -n cannot be combined: every worker would start, or fill, a cluster of its "
                "own. Leave -n out; Ray drives the episodes of one pytest on all nodes at once."
            )

    def slots(self, *, shared: bool) -> int:
        """Return how many episodes at a time. `shared`: pytest-xdist's workers drive beside us, each on its core."""
        return self.workers or (1 if shared else available_cores())


def available_cores() -> int:
    """Return how many cores this process may use."""
    affinity: Callable[[int], set[int]] | None = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity is not None else os.cpu_count() or 1
