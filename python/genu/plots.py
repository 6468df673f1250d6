"""Pictures of what models answer: laxity curves, forces of ligaments.

Each function draws into the axes it is given, or into new ones, and gives them back. It needs matplotlib:
``pip install "./python[plots]"`` in a clone.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Literal, Optional, Sequence, Union

from genu._call import names, wanted
from genu._errors import InputError, UsageError
from genu._tables import read_table
from genu._types import Frame, Path

if TYPE_CHECKING:
    from matplotlib.axes import Axes
else:
    Axes = Any

__all__ = ["laxity", "forces"]

Coordinate = Literal["ap_mm", "ie_deg", "vv_deg"]

# By coordinate: its load, the tests in which that load acts, and how both are called.
_OF = {
    "ap_mm": ("load_ap_n", ("anterior", "posterior"), "anterior position of the tibia [mm]", "anterior force [N]"),
    "ie_deg": ("load_ie_nm", ("internal", "external"), "external rotation [deg]", "external moment [N m]"),
    "vv_deg": ("load_vv_nm", ("varus", "valgus"), "valgus rotation [deg]", "valgus moment [N m]"),
}


def laxity(
    predicted: Frame,
    measured: Union[None, Frame, Path] = None,
    coordinate: Coordinate = "ap_mm",
    *,
    flexions_deg: Optional[Sequence[float]] = None,
    ax: Optional[Axes] = None,
) -> Axes:
    """Draw load over position: a curve a flexion, with its 90 % interval, and the measured points beside it.

    Parameters
    ----------
    predicted : pandas.DataFrame
        What :func:`genu.simulate` answered to trials. Where it has ``ap_mm_lower`` and ``ap_mm_upper`` (a calibrated
        model), a band stands between them. For the frames of a data set, simulate with ``read_as``.
    measured : pandas.DataFrame, str or path-like, optional
        The measured trials, or their file, with the same columns of loads and poses.
    coordinate : str
        ``"ap_mm"`` (drawers), ``"ie_deg"`` (internal and external rotation) or ``"vv_deg"`` (varus and valgus).
    flexions_deg : sequence of float, optional
        Nominal flexions to draw; all where None.
    ax : matplotlib.axes.Axes, optional
        Where to draw; new axes where None.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ImportError
        matplotlib is not installed.
    InputError
        A column is not there, or no trial is left to draw.
    UsageError
        An unknown coordinate.
    """
    if coordinate not in _OF:
        raise UsageError(f"coordinate {coordinate!r} is not known; expected one of {', '.join(_OF)}")
    load, _, position, force = _OF[coordinate]
    curves = _by_flexion(predicted, "predicted", coordinate, flexions_deg)
    if isinstance(measured, (str, os.PathLike)):
        measured = read_table(measured)
    points = _by_flexion(measured, "measured", coordinate, flexions_deg) if measured is not None else {}
    ax = _axes(ax)
    for flexion, rows in curves.items():
        (line,) = ax.plot(rows[coordinate], rows[load], label=f"{flexion:g} deg")
        lower, upper = f"{coordinate}_lower", f"{coordinate}_upper"
        if {lower, upper} <= set(rows.columns):
            ax.fill_betweenx(rows[load], rows[lower], rows[upper], color=line.get_color(), alpha=0.2, linewidth=0)
        if flexion in points:
            ax.plot(points[flexion][coordinate], points[flexion][load], "o", markersize=4, color=line.get_color())
    for flexion in points.keys() - curves.keys():
        ax.plot(points[flexion][coordinate], points[flexion][load], "o", markersize=4, label=f"{flexion:g} deg, measured")
    ax.set(xlabel=position, ylabel=force, title="Measured (points) and predicted" if points else "Predicted")
    ax.legend(title="flexion", fontsize=8)
    return ax


def forces(results: Frame, ligaments: Union[None, str, Sequence[str]] = None, *, ax: Optional[Axes] = None) -> Axes:
    """Draw the forces of ligaments over flexion, each with its 90 % interval where the results have one.

    Parameters
    ----------
    results : pandas.DataFrame
        What :func:`genu.simulate` answered, such as to ``protocol="passive-flexion"``.
    ligaments : str or sequence of str, optional
        Ligaments or bundles, such as ``["ACL", "LCL"]``; where None all ligaments, those of several bundles as their sum.
    ax : matplotlib.axes.Axes, optional
        Where to draw; new axes where None.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ImportError
        matplotlib is not installed.
    InputError
        The results have no such ligament, or no flexion.
    """
    _need(results, "results", ["fe_deg"])
    wished = _ligaments(results) if ligaments is None else names(ligaments)
    columns = {name: _column(results, name) for name in wished}
    ax = _axes(ax)
    rows = results.sort_values("fe_deg", kind="stable")
    for name, column in columns.items():
        (line,) = ax.plot(rows["fe_deg"], rows[column], label=name)
        lower, upper = f"{column}_lower", f"{column}_upper"
        if {lower, upper} <= set(rows.columns):
            ax.fill_between(rows["fe_deg"], rows[lower], rows[upper], color=line.get_color(), alpha=0.2, linewidth=0)
    ax.set(xlabel="flexion [deg]", ylabel="force [N]", title="Forces of ligaments")
    ax.legend(fontsize=8)
    return ax


def _axes(ax: Optional[Axes]) -> Axes:
    if ax is not None:
        return ax
    made: Axes = wanted("matplotlib.pyplot", "plots").subplots(layout="constrained")[1]
    return made


def _need(frame: Frame, name: str, columns: Sequence[str]) -> None:
    absent = [column for column in columns if column not in frame.columns]
    if absent:
        raise InputError(f"{name}: no column {', '.join(absent)}; expected a frame as genu.simulate gives it", place=(name, None, absent[0]))


def _by_flexion(frame: Frame, name: str, coordinate: str, flexions_deg: Optional[Sequence[float]]) -> dict[float, Frame]:
    """The rows of the coordinate's own tests by nominal flexion, in the order of the load."""
    load, tests, _, _ = _OF[coordinate]
    _need(frame, name, [load, coordinate, "test", "nominal_flexion_deg"])
    own: Frame = frame[frame["test"].isin([*tests, "neutral"]) & frame[coordinate].notna()]
    if flexions_deg is not None:
        own = own[own["nominal_flexion_deg"].isin(list(flexions_deg))]
    if not own["test"].isin(tests).any():
        raise InputError(f"{name}: no trial of {' or '.join(tests)} at the flexions that were asked for; nothing to draw")
    flexions = [float(flexion) for flexion in sorted(own["nominal_flexion_deg"].unique())]
    return {flexion: own[own["nominal_flexion_deg"] == flexion].sort_values(load, kind="stable") for flexion in flexions}


def _ligaments(results: Frame) -> list[str]:
    """Ligaments by their sums, and the bundles that belong to none."""
    sums = [c.removeprefix("group_").removesuffix("_n") for c in results.columns if c.startswith("group_") and c.endswith("_n")]
    bundles = [c.removeprefix("force_").removesuffix("_n") for c in results.columns if c.startswith("force_") and c.endswith("_n")]
    return [*sums, *(b for b in bundles if b.partition("_")[0] not in sums)]


def _column(results: Frame, name: str) -> str:
    for column in (f"group_{name}_n", f"force_{name}_n"):
        if column in results.columns:
            return column
    raise InputError(f"results: no force of {name}; there are {', '.join(_ligaments(results)) or 'none'}", place=("results", None, name))
