"""Tables of FORMAT.md's columns: CSV files, pandas frames."""

from __future__ import annotations

import csv
import io
import os
from typing import Any

from genu._call import Files, wanted
from genu._errors import InputError, in_file
from genu._types import Frame, Path, Table


def read_table(path: Path) -> Frame:
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
        raise InputError(f"cannot read {path}: no such file", place=in_file(path))
    frame: Frame = pandas.read_csv(path)
    return frame


def table_text(table: Any) -> str:
    """Rows as CSV: a frame of pandas or polars, a dict of columns, a structured array, or a list of dicts. NaN, NA and None are empty cells.

    Raises
    ------
    InputError
        Columns of unequal length, or with rows of other names or in another order; a row that is no dict.
    """
    if hasattr(table, "collect") and not hasattr(table, "write_csv"):  # a lazy frame of polars
        table = table.collect()
    if hasattr(table, "to_csv"):
        return str(_with_index(table).to_csv(index=False))
    if hasattr(table, "write_csv"):  # polars
        return str(table.write_csv())
    fields = getattr(getattr(table, "dtype", None), "names", None)
    if fields:  # a structured array
        table = {name: table[name] for name in fields}
    if hasattr(table, "keys"):
        names = list(table.keys())
        columns = [_column(name, table[name]) for name in names]
        lengths = {name: len(column) for name, column in zip(names, columns)}
        if len(set(lengths.values())) > 1:
            longest = max(lengths.values())
            short = ", ".join(f"{name} has {n}" for name, n in lengths.items() if n != longest)
            raise InputError(f"the table's columns are of unequal length: {short}, the others have {longest}")
        _same_rows({name: table[name] for name in names})
        rows = [dict(zip(names, values)) for values in zip(*columns)]
    else:
        rows = [_row(row) for row in table]
        names = list(dict.fromkeys(name for row in rows for name in row))
    file = io.StringIO(newline="")
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(names)
    for row in rows:
        writer.writerow([_cell(row.get(name)) for name in names])
    return file.getvalue()


def _with_index(frame: Any) -> Any:
    """The frame, with a named index as columns: it was one before ``set_index``."""
    names = [name for name in getattr(getattr(frame, "index", None), "names", []) if name is not None]
    return frame.reset_index() if names and not set(names) & set(frame.columns) else frame


def _same_rows(columns: dict[Any, Any]) -> None:
    """Refuses series whose indexes differ: taken as they stand, their rows would not belong together."""
    indexed = [(name, list(column.index)) for name, column in columns.items() if hasattr(column, "iloc")]
    for name, index in indexed[1:]:
        first, own = indexed[0]
        if index != own:
            raise InputError(
                f"the table's columns {first} and {name} have different indexes, so that their rows do not belong together; "
                "give one frame, or columns without an index (to_list)"
            )


def _column(name: Any, values: Any) -> list[Any]:
    if isinstance(values, (str, bytes)) or not hasattr(values, "__iter__"):
        raise InputError(f"the table's column {name} is no list of values")
    return list(values)


def _row(row: Any) -> dict[Any, Any]:
    try:
        return dict(row)
    except (TypeError, ValueError) as error:
        raise InputError("the table's rows are no dicts of column and value; give a frame, a dict of columns, or a list of such dicts") from error


def _cell(value: Any) -> Any:
    # numpy's value of a masked cell is neither None nor NaN, and its text is --
    if value is None or type(value).__name__ == "MaskedConstant":
        return ""
    try:
        return "" if bool(value != value) else value
    except (TypeError, ValueError):  # pandas.NA answers neither
        return ""


def table_at(table: Table, name: str, files: Files) -> str:
    """The path at which the program finds a table: as given, or ``name``, whose text goes into ``files``."""
    if isinstance(table, (str, os.PathLike)):
        return os.path.abspath(os.fspath(table))
    files[name] = table_text(table).encode()
    return name


def frame_of(text: str) -> Frame:
    """The text of a CSV file as a pandas frame."""
    frame: Frame = wanted("pandas", "tables").read_csv(io.StringIO(text))
    return frame
