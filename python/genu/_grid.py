"""Answers to a grid of trials, as xarray has them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Sequence

from genu._call import names, wanted
from genu._errors import InputError
from genu._types import Frame

if TYPE_CHECKING:
    from xarray import Dataset  # type: ignore[import-not-found,unused-ignore]
else:
    Dataset = Any

# How the name of a column ends, and its unit; the longer first.
_UNITS = {"_mm2": "mm2", "_mpa": "MPa", "_deg": "deg", "_nm": "N m", "_mm": "mm", "_n": "N"}
_BANDS = ("_mean", "_lower", "_upper")


def to_xarray(results: Frame, by: Sequence[str] = ("nominal_flexion_deg", "load_ap_n")) -> Dataset:
    """Turn answers to a grid of trials into a dataset of xarray: a dimension for each column of ``by``.

    Parameters
    ----------
    results : pandas.DataFrame
        What :func:`genu.simulate` answered.
    by : sequence of str
        Columns that together tell the rows apart, such as flexion and load. A place of the grid without a row is NaN.

    Returns
    -------
    xarray.Dataset
        A variable for each other column, with ``attrs["units"]`` where its name has one; intervals stay apart, as ``ap_mm_lower``.
        ``attrs`` has the warnings of the answer.

    Raises
    ------
    ImportError
        xarray is not installed.
    InputError
        A column is not there, or two rows have the same place in the grid.
    """
    wanted("xarray", "grids")
    columns = names(by)
    absent = [column for column in columns if column not in results.columns]
    if absent:
        raise InputError(f"results: no column {', '.join(absent)}", place=("results", None, absent[0]))
    twice = results.duplicated(columns)
    if twice.any():
        row = int(twice.to_numpy().argmax())
        where = ", ".join(f"{column} {results[column].iloc[row]}" for column in columns)
        raise InputError(f"results: two rows have {where}; name more columns in by, or leave rows out", place=("results", row + 2, None))
    grid: Dataset = results.set_index(columns).to_xarray()
    grid.attrs = {"warnings": list(results.attrs.get("warnings", []))}
    for name, variable in grid.variables.items():
        plain = str(name)
        for ending in _BANDS:
            plain = plain.removesuffix(ending)
        unit = next((unit for ending, unit in _UNITS.items() if plain.endswith(ending)), None)
        if unit is not None:
            variable.attrs["units"] = unit
    return grid
