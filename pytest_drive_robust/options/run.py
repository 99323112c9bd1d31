"""What one run was asked to do: a frozen object built once from the command line and the ini file."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import UnknownNameError, UsageError, nearest
from pytest_drive_robust.options.table import (
    CORRECTIONS,
    DEFAULT_AGENT,
    DEFAULT_ROUTES,
    DEFAULT_SIMULATOR,
    DEFAULT_STORE,
    INCONCLUSIVE_MODES,
    METRIC_MODES,
    OPTIONS,
    Option,
)

__all__ = ["OptionSource", "RunOptions", "positive_seconds", "read_option"]

_ROUTES = next(option for option in OPTIONS if option.ini == "drive_routes")


class OptionSource(Protocol):
    """The part of `pytest.Config` that options are read from."""

    @property
    def rootpath(self) -> Path:
        """The folder that a relative `--drive-store` starts from."""
        ...

    def getoption(self, name: str) -> Any:
        """The value of a command line option."""
        ...

    def getini(self, name: str) -> Any:
        """The value of an ini key."""
        ...


@dataclass(frozen=True, slots=True)
class RunOptions:
    """The choices of one run.

    `seeds` are non-negative and in the order given; `stuck_stop_s` is None when episodes are never cut short;
    `json_path` and `csv_path` are None when no file was asked for. `agent` and `simulator` are names that the registry
    resolves. `verdict_rule` says how verdicts come about, `inconclusive` what one that shows nothing does to its test,
    `correction` whether fails must stand among all requirements of the run. `store` is the folder of finished
    episodes or `"off"`; with `fresh` what other runs left there is not used.
    `routes_given` tells whether somebody chose `routes`: where nobody did, a simulator may bring its own.
    `plugins` register names of their own, in the words that `drive-robust -p` takes.
    """

    agent: str = DEFAULT_AGENT
    routes: str = DEFAULT_ROUTES
    seeds: tuple[int, ...] = (0,)
    simulator: str = DEFAULT_SIMULATOR
    metrics: str = "bench2drive"
    stuck_stop_s: float | None = None
    json_path: Path | None = None
    verdict_rule: VerdictRule = field(default_factory=VerdictRule)
    inconclusive: str = "warn"
    csv_path: Path | None = None
    correction: str = "none"
    store: str = DEFAULT_STORE
    fresh: bool = False
    routes_given: bool = field(default=False, compare=False)
    plugins: tuple[str, ...] = field(default=(), compare=False)

    @classmethod
    def from_pytest_config(cls, config: OptionSource) -> RunOptions:
        """Read the options, each with its ini key and default. Raises `UsageError` for values that cannot be used."""
        given = {option.ini: read_option(config, option) for option in OPTIONS}
        return cls(
            agent=given["drive_agent"],
            routes=given["drive_routes"],
            seeds=parse_seeds(given["drive_seeds"], source="--drive-seeds"),
            simulator=given["drive_sim"],
            metrics=_metric_mode(given["drive_metrics"]),
            stuck_stop_s=positive_seconds("--drive-stuck-stop", text) if (text := given["drive_stuck_stop"]) else None,
            json_path=_writable_file("--drive-json", given["drive_json"]),
            csv_path=_writable_file("--drive-csv", given["drive_csv"]),
            verdict_rule=VerdictRule(
                given["drive_verdict"],
                margin=_share("--drive-margin", given["drive_margin"]),
                alpha=_share("--drive-alpha", given["drive_alpha"]),
            ),
            inconclusive=_inconclusive_mode(given["drive_inconclusive"]),
            correction=_correction(given["drive_correction"]),
            store=_store_folder(given["drive_store"], config.rootpath),
            fresh=bool(config.getoption("drive_fresh")),
            routes_given=bool(_given(config, _ROUTES)),
        )

    def to_json(self) -> dict[str, object]:
        """The settings as plain JSON types."""
        return {
            "agent": self.agent,
            "routes": self.routes,
            "seeds": list(self.seeds),
            "simulator": self.simulator,
            "metrics": self.metrics,
            "stuck_stop_s": self.stuck_stop_s,
            "verdict": self.verdict_rule.kind,
            "margin": self.verdict_rule.margin,
            "alpha": self.verdict_rule.alpha,
            "correction": self.correction,
            "plugins": list(self.plugins),
        }


def parse_seeds(given: str, *, source: str) -> tuple[int, ...]:
    """`"0,1"` as numbers. Raises `UsageError`, naming `source`, for anything but distinct whole numbers >= 0."""
    words = [word.strip() for word in given.split(",")]
    if not all(word.isdecimal() for word in words):
        raise UsageError(f"{source} is {given!r}, expected whole numbers >= 0 with commas between them, as in 0,1.")
    return check_seeds((int(word) for word in words), source=source)


def check_seeds(seeds: Iterable[object], *, source: str) -> tuple[int, ...]:
    """The seeds when they are distinct whole numbers >= 0 and at least one, else `UsageError`, naming `source`."""
    numbers: list[int] = []
    for seed in seeds:
        if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
            raise UsageError(f"{source} holds {seed!r}, expected whole numbers >= 0.")
        if seed in numbers:
            raise UsageError(f"{source} holds seed {seed} twice: the same episode would count double.")
        numbers.append(seed)
    if not numbers:
        raise UsageError(f"{source} is empty, expected at least one seed.")
    return tuple(numbers)


def read_option(config: OptionSource, option: Option) -> str:
    """The command line's value, else the ini file's, else the default."""
    return _given(config, option) or option.default


def _given(config: OptionSource, option: Option) -> str:
    """The command line's value, else the ini file's, else nothing."""
    dest = option.flag.lstrip("-").replace("-", "_")
    given = config.getoption(dest)
    if given is None:
        given = config.getini(option.ini)
    return str(given).strip()


def _metric_mode(given: str) -> str:
    if given not in METRIC_MODES:
        raise UnknownNameError.of("metric mode", given, METRIC_MODES, hint="Set it with --drive-metrics.")
    return given


def _inconclusive_mode(given: str) -> str:
    if given not in INCONCLUSIVE_MODES:
        hint = "Set it with --drive-inconclusive."
        raise UnknownNameError.of("way to treat inconclusive verdicts", given, INCONCLUSIVE_MODES, hint=hint)
    return given


def _correction(given: str) -> str:
    if given not in CORRECTIONS:
        raise UnknownNameError.of("correction", given, CORRECTIONS, hint="Set it with --drive-correction.")
    return given


def _share(option: str, given: str) -> float:
    try:
        return float(given)
    except ValueError:
        raise UsageError(f"{option} is {given!r}, expected a number between 0 and 1, as in {option} 0.10.") from None


def positive_seconds(option: str, given: str) -> float:
    """The number of seconds that an option was given. Raises `UsageError`."""
    try:
        seconds = float(given)
    except ValueError:
        seconds = math.nan
    if not (math.isfinite(seconds) and seconds > 0):
        raise UsageError(f"{option} is {given!r}, expected seconds > 0, as in {option} 60.")
    return seconds


def _writable_file(flag: str, given: str) -> Path | None:
    """The file to write at the end, refused now when it could not be written then."""
    if not given:
        return None
    path, suffix = Path(given).absolute(), flag.replace("--drive-", ".")
    if path.is_dir():
        raise UsageError(f"{flag} is {given!r}, which is a directory; expected a file, as in {given}/run{suffix}.")
    if not path.parent.is_dir():
        missing = str(path.parent)
        raise UsageError(f"{flag} is {given!r}, but there is no directory {missing!r}.{_similar(path.parent)}")
    if not os.access(path.parent, os.W_OK):
        raise UsageError(f"{flag} is {given!r}, but {str(path.parent)!r} cannot be written to.")
    return path


def _store_folder(given: str, root: Path) -> str:
    if (root / given).is_file():
        raise UsageError(f"--drive-store is {given!r}, which is a file; expected a folder, or off.")
    return given


def _similar(folder: Path) -> str:
    """A nearby folder that does exist, as a sentence of its own."""
    if not folder.parent.is_dir():
        return ""
    close = nearest(folder.name, [entry.name for entry in folder.parent.iterdir() if entry.is_dir()])
    return f" Did you mean {str(folder.parent / close)!r}?" if close else ""
