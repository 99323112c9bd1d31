"""The options of one run: a frozen object built once from the command line and the ini file."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.metrics.episodes import MODES
from pytest_drive_robust.options.option import GivenText, OptionSource, option, read_fields, was_given
from pytest_drive_robust.options.parsers import (
    one_of,
    route_set,
    seconds,
    seed_list,
    share,
    store_folder,
    writable_file,
    writable_folder,
)
from pytest_drive_robust.options.table import OPTIONS
from pytest_drive_robust.perturbations.readings import READINGS, DriveReading

DEFAULT_ROUTES = OPTIONS["--drive-routes"].default
DEFAULT_SIMULATOR = OPTIONS["--drive-sim"].default
DEFAULT_STORE = OPTIONS["--drive-store"].default
RESULTS = "results"
"""The name of the simulator, and of an agent without a name, with `--drive-results`."""
BENCH2DRIVE = "bench2drive"
"""The simulator that is the official evaluator."""


def _verdict_rule(kind: GivenText, margin: GivenText, alpha: GivenText) -> VerdictRule:
    return VerdictRule(kind.text, margin=share(margin), alpha=share(alpha))


@dataclass(frozen=True, slots=True)
class RunOptions:
    """The options of one run: what is driven, how it is judged and which reports are written.

    `agent` and `simulator` are names that the registry resolves. `seeds` are non-negative, in the order given.
    `stuck_stop_s` (seconds) is None when episodes are never cut short. `verdict_rule` says how verdicts are reached,
    `inconclusive` what an inconclusive verdict does to its test, and `correction` whether a fail must hold among all
    requirements of the run. `store` is the folder of finished episodes, relative to the root folder, or `"off"`. With
    `fresh` the episodes of earlier runs in the store are not used. `json_path`, `csv_path` and `report_path` are None
    for reports that are not wanted.

    `routes_given`, `seeds_given`, `agent_given` and `reading_given` are True when the user chose the value. By default
    a simulator may bring its own routes, results are judged over all their repetitions, and an agent of ours is judged.
    `reading` is how perturbations are read; a switch in a sentence may differ from the default reading, but must not
    contradict a reading that the user chose. `plugins` are the plugins that register names, as `drive-robust -p` takes
    them.
    """

    agent: str = option("--drive-agent")
    routes: str = option("--drive-routes", parse=route_set)
    seeds: tuple[int, ...] = option("--drive-seeds", parse=seed_list)
    simulator: str = option("--drive-sim")
    reading: str = option("--drive-reading", parse=one_of(READINGS, "reading"))
    metrics: str = option("--drive-metrics", parse=one_of(MODES, "metric mode"))
    verdict_rule: VerdictRule = option("--drive-verdict", "--drive-margin", "--drive-alpha", parse=_verdict_rule)
    inconclusive: str = option(
        "--drive-inconclusive", parse=one_of(("warn", "fail", "skip"), "way to treat inconclusive verdicts")
    )
    correction: str = option("--drive-correction", parse=one_of(("none", "holm"), "correction"))
    stuck_stop_s: float | None = option("--drive-stuck-stop", parse=seconds)
    store: str = option("--drive-store", parse=store_folder)
    fresh: bool = option("--drive-fresh")
    json_path: Path | None = option("--drive-json", parse=writable_file)
    csv_path: Path | None = option("--drive-csv", parse=writable_file)
    report_path: Path | None = option("--drive-report", parse=writable_folder)
    plan: bool = option("--drive-plan")
    probe: bool = option("--drive-probe")
    routes_given: bool = field(default=False, compare=False)
    seeds_given: bool = field(default=False, compare=False)
    agent_given: bool = field(default=False, compare=False)
    reading_given: bool = field(default=False, compare=False)
    plugins: tuple[str, ...] = field(default=(), compare=False)

    @classmethod
    def from_pytest_config(cls, config: OptionSource) -> RunOptions:
        """Read the options, each with its ini key and default. Raises `UsageError` for values that cannot be used."""
        options = cls(
            **read_fields(cls, config),
            routes_given=was_given("--drive-routes", config),
            seeds_given=was_given("--drive-seeds", config),
            agent_given=was_given("--drive-agent", config),
            reading_given=was_given("--drive-reading", config),
        )
        paths = [path for path in (options.json_path, options.csv_path, options.report_path) if path is not None]
        if len(set(map(os.path.realpath, paths))) < len(paths):
            raise UsageError("two of --drive-json, --drive-csv and --drive-report name one path. Give each its own.")
        return options

    @property
    def is_external(self) -> bool:
        """True when no simulator of ours drives, so that `drive-robust replay` cannot drive an episode again."""
        return self.simulator in (RESULTS, BENCH2DRIVE)

    @property
    def asked_reading(self) -> DriveReading | None:
        """The reading that the command line or the ini file sets; None when neither sets one."""
        return DriveReading(self.reading, f"--drive-reading {self.reading}") if self.reading_given else None

    def to_json(self) -> dict[str, object]:
        """Return the options that decide numbers, as plain JSON types."""
        return {
            "agent": self.agent,
            "routes": self.routes,
            "seeds": list(self.seeds),
            "simulator": self.simulator,
            "reading": self.reading,
            "metrics": self.metrics,
            "stuck_stop_s": self.stuck_stop_s,
            "verdict": self.verdict_rule.kind,
            "margin": self.verdict_rule.margin,
            "alpha": self.verdict_rule.alpha,
            "correction": self.correction,
            "plugins": list(self.plugins),
        }
