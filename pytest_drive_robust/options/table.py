"""Every option and the marker, as plain tables: all that a session without `--drive-robust` ever loads of them."""

from __future__ import annotations

from typing import NamedTuple

__all__ = [
    "CORRECTIONS",
    "DEFAULT_AGENT",
    "DEFAULT_ROUTES",
    "DEFAULT_SIMULATOR",
    "DEFAULT_STORE",
    "EXECUTION_OPTIONS",
    "EXECUTORS",
    "INCONCLUSIVE_MODES",
    "MARKER_LINE",
    "METRIC_MODES",
    "OPTIONS",
    "REGRESSION_OPTIONS",
    "Option",
]

DEFAULT_AGENT = "classical"
DEFAULT_ROUTES = "one-per-scenario"
DEFAULT_SIMULATOR = "embedded"
DEFAULT_STORE = ".drive-robust"
METRIC_MODES = ("bench2drive", "fixed")
CORRECTIONS = ("none", "holm")
INCONCLUSIVE_MODES = ("warn", "fail", "skip")


EXECUTORS = ("auto", "inline", "processes", "ray")
_AUTO = "auto"

MARKER_LINE = (
    "drive_robust(agent=NAME, routes=SPEC, seeds=[0, 1], verdict=RULE, margin=SHARE): drive these tests with this "
    "agent, these routes and these seeds, and judge them by this rule, whatever the command line says."
)


class Option(NamedTuple):
    """One command line option with the ini key of the same meaning. The command line wins.

    `bare` is what the flag means without a value; empty where it needs one.
    """

    flag: str
    ini: str
    metavar: str
    default: str
    help: str
    bare: str = ""


OPTIONS = (
    Option("--drive-agent", "drive_agent", "NAME", DEFAULT_AGENT, "the agent under test"),
    Option(
        "--drive-routes",
        "drive_routes",
        "SPEC",
        DEFAULT_ROUTES,
        "full, one-per-scenario, dev10, a route XML file, or route ids as in 101,2301",
    ),
    Option("--drive-seeds", "drive_seeds", "LIST", "0", "seeds that each route is driven with, as in 0,1"),
    Option("--drive-sim", "drive_sim", "NAME", DEFAULT_SIMULATOR, "the simulator, as in gymnasium:merge-v0"),
    Option("--drive-metrics", "drive_metrics", "MODE", "bench2drive", "how metrics are computed: bench2drive or fixed"),
    Option("--drive-verdict", "drive_verdict", "RULE", "auto", "how to judge: auto, evidence, list, point"),
    Option("--drive-margin", "drive_margin", "SHARE", "0.10", "how far beyond a limit evidence may still pass"),
    Option("--drive-alpha", "drive_alpha", "SHARE", "0.05", "how often a verdict from evidence may be wrong, each way"),
    Option(
        "--drive-inconclusive",
        "drive_inconclusive",
        "MODE",
        "warn",
        "what an inconclusive verdict does to its test: warn, fail or skip",
    ),
    Option(
        "--drive-correction",
        "drive_correction",
        "NAME",
        "none",
        "none: each verdict from evidence is wrong at most alpha of the time; holm: any fail of the whole run is",
    ),
    Option("--drive-stuck-stop", "drive_stuck_stop", "SECONDS", "", "end an episode when the ego stood this long"),
    Option(
        "--drive-store",
        "drive_store",
        "FOLDER",
        DEFAULT_STORE,
        "where finished episodes are kept for every later run; off: only until this run ends",
    ),
    Option("--drive-json", "drive_json", "FILE", "", "write all verdicts, summaries and episodes to FILE"),
    Option("--drive-csv", "drive_csv", "FILE", "", "write one line for each episode to FILE"),
)
"""Every option but the switch `--drive-robust`."""

EXECUTION_OPTIONS = (
    Option(
        "--drive-executor",
        "drive_executor",
        "NAME",
        "auto",
        "inline (in this process, for debuggers), processes (guarded children), ray; auto: processes, inline with "
        "--pdb, --trace or -s",
    ),
    Option("--drive-workers", "drive_workers", "N", "auto", "episodes at a time; auto: every core, 1 under -n"),
    Option(
        "--drive-lockstep",
        "drive_lockstep",
        "N",
        "",
        "drive agents that offer act_batch N episodes at a time in one process, N a multiple of 4 such as 8",
    ),
    Option("--drive-episode-timeout", "drive_episode_timeout", "TIME", "30m", "an episode must end within, as in 90s"),
    Option("--drive-act-timeout", "drive_act_timeout", "TIME", "60s", "a call of the agent must return within"),
    Option("--drive-memory", "drive_memory", "GB", "", "what the process of an episode may allocate, as in 4"),
    Option(
        "--drive-ray-address",
        "drive_ray_address",
        "ADDRESS",
        "",
        "the Ray cluster of --drive-executor ray: host:port, auto or local (default: $RAY_ADDRESS, else local)",
    ),
    Option(
        "--drive-b2d-root", "drive_b2d_root", "FOLDER", "", "the Bench2Drive checkout that --drive-sim bench2drive uses"
    ),
    Option(
        "--drive-results",
        "drive_results",
        "LIST",
        "",
        'judge official results instead of driving, as in "clean=DIR,200 ms latency=DIR2"',
    ),
    Option(
        "--drive-budget", "drive_budget", "TIME", "", "begin nothing new after so long, as in 20m; run again to go on"
    ),
)
"""Every option about the driving of episodes."""

REGRESSION_OPTIONS = (
    Option("--drive-save", "drive_save", "NAME", "", "store the run as .drive-robust/runs/NAME.json", bare=_AUTO),
    Option(
        "--drive-compare",
        "drive_compare",
        "REF",
        "",
        "judge every setting against a stored run, a JSON file, latest or baseline; "
        "alone: what was blessed, else the latest run",
        bare=_AUTO,
    ),
    Option(
        "--drive-fail-on", "drive_fail_on", "LIST", "", "what may get worse, as in ds:-5%,rd:+0.05; default: ds:-5%"
    ),
    Option(
        "--drive-on-mismatch",
        "drive_on_mismatch",
        "POLICY",
        "default",
        "warn or refuse when the two runs were not driven with the same; else other routes and simulators are refused",
    ),
    Option("--drive-baselines", "drive_baselines", "FOLDER", "", "blessed baselines; default: suites/baselines"),
    Option("--drive-waivers", "drive_waivers", "FILE", "", "waivers; default: suites/waivers.toml where it exists"),
)
"""What compares a run with others; none of it without `--drive-robust`."""
