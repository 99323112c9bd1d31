"""Tables and lines as one text of at most `WIDTH` columns."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from io import StringIO

WIDTH = 100
_STYLES = {"pass": "green", "inconclusive": "yellow", "fail": "red", "error": "bold red"}


class Page:
    """What is printed on it, as text. `colour` adds terminal escapes."""

    def __init__(self, *, colour: bool) -> None:
        from rich.console import Console

        self._colour = colour
        self._stream = StringIO()
        self._console = Console(
            file=self._stream, width=WIDTH, highlight=False, markup=False, force_terminal=colour, no_color=not colour
        )

    def print(self, line: str, *, wraps: bool = True) -> None:
        """Add a line; with `wraps=False` it stays one, however long: it is there to be copied."""
        self._console.print(line, soft_wrap=not wraps)

    def table(
        self,
        numbers: Sequence[str],
        rows: Iterable[Sequence[str]],
        *,
        agent_width: int = 18,
        setting_width: int | None = None,
        verdicts: bool = True,
    ) -> None:
        """Add a table of agents and settings with columns of `numbers` and perhaps of verdicts, which have colours.

        It is ruled where colours are shown.
        """
        from rich import box
        from rich.table import Table
        from rich.text import Text

        ruled = box.SIMPLE_HEAD if self._colour else None
        table = Table(box=ruled, pad_edge=False, padding=(0, 1), header_style="bold")
        table.add_column("agent", max_width=agent_width, no_wrap=True, overflow="ellipsis")
        table.add_column("setting", max_width=setting_width, overflow="fold")
        for name in numbers:
            table.add_column(name, justify="right", no_wrap=True)
        if verdicts:
            table.add_column("verdict", no_wrap=True, min_width=7)
        for *cells, last in rows:
            table.add_row(*cells, Text(last, style=_STYLES.get(last, "")))
        self._console.print(table)

    @property
    def text(self) -> str:
        """All of it, without blanks at the ends of lines."""
        return "\n".join(line.rstrip() for line in self._stream.getvalue().splitlines())


def cut(text: str, width: int = WIDTH) -> str:
    """Return at most the first `width` characters, with dots where some are left out."""
    return text if len(text) <= width else text[: width - 3] + "..."
