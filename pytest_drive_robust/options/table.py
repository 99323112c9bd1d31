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
    Option("--drive-agent", "NAME", "tcp", "the agent under test"),
    Option(
        "--drive-routes",
        "SPEC",
        "one-per-scenario",
        "full, one-per-scenario, dev10, a route XML file, ids as in 101,2301, or FILE:id,id",
    ),
    Option("--drive-seeds", "LIST", "0", "seeds that each route is driven with, as in 0,1"),
    Option("--drive-sim", "NAME", "embedded", "the simulator, as in gymnasium:merge-v0"),
    Option(
        "--drive-reading",
        "NAME",
        "paper",
        "how failures are read where the paper's equations and its released code differ: paper or released",
    ),
    Option("--drive-metrics", "MODE", "bench2drive", "how metrics are computed: bench2drive or fixed"),
    Option("--drive-verdict", "RULE", "auto", "how to judge: auto, evidence, list, point"),
    Option("--drive-margin", "SHARE", "0.10", "how far beyond a limit evidence may still pass"),
    Option("--drive-alpha", "SHARE", "0.05", "how often a verdict from evidence may be wrong, each way"),
    Option("--drive-inconclusive", "MODE", "warn", "what an inconclusive verdict does to its test: warn, fail or skip"),
    Option(
        "--drive-correction",
        "NAME",
        "none",
        "none: each verdict from evidence is wrong at most alpha of the time; holm: at most alpha of the time "
        "the whole run has a wrong fail",
    ),
    Option(
        "--drive-stuck-stop",
        "SECONDS",
        "",
        "end an episode once the ego stood this long; none: after 60 s, as officially",
    ),
    Option(
        "--drive-store",
        "FOLDER",
        ".drive-robust",
        "where finished episodes are kept for every later run; off: only until this run ends",
    ),
    _switch("--drive-fresh", "drive again what earlier runs left in the store"),
    Option("--drive-json", "FILE", "", "write all verdicts, summaries and episodes to FILE"),
    Option("--drive-csv", "FILE", "", "write one line for each episode to FILE"),
    Option("--drive-report", "FOLDER", "", "write pages to look at to FOLDER: verdicts, failures, replays"),
    _switch("--drive-plan", "show which episodes are needed and stored; drive nothing"),
    _switch("--drive-probe", "drive one clean episode twice first, and report whether it repeats to the bit"),
)

_EXECUTION = (
    Option(
        "--drive-executor",
        "NAME",
        "auto",
        "inline (in this process, for debuggers), processes (workers of our own), ray; auto: processes, inline with "
        "--pdb, --trace or -s",
    ),
    Option(
        "--drive-workers",
        "N",
        "auto",
        "episodes at a time; auto: every core, 1 under -n and with --drive-sim bench2drive",
    ),
    Option(
        "--drive-lockstep",
        "N",
        "",
        "drive agents that offer act_batch N episodes at a time in one process, N a multiple of 4 such as 8",
    ),
    Option("--drive-episode-timeout", "TIME", "30m", "longest wall time of an episode, as in 90s"),
    Option("--drive-act-timeout", "TIME", "60s", "longest wall time of one call of the agent"),
    Option("--drive-memory", "GB", "", "what the process of an episode may allocate, as in 4"),
    Option(
        "--drive-ray-address",
        "ADDRESS",
        "",
        "the Ray cluster of --drive-executor ray: host:port, auto or local (default: $RAY_ADDRESS, else local)",
    ),
    Option("--drive-b2d-root", "FOLDER", "", "the Bench2Drive checkout that --drive-sim bench2drive uses"),
    Option(
        "--drive-b2d-python",
        "FILE",
        "",
        "the Python of the agent's environment, for the evaluator of --drive-sim bench2drive; default: that of pytest",
    ),
    Option(
        "--drive-results",
        "LIST",
        "",
        'judge official results instead of driving, as in "clean=DIR,200 ms latency=DIR2"',
    ),
    Option("--drive-budget", "TIME", "", "begin nothing new after so long, as in 20m; run again to go on"),
)

_REGRESSION = (
    Option(
        "--drive-save",
        "NAME",
        "",
        "store the run as .drive-robust/runs/NAME.json, with all routes, also those that verdicts do without",
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
    Option("--drive-fail-on", "LIST", "", "what may get worse, as in ds:-5%,rd:+0.05; default: ds:-5%"),
    Option(
        "--drive-on-mismatch",
        "POLICY",
        "default",
        "default, warn or refuse, when the two runs were driven differently; default refuses other routes and "
        "simulators, and warns about the rest",
    ),
    Option("--drive-baselines", "FOLDER", "", "blessed baselines; default: suites/baselines"),
    Option("--drive-waivers", "FILE", "", "waivers; default: suites/waivers.toml where it exists"),
)

OPTIONS = {option.flag: option for option in (*_SESSION, *_RUN, *_EXECUTION, *_REGRESSION)}
"""Every option by its flag, in the order of `--help`."""
