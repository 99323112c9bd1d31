"""Lays out tables and lines as one text of at most `WIDTH` columns, fewer on a narrow terminal."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Sequence
from io import StringIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table

WIDTH = 100
_USUAL_SETTING, _SHORT_SETTING, _LEAST_SETTING = 18, 12, 9
_UNLIMITED = 10_000
_STYLES = {"pass": "green", "inconclusive": "yellow", "fail": "red", "error": "bold red"}


class Page:
    """Collects printed lines and tables as text. `colour` adds terminal escapes; lines wrap at `WIDTH` or earlier."""

    def __init__(self, *, colour: bool, width: int = WIDTH) -> None:
        from rich.console import Console

        self._colour = colour
        self._width = min(width, WIDTH)
        self._stream = StringIO()
        self._console = Console(
            file=self._stream,
            width=self._width,
            highlight=False,
            markup=False,
            emoji=False,  # a message holds file:100:line as it is
            force_terminal=colour,
            no_color=not colour,
        )

    def print(self, line: str, *, wraps: bool = True) -> None:
        """Add a line; with `wraps=False` the line is never wrapped, so that people can copy it."""
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
        """Add a table of agents and settings with columns of `numbers` and, with `verdicts`, a coloured verdict column.

        Long names of agents and settings are folded. If the table is still too wide, brackets behind numbers go to a
        line of their own, then settings are folded more, then columns stand closer. If that is not enough, the table is
        wider than the page, because no number is cut. The table has rules when colours are shown.
        """
        cells = [tuple(row) for row in rows]
        below = [_brackets_below(row) for row in cells]
        for lines, narrowest, close in (
            (cells, _USUAL_SETTING, False),
            (below, _USUAL_SETTING, False),
            (below, _SHORT_SETTING, False),
            (below, _LEAST_SETTING, True),
        ):
            narrow = self._table(numbers, lines, agent_width, narrowest, verdicts=verdicts, close=close)
            least = self._width_of(narrow)
            if least <= self._width:
                break
        # The setting column gets the width left over: rich would also shrink agents and then cut the last column.
        widest = narrowest + max(self._width - least, 0)
        widest = widest if setting_width is None else min(widest, setting_width)
        self._console.width = max(self._width, least)
        self._console.print(self._table(numbers, lines, agent_width, widest, verdicts=verdicts, close=close))
        self._console.width = self._width

    def _width_of(self, table: Table) -> int:
        from rich.measure import Measurement

        return Measurement.get(self._console, self._console.options.update(max_width=_UNLIMITED), table).minimum

    def _table(
        self,
        numbers: Sequence[str],
        rows: Sequence[Sequence[str]],
        agent_width: int,
        setting_width: int,
        *,
        verdicts: bool,
        close: bool,
    ) -> Table:
        from rich import box
        from rich.table import Table
        from rich.text import Text

        heads = ("agent", "setting", *numbers, *(["verdict"] if verdicts else []))
        longest = [
            max(len(line) for text in column for line in text.split("\n")) for column in zip(heads, *rows, strict=True)
        ]
        ruled = box.SIMPLE_HEAD if self._colour else None
        padding = (0, 0 if self._colour else 1, 0, 0) if close else (0, 1)  # rules bring a blank of their own
        table = Table(box=ruled, pad_edge=False, show_edge=not close, padding=padding, header_style="bold")
        for name, width in (("agent", min(longest[0], agent_width)), ("setting", min(longest[1], setting_width))):
            table.add_column(name, min_width=width, max_width=width, overflow="fold")
        for name, width in zip(numbers, longest[2:], strict=False):
            table.add_column(name, justify="right", no_wrap=True, min_width=width)
        if verdicts:
            table.add_column("verdict", no_wrap=True, min_width=longest[-1])
        for *cells, last in rows:
            table.add_row(*cells, Text(last, style=_STYLES.get(last, "")))
        return table

    @property
    def text(self) -> str:
        """The text printed so far, without blanks at the ends of lines."""
        return "\n".join(line.rstrip() for line in self._stream.getvalue().splitlines())


def _brackets_below(row: Sequence[str]) -> tuple[str, ...]:
    agent, setting, *numbers = row
    return agent, setting, *(number.replace(" (", "\n(") for number in numbers)


def columns_of_screen(*, is_terminal: bool) -> int:
    """Return the columns for a text: the width of the terminal, or `WIDTH` if the text goes into a file."""
    return shutil.get_terminal_size((WIDTH, 24)).columns if is_terminal else WIDTH


def cut(text: str, width: int = WIDTH) -> str:
    """Return `text`, cut to `width` characters with three dots at the end if it is longer."""
    return text if len(text) <= width else text[: width - 3] + "..."
