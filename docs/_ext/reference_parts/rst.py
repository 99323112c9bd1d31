"""Titles, tables and words of ours as reStructuredText."""

from __future__ import annotations

import re
from collections.abc import Iterable

__all__ = ["escaped", "heading", "list_table"]


def heading(text: str, mark: str) -> list[str]:
    """Return a title underlined with `mark`."""
    return [text, mark * len(text)]


def list_table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table of cells that are reStructuredText already."""
    lines = [".. list-table::", "   :header-rows: 1", "   :widths: auto", ""]
    for row in (head, *rows):
        lines += [f"   {'*' if not number else ' '} - {cell}".rstrip() for number, cell in enumerate(row)]
    return "\n".join([*lines, ""])


def escaped(words: str) -> str:
    """Return words of our own for reStructuredText: `code` is code by the default role, stars stay stars.

    Nor does `FILE:id` become a link to an address.
    """
    return re.sub(r"([*|\\]|(?<=FILE):)", r"\\\1", words)
