"""What the seed decides: the same agents, routes and settings with two seeds, one against the other.

Files are what `paper.py` takes. Each seed is in one of them, or both are in one `results.json`; agents and routes that
only one seed has are left out:

    python benchmarks/seeds.py benchmarks/paper/results.json --write benchmarks/paper/seeds.md
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from _paper.joining import read
from _paper.seeds import two_seeds
from _paper.seeds_page import seeds_text

from pytest_drive_robust.errors import DriveRobustError
from pytest_drive_robust.store.whole_file import write_whole


def main(argv: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE", help="a report of --drive-json, or results.json")
    parser.add_argument("--write", type=Path, required=True, metavar="PAGE", help="where the page is written")
    given = parser.parse_args(argv)
    try:
        seeds = two_seeds([read([path]) for path in given.files])
    except DriveRobustError as error:
        sys.exit(f"error: {error}")
    write_whole(given.write, seeds_text(seeds))
    print(f"{given.write}: {len(seeds[0].routes)} routes, {', '.join(seeds[0].agents)}")


if __name__ == "__main__":
    main()
