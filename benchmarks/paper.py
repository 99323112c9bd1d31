"""The paper's table, its figures and its patterns, in both readings, from episodes that were driven here.

Drive first, once for each of `tcp`, `uniad`, `vad`, `simlingo`, with options or without (`simlingo:tuning=published` is
`simlingo`, and the table says so). `-k reading` drives both readings; what is the same in both is driven once. What the
store has is not driven again, so the same command goes on where it was stopped. Its limits are another agent's and
may well be broken:

    pytest --drive-robust suites/paper -k reading --drive-agent tcp --drive-routes full --drive-verdict point \\
        --drive-json tcp.json

Any two routes or more will do, the same for all agents: `one-per-scenario` has 44, `full` 220. It may be driven in
parts, with a report each: some routes and then others, one setting at a time, as in `-k "reading and occlusion-0.8"`,
and every seed by itself, `--drive-seeds 1`. The third route of each type:

    --drive-routes $(seq -s, 103 100 4403)

Then draw, from all such reports; of an agent that is in several files on the same routes each setting is that of the
last one, if all belong to the same clean run (else a new report must hold all that the old one does), so that it can be
put over the committed results:

    python benchmarks/paper.py tcp.json uniad.json vad.json simlingo.json --write benchmarks/paper
    python benchmarks/paper.py benchmarks/paper/results.json --write elsewhere

New weights drive all routes again. Their reports take the place of what the first file holds of the old ones:

    python benchmarks/paper.py benchmarks/paper/results.json tcp.json tcp-2.json tcp-3.json --replace tcp \\
        --write benchmarks/paper

All agents must hold the same routes. Of those that hold more than the others:

    python benchmarks/paper.py benchmarks/paper/results.json tcp-3.json simlingo-3.json \\
        --only tcp simlingo --write elsewhere

Written are `results.json` (score, success and efficiency of every episode, comfort of every row and seed), `table.md`,
`patterns.md`, `parts.md`, `rd_heatmap.svg`, `retention_radar.svg` and `latency_curves.svg`. `patterns.md` quotes
`explanations.md` of the same folder: a heading `## KEY`, then what somebody found out, KEY one of `severity`,
`latency`, `gps`, `occlusion`, `burst`, `speed` and `ranking`. Agents and settings that are in no file are shown as not
driven.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Collection, Sequence
from pathlib import Path

from _paper.figures import heat_map, latency_curves, retention_radar
from _paper.joining import read
from _paper.parts_page import parts_text
from _paper.patterns import patterns_of
from _paper.patterns_page import explanations, patterns_text
from _paper.published import AGENTS
from _paper.readings import READINGS, Drives
from _paper.results import text_of
from _paper.table_page import table_text

from pytest_drive_robust.errors import DriveRobustError
from pytest_drive_robust.store.whole_file import write_whole


def parsed(argv: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE", help="a report of --drive-json, or results.json")
    parser.add_argument(
        "--replace",
        nargs="+",
        default=[],
        choices=AGENTS,
        metavar="AGENT",
        help="leave out what the first FILE has of it",
    )
    parser.add_argument(
        "--only", nargs="+", default=[], choices=AGENTS, metavar="AGENT", help="leave out all other agents"
    )
    parser.add_argument("--write", type=Path, required=True, metavar="FOLDER", help="where everything is written")
    return parser.parse_args(argv)


def render(files: Sequence[Path], folder: Path, replaced: Collection[str] = (), only: Collection[str] = ()) -> None:
    """Read `files`, then write everything into `folder`: all of it or, when the files are refused, nothing.

    What the first file has of the agents in `replaced` is left out, and with `only` what any has of others.
    """
    results = read(files, replaced, only)
    patterns = {reading: patterns_of(Drives(results, reading)) for reading in READINGS}
    explained = explanations(folder / "explanations.md", patterns[READINGS[0]])
    written = {
        "results.json": text_of(results),
        "table.md": table_text(results),
        "patterns.md": patterns_text(results, patterns, explained),
        "parts.md": parts_text(results),
        "rd_heatmap.svg": heat_map(results),
        "retention_radar.svg": retention_radar(results),
        "latency_curves.svg": latency_curves(results),
    }
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in written.items():
        write_whole(folder / name, text)
    agents = ", ".join(driven.called for driven in results.agents.values())
    print(f"{folder}: {', '.join(written)}; {len(results.routes)} routes, {agents}")
    for found in zip(*patterns.values(), strict=True):
        key, verdicts = found[0].key, [pattern.verdict for pattern in found]
        lacks = key not in explained and any(verdict in ("does not appear", "cannot be told") for verdict in verdicts)
        said = ", ".join(f"{reading} {verdict}" for reading, verdict in zip(patterns, verdicts, strict=True))
        print(f"  {key:10} {said}{'; to be explained in explanations.md' if lacks else ''}")


def main(argv: Sequence[str] | None = None) -> None:
    given = parsed(argv)
    try:
        render(given.files, given.write, given.replace, given.only)
    except DriveRobustError as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    main()
