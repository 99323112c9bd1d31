"""Tables and lines that commands print."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import Literal

from rich.console import Console
from rich.table import Table

from pytest_drive_robust.report.page import columns_of_screen

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
    Console(width=columns_of_screen(is_terminal=sys.stdout.isatty()), markup=False, highlight=False).print(table)


def say(text: str) -> None:
    """Print a line at once. A closed pipe is no error, because the files that the command writes are still wanted."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
