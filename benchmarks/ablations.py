"""What decides what a failure costs a learned agent: one factor of its wrapper changed at a time, the network as it is.

    python benchmarks/ablations.py tcp --settings "200 ms latency (reading=released)" "GPS noise 15 m"
    python benchmarks/ablations.py simlingo --changes as-shipped raw-gps --routes full

Each change (`_variants.py`) is driven clean and under the settings, over the same routes; a setting with a warm-up is
compared with a clean drive that has it, too. RD is 1 - DS / DS clean with Fieller's 95 % interval; *less by* is how
much smaller RD is than that of the agent as it ships, with the jackknife's interval, paired by route. What the store
has is not driven again.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import NormalDist

import _variants
import numpy as np
from _variants import VARIANTS

from drive_robust_agents.training.drives import degradation, drive, summary
from pytest_drive_robust import Setting
from pytest_drive_robust.errors import DriveRobustError
from pytest_drive_robust.metrics.score import driving_score
from pytest_drive_robust.simulators.routes import resolve_routes

AS_SHIPPED = "as-shipped"
SETTINGS = ("GPS noise 15 m", "200 ms latency (reading=released)")


def parsed(argv: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("agent", choices=sorted(VARIANTS), help="whose wrapper is changed")
    parser.add_argument("--changes", nargs="+", metavar="NAME", help="some of them (default: all that there are)")
    parser.add_argument("--settings", nargs="+", default=list(SETTINGS), metavar="SENTENCE", help="what fails")
    parser.add_argument("--routes", default="one-per-scenario", help="what --drive-routes understands")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes (all cores)")
    parser.add_argument("--store", type=Path, default=Path(".drive-robust"), help="where episodes are kept")
    return parser.parse_args(argv)


def less_by(
    shipped: tuple[Sequence[float], Sequence[float]], changed: tuple[Sequence[float], Sequence[float]]
) -> tuple[float, float, float]:
    """Return (difference, low, high): how much smaller RD became; scores are (clean, perturbed) by route."""
    columns = np.array([*shipped, *changed])

    def difference(sums: np.ndarray) -> float:
        clean, perturbed, clean_now, perturbed_now = sums
        return float(perturbed_now / clean_now - perturbed / clean)

    whole, routes = columns.sum(axis=1), columns.shape[1]
    left_out = np.array([difference(whole - columns[:, route]) for route in range(routes)])
    error = float(np.sqrt((routes - 1) / routes * ((left_out - left_out.mean()) ** 2).sum()))
    value, reach = difference(whole), NormalDist().inv_cdf(0.975) * error
    return value, value - reach, value + reach


def main(argv: Sequence[str] | None = None) -> None:
    given = parsed(argv)
    known = VARIANTS[given.agent][1]
    changes = list(dict.fromkeys([AS_SHIPPED, *(given.changes or known)]))
    settings = [str(Setting.parse(sentence)) for sentence in given.settings]
    baselines = {setting: str(Setting.parse(setting).baseline) for setting in settings}
    driven = drive(
        [f"variant:{given.agent}/{change}" for change in changes],
        list(dict.fromkeys(["clean", *baselines.values(), *settings])),
        resolve_routes(given.routes),
        workers=given.workers,
        store=given.store,
        plugin=_variants,
    )
    print(f"| `{given.agent}`, setting | change | DS clean | DS | SR % | RD | 95 % | less by, 95 % |")
    print("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |")
    for setting in settings:
        pairs = {
            change: tuple(driven[f"variant:{given.agent}/{change}", one] for one in (baselines[setting], setting))
            for change in changes
        }
        scores = {
            change: tuple([driving_score(one) for one in part] for part in pair) for change, pair in pairs.items()
        }
        for change, (clean, perturbed) in pairs.items():
            found, lost = summary(perturbed), degradation(clean, perturbed)
            low, high = ("-" if bound is None else f"{bound:.2f}" for bound in lost["rd_interval"])
            less = (
                ""
                if change == AS_SHIPPED
                else "{:.2f} ({:.2f} to {:.2f})".format(*less_by(scores[AS_SHIPPED], scores[change]))
            )
            print(
                f"| {setting} | {change} | {summary(clean)['driving_score']:.1f} | {found['driving_score']:.1f} "
                f"| {100.0 * found['success_rate']:.0f} | {lost['rd']:.2f} | {low} to {high} | {less} |"
            )


if __name__ == "__main__":
    try:
        main()
    except DriveRobustError as error:
        sys.exit(f"error: {error}")
