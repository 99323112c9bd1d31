"""Every option of the command line and the ini file, stated once: flag, metavar, default, help.

Dataclasses read the table by flag: `options.run` (what is driven and judged), `options.execution` (how episodes are
driven) and `regression.options` (which run to compare with). Every pytest session imports this module, but no other
module of `options`.
"""

from __future__ import annotations

from typing import NamedTuple


class Option(NamedTuple):
    """One command line option with the ini key of the same meaning. The command line wins.

    `bare` is the value of the flag alone, `""` when the flag needs a value. A switch has neither value nor ini key.
    """

    flag: str
    metavar: str
    default: str
    help: str
    bare: str = ""
    is_switch: bool = False

    @property
    def name(self) -> str:
        """The ini key, which is also pytest's name for the value: `"drive_agent"`."""
        return self.flag.lstrip("-").replace("-", "_")


def _switch(flag: str, help: str) -> Option:
    return Option(flag, "", "", help, is_switch=True)


_SESSION = (_switch("--drive-robust", "drive episodes and judge requirements"),)

_RUN = (
    Option("--drive-agent", "NAME", "tcp", "drive this agent: a name from `drive-robust list agents`, or module:Class"),
    Option(
        "--drive-routes",
        "SPEC",
        "one-per-scenario",
        "drive these routes: full, one-per-scenario, dev10, a route XML file, ids as in 101,2301, or FILE:id,id",
    ),
    Option("--drive-seeds", "LIST", "0", "drive each route once with each of these seeds, as in 0,1"),
    Option("--drive-sim", "NAME", "embedded", "drive in this simulator, as in gymnasium:merge-v0"),
    Option(
        "--drive-reading",
        "NAME",
        "paper",
        "read failures as the paper's equations (paper) or as its released code (released), where the two differ",
    ),
    Option(
        "--drive-metrics",
        "MODE",
        "bench2drive",
        "compute metrics exactly as Bench2Drive's tools (bench2drive), or without their known errors (fixed)",
    ),
    Option(
        "--drive-verdict",
        "RULE",
        "auto",
        "judge routes like these (evidence) or exactly these (list), both until the verdict is clear, or drive all "
        "routes (point); auto: evidence, or list with fewer than 20 routes",
    ),
    Option(
        "--drive-margin",
        "SHARE",
        "0.10",
        "let evidence pass values that are beyond the limit by up to this share of the metric's range",
    ),
    Option("--drive-alpha", "SHARE", "0.05", "let a fail, or a pass, from evidence be wrong this often at most"),
    Option(
        "--drive-inconclusive",
        "MODE",
        "warn",
        "treat a test with an inconclusive verdict so: warn (it passes, with a warning), fail or skip",
    ),
    Option(
        "--drive-correction",
        "NAME",
        "none",
        "apply --drive-alpha to fails of each requirement alone (none), or to any wrong fail in the whole run (holm)",
    ),
    Option(
        "--drive-stuck-stop",
        "SECONDS",
        "",
        "end an episode once the ego stood this long; none: after 60 s, as in Bench2Drive",
    ),
    Option(
        "--drive-store",
        "FOLDER",
        ".drive-robust",
        "keep finished episodes in FOLDER for every later run; off: only until this run ends",
    ),
    _switch("--drive-fresh", "drive again what earlier runs left in the store"),
    Option("--drive-json", "FILE", "", "write all verdicts, summaries and episodes to FILE"),
    Option("--drive-csv", "FILE", "", "write one line for each episode to FILE"),
    Option("--drive-report", "FOLDER", "", "write web pages to FOLDER: verdicts, what went wrong, replays"),
    _switch("--drive-plan", "show which episodes are needed and stored; drive nothing"),
    _switch("--drive-probe", "drive one clean episode twice first, and report whether it repeats to the bit"),
)

_EXECUTION = (
    Option(
        "--drive-executor",
        "NAME",
        "auto",
        "drive in worker processes (processes), in this process for debuggers (inline) or on a cluster (ray); auto: "
        "processes, inline with --pdb, --trace or -s",
    ),
    Option(
        "--drive-workers",
        "N",
        "auto",
        "drive N episodes at a time; auto: one on every core that this process may use, 1 under -n and with "
        "--drive-sim bench2drive",
    ),
    Option(
        "--drive-lockstep",
        "N",
        "",
        "drive agents that offer act_batch N episodes at a time in one process, N a multiple of 4 such as 8",
    ),
    Option("--drive-episode-timeout", "TIME", "30m", "stop an episode after this wall time, as in 90s; none: no limit"),
    Option(
        "--drive-act-timeout",
        "TIME",
        "60s",
        "stop an episode when one call of the agent takes longer than this, as in 90s; none: no limit",
    ),
    Option("--drive-memory", "GB", "", "let the process of an episode allocate this much at most, as in 4"),
    Option(
        "--drive-ray-address",
        "ADDRESS",
        "",
        "use this Ray cluster with --drive-executor ray: host:port, auto or local (default: $RAY_ADDRESS, else local)",
    ),
    Option("--drive-b2d-root", "FOLDER", "", "use the Bench2Drive checkout in FOLDER, with --drive-sim bench2drive"),
    Option(
        "--drive-b2d-python",
        "FILE",
        "",
        "run the evaluator of --drive-sim bench2drive with this Python, that of the agent's environment (default: "
        "that of pytest)",
    ),
    Option(
        "--drive-results",
        "LIST",
        "",
        'judge official results instead of driving, as in "clean=DIR,200 ms latency=DIR2"',
    ),
    Option("--drive-budget", "TIME", "", "begin no episode after this time, as in 20m; run again to go on"),
)

_REGRESSION = (
    Option(
        "--drive-save",
        "NAME",
        "",
        "store the run as .drive-robust/runs/NAME.json, to compare others with; drives all routes, also those that "
        "verdicts do without",
        bare="auto",
    ),
    Option(
        "--drive-compare",
        "REF",
        "",
        "judge every setting against a stored run, a JSON file, latest or baseline; "
        "alone: the blessed baseline, else the latest run; drives all routes",
        bare="auto",
    ),
    Option(
        "--drive-fail-on",
        "LIST",
        "",
        "with --drive-compare, fail what gets worse by more than this, as in ds:-5%,rd:+0.05 (default: ds:-5%)",
    ),
    Option(
        "--drive-on-mismatch",
        "POLICY",
        "default",
        "warn about runs that were driven differently (warn) or refuse to compare them (refuse); default: refuse "
        "other routes and simulators, warn about the rest",
    ),
    Option("--drive-baselines", "FOLDER", "", "keep blessed baselines in FOLDER (default: suites/baselines)"),
    Option(
        "--drive-waivers",
        "FILE",
        "",
        "read waivers from FILE (default: suites/waivers.toml where it exists); none: waive nothing",
    ),
)

OPTIONS = {option.flag: option for option in (*_SESSION, *_RUN, *_EXECUTION, *_REGRESSION)}
"""Every option by its flag, in the order of `--help`."""
