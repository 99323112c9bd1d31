"""Whether episodes are the same bits on other machines, and with other versions of the libraries.

    python benchmarks/same_bits.py                              # every machine that this one can pretend to be
    python benchmarks/same_bits.py --agents expert --every 8 --settings 3
    python benchmarks/same_bits.py --rows OpenBLAS              # only rows with this in their names
    python benchmarks/same_bits.py --agents classical,expert --settings suites --workers 2 --pythons OLD/bin/python

Every row drives everything again in processes of its own, with its libraries told to choose other code, one row after
the other, and tells how many digests differ from those of the first row, for each agent. A digest covers the whole
record but times on the clock. `watcher` is a script with two cameras: its digest is that of every picture, too. `stored
controls` are those that the `network` of the first row gave (an agent whose bits do depend on the machine), driven
again; they are compared with the trajectory of that first drive. What a switch changes is looked at in the same
process, so that one without any effect on this processor is seen.

Each finished episode is kept in `--folder`: interrupt it at any moment and give the same command again. With other code
it refuses to go on in that folder.

`--pythons` are interpreters of virtual environments with other versions, a row each: they drive this checkout, and need
both distributions installed. `--versions` makes such environments in `--folder`: with the oldest versions that the two
`pyproject.toml` allow and with the newest, for each interpreter that is named.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import subprocess
import sys
import tempfile
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from packaging.version import Version
from rich import box
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "helpers"))

from driven_digests import STORED, labels_of
from pretended_machines import MACHINES, OLD, PLAIN, RUNNING, SAME, Driven, Machine, gathered, lines_on

from pytest_drive_robust.errors import UsageError

_ROOT = Path(__file__).parent.parent
_AGENTS = _ROOT / "agents"

AGENTS = "watcher,constant,random,reactive,classical,expert,network"
STACKS = (
    "3 s burst frame drop and occlusion 0.5 and GPS noise 5 m and speed noise 0.5 and 200 ms latency",
    "1 s burst frame drop and occlusion 0.8 and GPS noise 15 m and speed noise 0.2 and 500 ms latency",
)
SUITES = (
    "clean",
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
"""The twelve of `suites/paper`."""
SETTINGS = ("clean", *STACKS, *SUITES[1:])
MACHINE_DEPENDENT = "network"
"""The agent whose bits depend on the machine; its stored controls are driven again on every other machine."""
PACKAGES = ("numpy", "numba", "scipy", "opencv-python-headless", "highway-env", "gymnasium")


@dataclass(frozen=True)
class Row:
    """A row of the table: a machine, or an interpreter with other versions."""

    machine: Machine
    python: str = sys.executable
    versions: str = ""

    @property
    def name(self) -> str:
        return self.versions or self.machine.name


class Drives:
    """The finished drives, one file of JSON lines for each row, in a folder for one version of the code."""

    def __init__(self, folder: Path, *, ticks: int | None) -> None:
        self._folder = folder
        self._lock = threading.Lock()
        folder.mkdir(parents=True, exist_ok=True)
        facts, told = {"code": code_of_checkout(), "ticks": ticks}, folder / "driven-with.json"
        if not told.exists():
            told.write_text(json.dumps(facts))
        if json.loads(told.read_text()) != facts:
            raise SystemExit(
                f"{folder} holds episodes of other code or other --ticks: remove it, or give another --folder."
            )

    def lines(self, row: Row) -> list[dict[str, Any]]:
        """Return the finished drives of a row, without a line that was not written whole."""
        file = self._file(row)
        lines = file.read_text().splitlines() if file.exists() else []
        return [read for line in lines if (read := _whole(line)) is not None]

    def add(self, row: Row, line: dict[str, Any]) -> None:
        """Append a line, with a newline before it, so that an unfinished line before it does no harm."""
        with self._lock, self._file(row).open("a") as file:
            file.write("\n" + json.dumps(line))

    def _file(self, row: Row) -> Path:
        name = re.sub(r"[^a-z0-9.]+", "-", row.name.lower())[:60].strip("-")
        return self._folder / f"{name}-{hashlib.blake2b(row.name.encode(), digest_size=4).hexdigest()}.jsonl"


def _whole(line: str) -> dict[str, Any] | None:
    try:
        read: dict[str, Any] = json.loads(line)
    except ValueError:
        return None
    return read


def code_of_checkout() -> str:
    """Return a digest of all code that drives."""
    digest = hashlib.blake2b(digest_size=8)
    for folder in (_ROOT / "pytest_drive_robust", _AGENTS / "drive_robust_agents", _ROOT / "tests" / "helpers"):
        for path in sorted(folder.rglob("*.py")):
            digest.update(path.relative_to(_ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def drive_row(
    row: Row, order: dict[str, Any], drives: Drives, *, workers: int, advance: Callable[[], object]
) -> Driven:
    """Drive the missing drives of a row in `workers` processes. Raises `RuntimeError` when a process fails."""
    wanted = labels_of(order)
    known = drives.lines(row)
    done = {line["label"] for line in known if "label" in line}
    left = [label for label in wanted if label not in done]
    for _ in range(len(wanted) - len(left)):
        advance()

    def drive(labels: list[str]) -> None:
        for line in lines_on(row.machine, {**order, "labels": labels}, row.python):
            drives.add(row, line)
            if "label" in line:
                advance()

    shares = [share for k in range(workers) if (share := left[k::workers])]
    if not shares and not any("libraries" in line for line in known):
        shares = [[]]
    pool = ThreadPoolExecutor(max(len(shares), 1))
    try:
        for driving in [pool.submit(drive, share) for share in shares]:
            driving.result()
    finally:
        for process in list(RUNNING):
            process.kill()
        pool.shutdown()
    lines = drives.lines(row)
    return gathered(line for line in lines if line.get("label") in (None, *wanted))


def order_of(given: argparse.Namespace) -> dict[str, Any]:
    return {
        "agents": given.agents.split(","),
        "routes": given.routes,
        "settings": SUITES if given.settings == "suites" else SETTINGS[: int(given.settings)],
        "every": given.every,
        "ticks": given.ticks,
    }


def counted(first: Driven, other: Driven) -> tuple[Counter[str], Counter[str], float]:
    """Return (digests compared, digests that differ, largest change of a score) by agent."""
    expected = {**first.digests, **{f"{STORED}{label}": SAME for label in first.stored}}
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
    """The table, printed row by row, because driving takes long."""

    def __init__(self, agents: Iterable[str], console: Console) -> None:
        agents = list(agents)
        self._columns = agents + [f"{STORED}{name}" for name in agents if name == MACHINE_DEPENDENT]
        heads = (f"differ: {name}" for name in self._columns)
        self._table = Table("row", "computes otherwise", *heads, "score by", box=box.MARKDOWN)
        self._console = console

    def add(self, name: str, changes: str, first: Driven, other: Driven) -> None:
        compared, differ, moved = counted(first, other)
        cells = [f"{differ[agent]} of {compared[agent]}" if compared[agent] else "-" for agent in self._columns]
        self._table.add_row(name, changes, *cells, f"{moved:.2f}")
        self._console.print(f"{name} [{changes}]: {' | '.join(cells)}", highlight=False, markup=False)

    def show(self, file: Path) -> None:
        self._console.print(self._table)
        with file.open("w") as out:
            Console(file=out, width=300).print(self._table)


def compare_rows(given: argparse.Namespace) -> None:
    folder = Path(given.folder)
    rows, order = rows_of(given), order_of(given)
    drives = Drives(folder, ticks=given.ticks)
    console = Console(width=None if sys.stdout.isatty() else 150)
    table = Rows(order["agents"], console)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, TimeRemainingColumn(elapsed_when_finished=True), console=console) as progress:
        of_stored = len(labels_of({**order, "agents": [a for a in order["agents"] if a == MACHINE_DEPENDENT]}))
        bar = progress.add_task("", total=len(rows) * len(labels_of(order)) + (len(rows) - 1) * of_stored)

        def drive(row: Row, **more: Any) -> Driven:
            progress.update(bar, description=row.name[:40])
            advance = lambda: progress.advance(bar)  # noqa: E731
            return drive_row(row, {**order, **more}, drives, workers=given.workers, advance=advance)

        first = drive(rows[0], keep=[MACHINE_DEPENDENT])
        for row in rows[1:]:
            try:
                other = drive(row, stored=first.stored)
            except RuntimeError as error:  # e.g. code for another processor
                progress.console.print(str(error), markup=False, highlight=False)
                continue
            changed = ", ".join(other.changed(first)) or "nothing here"
            table.add(row.name, changed, first, other)
    table.show(folder / "table.md")


def rows_of(given: argparse.Namespace) -> list[Row]:
    """Return the first row, the reference of all comparisons, and the rows that were asked for by name."""
    pythons = [str(Path(python)) for python in given.pythons]
    for python in given.versions:
        pythons += [str(environment(python, oldest=oldest, folder=Path(given.folder))) for oldest in (True, False)]
    rows = [Row(machine) for machine in (*MACHINES, OLD)]
    rows += [Row(PLAIN, python, installed_in(python)) for python in pythons]
    return [Row(PLAIN), *(row for row in rows if any(text in row.name for text in given.rows))]


# --- versions ---


def bounds() -> dict[str, str]:
    """Return the lowest allowed version of each requirement of the two distributions and of their tests."""
    found: dict[str, str] = {}
    for file in (_ROOT / "pyproject.toml", _AGENTS / "pyproject.toml"):
        text = file.read_text(encoding="utf-8")
        for block in re.findall(r"^dependencies = \[(.*?)\]", text, re.DOTALL | re.MULTILINE):
            found.update(re.findall(r'"([A-Za-z0-9_.-]+)>=([0-9.]+)', block))
    return found


def environment(python: str, *, oldest: bool, folder: Path) -> Path:
    """Return the interpreter of a virtual environment, which is created if missing."""
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


def installed_in(python: str) -> str:
    """Return the versions of an interpreter and of its computing libraries, as the name of a row."""
    code = (
        "import sys; from importlib.metadata import version as v; "
        f"print('Python %d.%d' % sys.version_info[:2], *(n + ' ' + v(n) for n in {PACKAGES!r}), sep=', ')"
    )
    return subprocess.run([python, "-c", code], capture_output=True, text=True, check=True).stdout.strip()


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--agents", default=AGENTS)
    parser.add_argument("--routes", default="one-per-scenario")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="drive every N-th of the routes")
    parser.add_argument("--settings", default=str(len(SETTINGS)), help="the first N, or `suites`: the twelve there")
    parser.add_argument("--ticks", type=int, help="end every episode after so many ticks")
    parser.add_argument(
        "--rows", nargs="+", default=[""], metavar="TEXT", help="only rows with any of these in their names"
    )
    parser.add_argument("--pythons", nargs="+", default=[], metavar="PYTHON", help="environments with other versions")
    parser.add_argument("--versions", nargs="+", default=[], metavar="PYTHON", help="make such environments with these")
    parser.add_argument("--workers", type=int, default=1, metavar="N", help="processes that drive at once")
    parser.add_argument("--folder", default=".drive-robust/same-bits", help="where finished episodes are kept")
    given = parser.parse_args(arguments)
    try:
        compare_rows(given)
    except KeyboardInterrupt:
        raise SystemExit(f"interrupted: the same command goes on with what {given.folder} holds") from None


if __name__ == "__main__":
    main()
