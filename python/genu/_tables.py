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
    """Write rows to CSV: a pandas frame, a dict of columns, or a list of dicts. NaN and None are empty cells."""
    if hasattr(table, "to_csv"):
        table.to_csv(path, index=False)
        return
    if hasattr(table, "keys"):
        names = list(table.keys())
        rows = [dict(zip(names, values)) for values in zip(*(table[name] for name in names))]
    else:
        rows = [dict(row) for row in table]
        names = list(dict.fromkeys(name for row in rows for name in row))
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        for row in rows:
            writer.writerow([_cell(row.get(name)) for name in names])


def _cell(value: Any) -> Any:
    return "" if value is None or value != value else value


def table_file(table: Any, folder: str, name: str) -> str:
    """The path of a table: as given, or of the rows written to ``folder/name.csv``."""
    if isinstance(table, (str, os.PathLike)):
        return os.path.abspath(os.fspath(table))
    path = os.path.join(folder, f"{name}.csv")
    write_table(table, path)
    return path
