"""Tables and lines as one text of at most `WIDTH` columns, fewer where a terminal has fewer."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Sequence
from io import StringIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table

WIDTH = 100
_USUAL_SETTING, _LEAST_SETTING = 18, 12
_UNLIMITED = 10_000
_STYLES = {"pass": "green", "inconclusive": "yellow", "fail": "red", "error": "bold red"}


class Page:
    """What is printed on it, as text. `colour` adds terminal escapes; no page is wider than `WIDTH`."""

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

        Long names of agents and settings are folded. Where the table would be too wide still, brackets behind numbers
        go to a line of their own, then settings are folded more; where that is not enough, it is wider than a page: no
        number is cut. It is ruled where colours are shown.
        """
        cells = [tuple(row) for row in rows]
        below = [_brackets_below(row) for row in cells]
        for lines, narrowest in ((cells, _USUAL_SETTING), (below, _USUAL_SETTING), (below, _LEAST_SETTING)):
            narrow = self._table(numbers, lines, agent_width, narrowest, verdicts=verdicts)
            least = self._width_of(narrow)
            if least <= self._width:
                break
        # what is left is the setting's: rich would take it from agents, too, and then cut the last column
        widest = narrowest + max(self._width - least, 0)
        widest = widest if setting_width is None else min(widest, setting_width)
        self._console.width = max(self._width, least)
        self._console.print(self._table(numbers, lines, agent_width, widest, verdicts=verdicts))
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
    ) -> Table:
        from rich import box
        from rich.table import Table
        from rich.text import Text

        heads = ("agent", "setting", *numbers, *(["verdict"] if verdicts else []))
        longest = [
            max(len(line) for text in column for line in text.split("\n")) for column in zip(heads, *rows, strict=True)
        ]
        ruled = box.SIMPLE_HEAD if self._colour else None
        table = Table(box=ruled, pad_edge=False, padding=(0, 1), header_style="bold")
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
        """Return what was printed so far, without blanks at the ends of lines."""
        return "\n".join(line.rstrip() for line in self._stream.getvalue().splitlines())


def _brackets_below(row: Sequence[str]) -> tuple[str, ...]:
    agent, setting, *numbers = row
    return agent, setting, *(number.replace(" (", "\n(") for number in numbers)


def columns_of_screen(*, is_terminal: bool) -> int:
    """Return how wide a text may be: as wide as the terminal, or as a page where the text goes into a file."""
    return shutil.get_terminal_size((WIDTH, 24)).columns if is_terminal else WIDTH


def cut(text: str, width: int = WIDTH) -> str:
    """Return at most the first `width` characters, with dots where some are left out."""
    return text if len(text) <= width else text[: width - 3] + "..."
