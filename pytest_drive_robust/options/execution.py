"""How the episodes of a run are driven: in which processes, how many at a time, within which limits."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.options.run import OptionSource, read_option
from pytest_drive_robust.options.table import EXECUTION_OPTIONS, EXECUTORS

__all__ = ["ExecutionOptions", "available_cores", "parse_duration_s"]

_DURATION = re.compile(r"(?P<number>[0-9]*\.?[0-9]+)\s*(?P<unit>ms|s|sec|m|min|h)?", re.IGNORECASE)
_SECONDS = {"ms": 1e-3, "s": 1.0, "sec": 1.0, "m": 60.0, "min": 60.0, "h": 3600.0}


@dataclass(frozen=True, slots=True)
class ExecutionOptions:
    """The choices of one run about how its episodes are driven; none of them but `lockstep` changes a number.

    `lockstep` is how many episodes of an agent share a batch, None where all are driven one by one: a batch may round
    otherwise than a single call does. `workers` is None for as many as fit; times are in seconds, None where there is
    no limit, and `memory_bytes` too.
    """

    executor: str = "auto"
    workers: int | None = None
    lockstep: int | None = None
    episode_timeout_s: float | None = 1800.0
    act_timeout_s: float | None = 60.0
    memory_bytes: int | None = None
    budget_s: float | None = None
    results: str = ""
    b2d_root: str = ""
    ray_address: str = ""

    @classmethod
    def from_pytest_config(cls, config: OptionSource) -> ExecutionOptions:
        """Read the options, each with its ini key and default. Raises `UsageError` for values that cannot be used."""
        given = {option.ini: read_option(config, option) for option in EXECUTION_OPTIONS}
        executor = given["drive_executor"]
        if executor not in EXECUTORS:
            raise UnknownNameError.of("executor", executor, EXECUTORS, hint="Set it with --drive-executor.")
        lockstep = _width(given["drive_lockstep"])
        if lockstep is not None and executor == "ray":
            raise UsageError(
                "--drive-lockstep and --drive-executor ray exclude each other: Ray drives every episode in a process "
                "of its own. Leave one of them out."
            )
        return cls(
            executor=_executor_for(config) if executor == "auto" else executor,
            workers=_workers(given["drive_workers"]),
            lockstep=lockstep,
            episode_timeout_s=_limit("--drive-episode-timeout", given["drive_episode_timeout"]),
            act_timeout_s=_limit("--drive-act-timeout", given["drive_act_timeout"]),
            memory_bytes=_bytes("--drive-memory", given["drive_memory"]),
            budget_s=_limit("--drive-budget", given["drive_budget"]),
            results=given["drive_results"],
            b2d_root=given["drive_b2d_root"],
            ray_address=given["drive_ray_address"],
        )

    def check_workers(self) -> None:
        """Raise `UsageError` when pytest-xdist's workers cannot drive like this."""
        if self.executor == "ray":
            raise UsageError(
                "--drive-executor ray and -n exclude each other: every worker would start, or fill, a cluster of its "
                "own. Leave -n out; Ray drives the episodes of one pytest on all nodes at once."
            )

    def slots(self, *, shared: bool) -> int:
        """Episodes at a time. `shared`: pytest-xdist's workers drive beside us, each on a core of its own."""
        return self.workers or (1 if shared else available_cores())


def available_cores() -> int:
    """The cores that this process may use."""
    affinity: Callable[[int], set[int]] | None = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity is not None else os.cpu_count() or 1


def parse_duration_s(given: str, *, source: str) -> float:
    """`"90"`, `"90s"`, `"20m"`, `"1.5h"` as seconds. Raises `UsageError`, naming `source`, for all but times > 0."""
    match = _DURATION.fullmatch(given.strip())
    seconds = float(match["number"]) * _SECONDS[(match["unit"] or "s").lower()] if match else math.nan
    if not (math.isfinite(seconds) and seconds > 0):
        raise UsageError(f"{source} is {given!r}, expected a time such as 90s, 20m or 1.5h.")
    return seconds


def _limit(option: str, given: str) -> float | None:
    return None if given in ("", "none") else parse_duration_s(given, source=option)


def _workers(given: str) -> int | None:
    if given == "auto":
        return None
    if not given.isdecimal() or int(given) < 1:
        raise UsageError(f"--drive-workers is {given!r}, expected a whole number >= 1, or auto.")
    return int(given)


def _width(given: str) -> int | None:
    if given in ("", "none"):
        return None
    if not given.isdecimal() or int(given) < 4 or int(given) % 4:
        raise UsageError(f"--drive-lockstep is {given!r}, expected a multiple of 4 such as 8.")
    return int(given)


def _bytes(option: str, given: str) -> int | None:
    if not given:
        return None
    number = given.lower().removesuffix("gb").removesuffix("g").strip()
    try:
        gigabytes = float(number)
    except ValueError:
        gigabytes = math.nan
    if not (math.isfinite(gigabytes) and gigabytes > 0):
        raise UsageError(f"{option} is {given!r}, expected gigabytes > 0, as in {option} 4.")
    return int(gigabytes * 1e9)


def _executor_for(config: Any) -> str:
    """Debuggers and prints need the agent in this process."""
    looking = ("usepdb", "trace")
    inline = any(config.getoption(name, False) for name in looking) or config.getoption("capture", "") == "no"
    return "inline" if inline else "processes"
