"""The tables of a run as files, Parquet or CSV: a run may hold millions of ticks, so they are written bit by bit."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pytest_drive_robust.results.extras import require
from pytest_drive_robust.results.tables import TABLES, Columns, columns_of
from pytest_drive_robust.store.whole_file import whole_file

if TYPE_CHECKING:
    from pytest_drive_robust.results.run import Run

_EPISODES_AT_ONCE = 100
_WORDS = ("key", "agent", "setting", "route_id")


def write_csv_tables(run: Run, folder: Path) -> Iterator[Path]:
    """Write each table, of one that holds nothing only the names of its columns; yield the files."""
    for table in TABLES:
        path = folder / f"{table}.csv"
        with whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            for number, columns in enumerate(_pieces(run, table)):
                if number == 0:
                    writer.writerow(columns)
                lists = (_plain(values) for values in columns.values())
                writer.writerows(zip(*lists, strict=True))
        yield path


def write_parquet_tables(run: Run, folder: Path) -> Iterator[Path]:
    """As `write_csv_tables`; numbers that are none are nulls."""
    arrow: Any = require("pyarrow", "parquet")
    parquet: Any = require("pyarrow.parquet", "parquet")
    for table in TABLES:
        path = folder / f"{table}.parquet"
        with whole_file(path) as temporary:
            writer = None
            try:
                for columns in _pieces(run, table):
                    arrays = {name: arrow.array(values, from_pandas=True) for name, values in columns.items()}
                    if table == "ticks":
                        arrays |= {name: arrays[name].cast(arrow.string()).dictionary_encode() for name in _WORDS}
                    piece = arrow.table(arrays)
                    writer = writer or parquet.ParquetWriter(temporary, piece.schema, compression="zstd")
                    writer.write_table(piece)
            finally:
                if writer is not None:
                    writer.close()
        yield path


def _pieces(run: Run, table: str) -> Iterator[Columns]:
    """Yield a table in pieces of some episodes; the small ones, and one without any, in one piece."""
    if table != "ticks":
        yield columns_of(run, table)
        return
    for first in range(0, max(1, len(run.episodes)), _EPISODES_AT_ONCE):
        yield columns_of(replace(run, episodes=run.episodes[first : first + _EPISODES_AT_ONCE]), table)


def _plain(values: Any) -> list[Any]:
    """Return Python numbers, which are written shortest; None for NaN, which is written as nothing."""
    return [None if value != value else value for value in getattr(values, "tolist", lambda: values)()]
