"""Tables of LeRobot's formats as Parquet files."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from ligature.datasets.lerobot.features import Column

_TYPES = {
    "float32": pa.float32(),
    "float64": pa.float64(),
    "int64": pa.int64(),
    "bool": pa.bool_(),
    "string": pa.string(),
}


def table_of(columns: Sequence[Column], counters: Mapping[str, NDArray[Any]]) -> pa.Table:
    """A row for each sample: vectors as lists of fixed length, single numbers as they are, then ``counters``."""
    arrays, fields = [], []
    for column in columns:
        kind = _TYPES[column.dtype]
        flat = column.values.reshape(-1)
        values = pa.array(flat.tolist() if column.dtype == "string" else flat.astype(column.dtype), kind)
        width = column.values.shape[1]
        if width > 1:
            values, kind = pa.FixedSizeListArray.from_arrays(values, width), pa.list_(kind, width)
        arrays.append(values)
        fields.append(pa.field(column.name, kind))
    for name, numbers in counters.items():
        arrays.append(pa.array(numbers))
        fields.append(pa.field(name, arrays[-1].type))
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields))


class GrowingTables:
    """Parquet files of many episodes: ``place(number)`` is the path of a file, ``limit`` its most bytes.

    An episode is a row group of its own.
    """

    def __init__(self, place: Any, limit: int) -> None:
        self._place, self._limit = place, limit
        self._writer: pq.ParquetWriter | None = None
        self.file, self._bytes = 0, 0

    def add(self, table: pa.Table) -> int:
        """Add an episode; returns the number of the file that it is in."""
        if self._writer is not None and self._bytes + table.nbytes > self._limit:
            self.close()
            self.file += 1
        if self._writer is None:
            path = self._place(self.file)
            path.parent.mkdir(parents=True, exist_ok=True)
            self._writer, self._bytes = pq.ParquetWriter(path, table.schema, compression="snappy"), 0
        self._writer.write_table(table)
        self._bytes += table.nbytes
        return self.file

    def close(self) -> None:
        """Finish the file that is open."""
        if self._writer is not None:
            self._writer.close()
            self._writer = None


def write_tasks(path: Path, tasks: Sequence[str]) -> None:
    """The table of tasks, whose index in pandas is the text: LeRobot looks tasks up by it."""
    schema = pa.schema([pa.field("task_index", pa.int64()), pa.field("task", pa.string())])
    kinds = {"task_index": ("int64", "int64"), "task": ("unicode", "object")}
    described = [
        {"name": name, "field_name": name, "pandas_type": pandas, "numpy_type": numpy, "metadata": None}
        for name, (pandas, numpy) in kinds.items()
    ]
    index = {"name": None, "field_name": None, "pandas_type": "unicode", "numpy_type": "object", "metadata": None}
    notes = {
        "index_columns": ["task"], "column_indexes": [index], "columns": described,
        "creator": {"library": "pyarrow", "version": pa.__version__}, "pandas_version": "2.2.0",
    }  # fmt: skip
    table = pa.table([pa.array(np.arange(len(tasks))), pa.array(list(tasks), pa.string())], schema=schema)
    pq.write_table(table.replace_schema_metadata({"pandas": json.dumps(notes)}), path)


def write_rows(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Rows with equal keys as a Parquet file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.Table.from_pylist([dict(row) for row in rows]), path)


def write_lines(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Rows as lines of JSON."""
    path.write_text("".join(f"{json_of(row)}\n" for row in rows), encoding="utf-8")


def json_of(value: Any, indent: int | None = None) -> str:
    """JSON, which has no infinite numbers: ValueError for those, and for what is none."""
    return json.dumps(value, indent=indent, allow_nan=False)
