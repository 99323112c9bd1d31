"""How the episodes of a run are driven: in which processes, how many at a time, within which limits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.cores import available_cores
from pytest_drive_robust.options.option import GivenText, OptionSource, asked_for, option, read_fields
from pytest_drive_robust.options.parsers import folder_path, gigabytes, one_of, program, time_limit_s
from pytest_drive_robust.options.run import BENCH2DRIVE

_GUARDS = ("--drive-episode-timeout", "--drive-act-timeout", "--drive-memory")
_known_executor = one_of(("auto", "inline", "processes", "ray"), "executor")


def _executor(given: GivenText) -> str:
    """Return the executor. `auto` becomes `inline` with --pdb, --trace or -s, which need the agent in this process.

    With the official evaluator `auto` becomes `processes`: the evaluator always drives in its own process.
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
    """Return the simulator of the command line, else of the ini file; `""` for the default."""
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
    """How one run drives its episodes. Only `lockstep` can change a number: a batch may round unlike a single call.

    The executor `inline` drives in the process of pytest, without limits of time or memory. `lockstep` is the number of
    episodes of one agent in a batch, None to drive each episode alone. `workers` is None for as many as fit. Times are
    in seconds. A time or `memory_bytes` is None when there is no limit.
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
            several = ("--drive-workers",) if (options.workers or 1) > 1 else ()
            for flag in (*_GUARDS, *several):
                if asked_for(flag, config):
                    raise UsageError(
                        f"{flag} needs worker processes, but --drive-executor inline, -s, --pdb or --trace drives the "
                        f"episodes in the process of pytest. Leave {flag} or the other option out."
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
        """Raise `UsageError` when pytest-xdist's workers cannot drive with these options: with the executor `ray`."""
        if self.executor == "ray":
            raise UsageError(
                "--drive-executor ray and -n cannot be combined: every worker would start, or fill, a cluster of its "
                "own. Leave -n out; Ray drives the episodes of one pytest on all nodes at once."
            )

    def slots(self, *, shared: bool) -> int:
        """Return how many episodes to drive at a time: `workers`, else 1 if `shared`, else one for each available core.

        `shared` says that other pytest-xdist workers drive at the same time, each on its own core.
        """
        return self.workers or (1 if shared else available_cores())
