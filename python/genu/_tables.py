"""Tables of FORMAT.md's columns: CSV files, pandas frames."""

from __future__ import annotations

import csv
import os
from typing import Any

from genu._call import Path, wanted
from genu._errors import InputError


def read_table(path: Path) -> Any:
    """Read a CSV table of a build as a pandas frame.

    Parameters
    ----------
    path : str or path-like
        A ``.csv``; its columns carry their units in their names.

    Returns
    -------
    pandas.DataFrame
        An empty cell is NaN: not measured.

    Raises
    ------
    InputError
        No such file.
    """
    pandas = wanted("pandas", "tables")
    path = os.fspath(path)
    if not os.path.isfile(path):
        raise InputError(f"cannot read {path}: no such file")
    return pandas.read_csv(path)


def write_table(table: Any, path: str) -> None:
    """Write rows to CSV: a frame of pandas or polars, a dict of columns, or a list of dicts. NaN, NA and None are empty cells.

    Raises
    ------
    InputError
        Columns of unequal length; a row that is no dict.
    """
    if hasattr(table, "to_csv"):
        _with_index(table).to_csv(path, index=False)
        return
    if hasattr(table, "write_csv"):  # polars
        table.write_csv(path)
        return
    if hasattr(table, "keys"):
        names = list(table.keys())
        columns = [_column(name, table[name]) for name in names]
        lengths = {name: len(column) for name, column in zip(names, columns)}
        if len(set(lengths.values())) > 1:
            longest = max(lengths.values())
            short = ", ".join(f"{name} has {n}" for name, n in lengths.items() if n != longest)
            raise InputError(f"the table's columns are of unequal length: {short}, the others have {longest}")
        rows = [dict(zip(names, values)) for values in zip(*columns)]
    else:
        rows = [_row(row) for row in table]
        names = list(dict.fromkeys(name for row in rows for name in row))
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        for row in rows:
            writer.writerow([_cell(row.get(name)) for name in names])


def _with_index(frame: Any) -> Any:
    """The frame, with a named index as columns: it was one before ``set_index``."""
    names = [name for name in getattr(getattr(frame, "index", None), "names", []) if name is not None]
    return frame.reset_index() if names and not set(names) & set(frame.columns) else frame


def _column(name: Any, values: Any) -> list[Any]:
    if isinstance(values, (str, bytes)) or not hasattr(values, "__iter__"):
        raise InputError(f"the table's column {name} is no list of values")
    return list(values)


def _row(row: Any) -> dict[Any, Any]:
    try:
        return dict(row)
    except (TypeError, ValueError) as error:
        raise InputError("the table's rows are no dicts of column and value") from error


def _cell(value: Any) -> Any:
    if value is None:
        return ""
    try:
        return "" if bool(value != value) else value
    except (TypeError, ValueError):  # pandas.NA answers neither
        return ""


def table_file(table: Any, folder: str, name: str) -> str:
    """The path of a table: as given, or of the rows written to ``folder/name.csv``."""
    if isinstance(table, (str, os.PathLike)):
        return os.path.abspath(os.fspath(table))
    path = os.path.join(folder, f"{name}.csv")
    write_table(table, path)
    return path
