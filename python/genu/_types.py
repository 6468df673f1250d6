"""Words that a call takes, as types: a wrong one is told before the program runs."""

from __future__ import annotations

import os
from typing import Any, Callable, Literal, TypedDict, Union

import numpy as np
import numpy.typing as npt

Path = Union[str, "os.PathLike[str]"]
Array = npt.NDArray[Any]
Floats = npt.NDArray[np.float64]
Progress = Union[None, bool, Callable[[str, float, str], Any]]

Protocol = Literal["ap-laxity", "passive-flexion", "pivot-shift"]
Solver = Literal["quasistatic", "explicit"]
Method = Literal["posterior", "swarm-simplex"]
Contact = Literal["elastic", "jam"]
Format = Literal["abaqus", "febio", "opensim", "vtk", "stl", "ply", "glb"]
Side = Literal["left", "right"]
Stage = Literal[
    "segment", "ingest", "register", "bones", "cartilage", "frames", "attachments", "hexmesh", "overclosure",
    "contact-law", "assemble", "calibrate", "validate", "diagnose",
]


class Input(TypedDict):
    """An input of a specimen, as :func:`genu.check` judges it."""

    input: str
    state: Literal["ok", "look", "missing", "fault"]
    found: str
    cost: str


class Option(TypedDict):
    """An option of a stage."""

    key: str
    default: str
    value: Any
    unit: str
    source: str
    meaning: str
    choices: list[str]
