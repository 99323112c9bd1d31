"""What one run was asked to do: a frozen object built once from the command line and the ini file."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.options.option import (
    GivenText,
    Option,
    OptionSource,
    combined,
    option,
    options_of,
    read_fields,
    switch,
    was_given,
)
from pytest_drive_robust.options.parsers import one_of, seconds, seed_list, share, store_folder, writable_file

__all__ = ["DEFAULT_ROUTES", "DEFAULT_SIMULATOR", "DEFAULT_STORE", "DRIVE_ROBUST", "RunOptions"]

DEFAULT_ROUTES = "one-per-scenario"
DEFAULT_SIMULATOR = "embedded"
DEFAULT_STORE = ".drive-robust"

DRIVE_ROBUST = Option("--drive-robust", "", "", "drive episodes and judge requirements", is_switch=True)
"""The switch without which the plugin is inert."""


def _verdict_rule(kind: GivenText, margin: GivenText, alpha: GivenText) -> VerdictRule:
    return VerdictRule(kind.text, margin=share(margin), alpha=share(alpha))


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

    agent: str = option("--drive-agent", "NAME", "classical", "the agent under test")
    routes: str = option(
        "--drive-routes",
        "SPEC",
        DEFAULT_ROUTES,
        "full, one-per-scenario, dev10, a route XML file, or route ids as in 101,2301",
    )
    seeds: tuple[int, ...] = option(
        "--drive-seeds", "LIST", "0", "seeds that each route is driven with, as in 0,1", parse=seed_list
    )
    simulator: str = option("--drive-sim", "NAME", DEFAULT_SIMULATOR, "the simulator, as in gymnasium:merge-v0")
    metrics: str = option(
        "--drive-metrics",
        "MODE",
        "bench2drive",
        "how metrics are computed: bench2drive or fixed",
        parse=one_of(("bench2drive", "fixed"), "metric mode"),
    )
    verdict_rule: VerdictRule = combined(
        Option("--drive-verdict", "RULE", "auto", "how to judge: auto, evidence, list, point"),
        Option("--drive-margin", "SHARE", "0.10", "how far beyond a limit evidence may still pass"),
        Option("--drive-alpha", "SHARE", "0.05", "how often a verdict from evidence may be wrong, each way"),
        parse=_verdict_rule,
    )
    inconclusive: str = option(
        "--drive-inconclusive",
        "MODE",
        "warn",
        "what an inconclusive verdict does to its test: warn, fail or skip",
        parse=one_of(("warn", "fail", "skip"), "way to treat inconclusive verdicts"),
    )
    correction: str = option(
        "--drive-correction",
        "NAME",
        "none",
        "none: each verdict from evidence is wrong at most alpha of the time; holm: any fail of the whole run is",
        parse=one_of(("none", "holm"), "correction"),
    )
    stuck_stop_s: float | None = option(
        "--drive-stuck-stop", "SECONDS", "", "end an episode when the ego stood this long", parse=seconds
    )
    store: str = option(
        "--drive-store",
        "FOLDER",
        DEFAULT_STORE,
        "where finished episodes are kept for every later run; off: only until this run ends",
        parse=store_folder,
    )
    fresh: bool = switch("--drive-fresh", "drive again what earlier runs left in the store")
    json_path: Path | None = option(
        "--drive-json", "FILE", "", "write all verdicts, summaries and episodes to FILE", parse=writable_file
    )
    csv_path: Path | None = option(
        "--drive-csv", "FILE", "", "write one line for each episode to FILE", parse=writable_file
    )
    plan: bool = switch("--drive-plan", "show which episodes are needed and stored; drive nothing")
    probe: bool = switch("--drive-probe", "drive one clean episode twice: does one seed suffice?")
    routes_given: bool = field(default=False, compare=False)
    plugins: tuple[str, ...] = field(default=(), compare=False)

    @classmethod
    def from_pytest_config(cls, config: OptionSource) -> RunOptions:
        """Read the options, each with its ini key and default. Raises `UsageError` for values that cannot be used."""
        (routes,) = options_of(cls, "routes")
        return cls(**read_fields(cls, config), routes_given=was_given(routes, config))

    def to_json(self) -> dict[str, object]:
        """Return the options that decide numbers, as plain JSON types."""
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
