"""Whether episodes are the same bits on other machines, and with other versions of the libraries.

    python benchmarks/same_bits.py                              # every machine that this one can pretend to be
    python benchmarks/same_bits.py --agents expert --every 8 --settings 3
    python benchmarks/same_bits.py --versions python3.10 python3.13

Every row is a process of its own that drives everything again, with its libraries told to choose other code, and tells
how many digests differ from those of the first row, for each agent. A digest covers the whole record but times on the
clock. `watcher` is a script with two cameras: its digest is that of every picture, too. `stored controls` are those
that the `network` of the first row gave (an agent whose bits do depend on the machine), driven again; they are compared
with the trajectory of that first drive. What a switch changes is looked at in the same process, so that one without any
effect on this processor is seen.

`--versions` makes a virtual environment with the oldest versions that the two `pyproject.toml` allow and one with the
newest for each interpreter that is named, in `--folder`, and compares what they drive.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from packaging.version import Version
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "helpers"))

from pretended_machines import MACHINES, OLD, PLAIN, SAME, Driven, drive_on

from pytest_drive_robust.errors import UsageError

_ROOT = Path(__file__).parent.parent
_AGENTS = _ROOT / "agents"

AGENTS = "watcher,constant,random,reactive,classical,expert,network"
SETTINGS = (
    "clean",
    "3 s burst frame drop and occlusion 0.5 and GPS noise 5 m and speed noise 0.5 and 200 ms latency",
    "1 s burst frame drop and occlusion 0.8 and GPS noise 15 m and speed noise 0.2 and 500 ms latency",
    "GPS noise 15 m",
    "1 s burst frame drop",
    "3 s burst frame drop",
    "occlusion 0.5",
    "occlusion 0.8",
    "GPS noise 5 m",
    "speed noise 0.5",
    "speed noise 0.2",
    "100 ms latency",
    "200 ms latency",
    "500 ms latency",
)
MACHINE_DEPENDENT = "network"
"""Its episodes are kept, and their controls driven again on every other machine."""
PACKAGES = ("numpy", "numba", "scipy", "opencv-python-headless", "highway-env", "gymnasium")


def first_drive(given: argparse.Namespace, python: str = sys.executable) -> Driven:
    return drive_on(PLAIN, python=python, **order_of(given), keep=[MACHINE_DEPENDENT])


def order_of(given: argparse.Namespace) -> dict[str, Any]:
    return {
        "agents": given.agents.split(","),
        "routes": given.routes,
        "settings": SETTINGS[: given.settings],
        "every": given.every,
        "ticks": given.ticks,
    }


def counted(first: Driven, other: Driven) -> tuple[Counter[str], Counter[str], float]:
    """Return (digests compared, digests that differ, largest change of a score) by agent."""
    expected = {**first.digests, **{f"stored controls of {label}": SAME for label in first.stored}}
    compared = Counter(label.split(" | ")[0] for label in other.digests if label in expected)
    differ = Counter(
        label.split(" | ")[0]
        for label in other.digests
        if label in expected and other.digests[label] != expected[label]
    )
    moved = (abs(first.scores[label] - score) for label, score in other.scores.items() if _portable(label))
    return compared, differ, max(moved, default=0.0)


def _portable(label: str) -> bool:
    return not label.startswith(MACHINE_DEPENDENT)


class Rows:
    """The table, printed row by row as it grows: driving takes long."""

    def __init__(self, title: str, agents: Iterable[str]) -> None:
        self._columns = [*agents, f"stored controls of {MACHINE_DEPENDENT}"]
        self._table = Table("", "computes otherwise", *self._columns, "score by", title=title)
        self._console = Console(width=150)

    def add(self, name: str, changes: str, first: Driven, other: Driven) -> None:
        compared, differ, moved = counted(first, other)
        cells = [f"{differ[agent]} of {compared[agent]}" if compared[agent] else "-" for agent in self._columns]
        self._table.add_row(name, changes, *cells, f"{moved:.2f}")
        self._console.print(
            f"{time.strftime('%H:%M:%S')} {name} [{changes}]: {' | '.join(cells)}", highlight=False, markup=False
        )

    def show(self) -> None:
        self._console.print(self._table)


def machines(given: argparse.Namespace) -> None:
    first = first_drive(given)
    rows = Rows("digests that differ from those of this machine as it is", given.agents.split(","))
    wanted = [one for one in (PLAIN, *MACHINES, OLD) if given.machine in one.name]
    for machine in wanted:
        try:
            other = drive_on(machine, **order_of(given), stored=first.stored)
        except RuntimeError as error:  # such as code for a processor that this one is not
            print(error, file=sys.stderr)
            continue
        changed = other.changed(first)
        silent = machine is not PLAIN and not changed
        rows.add(machine.name, "nothing here" if silent else ", ".join(changed) or "-", first, other)
    rows.show()


# --- versions ---


def bounds() -> dict[str, str]:
    """Return the lowest version of everything that is installed with the two distributions, and with tests of them."""
    found: dict[str, str] = {}
    for file in (_ROOT / "pyproject.toml", _AGENTS / "pyproject.toml"):
        text = file.read_text(encoding="utf-8")
        for block in re.findall(r"^dependencies = \[(.*?)\]", text, re.DOTALL | re.MULTILINE):
            found.update(re.findall(r'"([A-Za-z0-9_.-]+)>=([0-9.]+)', block))
    return found


def environment(python: str, *, oldest: bool, folder: Path) -> Path:
    """Return the interpreter of a virtual environment; it is made when it is not there."""
    code = "import sys; print('%d.%d' % sys.version_info[:2])"
    version = subprocess.run([python, "-c", code], capture_output=True, text=True, check=True).stdout.strip()
    home = folder / f"{version}-{'oldest' if oldest else 'newest'}"
    inside = home / "bin" / "python"
    if (home / "complete").exists():
        return inside
    subprocess.run([python, "-m", "venv", str(home)], check=True)
    pip = [str(inside), "-m", "pip", "--disable-pip-version-check"]
    wanted = {name: bound for name, bound in bounds().items() if name != "tomli" or version == "3.10"}
    named = [f"{name}=={first_with_wheel(pip, name, bound)}" if oldest else name for name, bound in wanted.items()]
    for arguments in (named, ["--no-deps", "-e", str(_ROOT), "-e", str(_AGENTS)]):
        done = subprocess.run([*pip, "install", "--prefer-binary", *arguments], capture_output=True, text=True)
        if done.returncode != 0:
            raise UsageError(f"{home.name}: {' '.join(arguments)} cannot be installed: {done.stderr[-2000:]}")
    (home / "complete").touch()
    return inside


def first_with_wheel(pip: Sequence[str], name: str, bound: str) -> str:
    """Return the oldest version from `bound` on that can be installed with that interpreter without a compiler."""
    told = subprocess.run([*pip, "index", "versions", name], capture_output=True, text=True, check=True).stdout
    known = re.search(r"Available versions: (.*)", told)
    assert known is not None, told
    for version in sorted(found for found in map(Version, known[1].split(", ")) if found >= Version(bound)):
        tried = [*pip, "download", "-q", "--no-deps", "--only-binary", ":all:", f"{name}=={version}"]
        with tempfile.TemporaryDirectory() as nowhere:
            if subprocess.run([*tried, "-d", nowhere], capture_output=True, check=False).returncode == 0:
                return str(version)
    raise UsageError(f"{name} has no wheel for this interpreter from {bound} on")


def versions(given: argparse.Namespace) -> None:
    folder = Path(given.folder or tempfile.mkdtemp(prefix="same-bits-"))
    first = first_drive(given)
    rows = Rows("digests that differ from those of the versions installed here", given.agents.split(","))
    for python in given.versions:
        for oldest in (True, False):
            inside = environment(python, oldest=oldest, folder=folder)
            other = drive_on(PLAIN, python=str(inside), **order_of(given), stored=first.stored)
            rows.add(f"{inside.parents[1].name}", _installed(inside), first, other)
    rows.show()


def _installed(python: Path) -> str:
    code = f"from importlib.metadata import version as v; print(*(n + ' ' + v(n) for n in {PACKAGES!r}), sep=', ')"
    return subprocess.run([str(python), "-c", code], capture_output=True, text=True, check=True).stdout.strip()


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--agents", default=AGENTS)
    parser.add_argument("--routes", default="one-per-scenario")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="drive every N-th of the routes")
    parser.add_argument("--settings", type=int, default=len(SETTINGS), metavar="N", help="the first N settings")
    parser.add_argument("--ticks", type=int, help="end every episode after so many ticks")
    parser.add_argument("--machine", default="", metavar="TEXT", help="only machines with this in their names")
    parser.add_argument("--versions", nargs="+", metavar="PYTHON", help="compare versions, with these interpreters")
    parser.add_argument("--folder", help="where the virtual environments are made, and found again")
    given = parser.parse_args(arguments)
    if given.versions:
        versions(given)
    else:
        machines(given)


if __name__ == "__main__":
    main()
