"""Writes the tables of a run as Parquet or CSV files, in pieces, because a run may hold millions of ticks."""

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
    """Write one CSV file per table and yield its path; an empty table has only the column names."""
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
    """Write one Parquet file per table and yield its path; NaN becomes null. Raises `UsageError` without pyarrow."""
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
    """Yield the ticks table in one or more pieces of `_EPISODES_AT_ONCE` episodes, every other table in one piece."""
    if table != "ticks":
        yield columns_of(run, table)
        return
    for first in range(0, max(1, len(run.episodes)), _EPISODES_AT_ONCE):
        yield columns_of(replace(run, episodes=run.episodes[first : first + _EPISODES_AT_ONCE]), table)


def _plain(values: Any) -> list[Any]:
    """Return the values as Python numbers, which CSV prints shortest; None, an empty cell, for NaN."""
    return [None if value != value else value for value in getattr(values, "tolist", lambda: values)()]
