"""Tables and lines that commands print."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import Literal

from rich.console import Console
from rich.table import Table

from pytest_drive_robust.report.page import WIDTH

Justify = Literal["left", "right"]
LEFT: Justify = "left"
RIGHT: Justify = "right"


def print_table(columns: Mapping[str, Justify], rows: Iterable[Sequence[str]], *, title: str | None = None) -> None:
    """Print rows under the names of their columns, as wide as the terminal."""
    gap = 2 if len(columns) < 5 else 1
    table = Table(title=title, title_justify="left", box=None, padding=(0, gap, 0, 0))
    for column, justify in columns.items():
        table.add_column(column, justify=justify, overflow="fold")
    for row in rows:
        table.add_row(*row)
    Console(width=columns_of_screen(), markup=False, highlight=False).print(table)


def columns_of_screen() -> int:
    """Return how many columns there are: those of the terminal, or of a page where the output is none."""
    return shutil.get_terminal_size((WIDTH, 24)).columns if sys.stdout.isatty() else WIDTH


def say(text: str) -> None:
    """Print what any terminal can show: results may hold any character. A reader that stops early is no error."""
    encoding = sys.stdout.encoding or "utf-8"
    try:
        print(text.encode(encoding, "backslashreplace").decode(encoding), flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
