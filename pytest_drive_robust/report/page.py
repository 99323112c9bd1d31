"""Tables and lines as one text of at most `WIDTH` columns."""

from __future__ import annotations

from io import StringIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table

WIDTH = 100


class Page:
    """What is printed on it, as text. `colour` adds terminal escapes."""

    def __init__(self, *, colour: bool) -> None:
        from rich.console import Console

        self._stream = StringIO()
        self._console = Console(
            file=self._stream, width=WIDTH, highlight=False, markup=False, force_terminal=colour, no_color=not colour
        )

    def print(self, thing: Table | str, *, wraps: bool = True) -> None:
        """Add a table or a line; with `wraps=False` the line stays one, however long: it is there to be copied."""
        self._console.print(thing, soft_wrap=not wraps)

    @property
    def text(self) -> str:
        """All of it, without blanks at the ends of lines."""
        return "\n".join(line.rstrip() for line in self._stream.getvalue().splitlines())


def new_table(*, colour: bool) -> Table:
    """Return a table without columns; it is ruled where colours are shown."""
    from rich import box
    from rich.table import Table

    return Table(box=box.SIMPLE_HEAD if colour else None, pad_edge=False, padding=(0, 1), header_style="bold")
