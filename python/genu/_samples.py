"""samples.json: the posterior that a calibration left beside its model."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Optional

import numpy as np

from genu._call import wanted
from genu._errors import InputError, in_file
from genu._types import Floats, Frame

SCHEMA = "samples/1"


@dataclass
class Samples:
    """The unknowns of a knee, each in every sample.

    Attributes
    ----------
    columns : dict
        By the name of the unknown, its value in each sample.
    most_probable : dict
        By the same names, the most probable value.
    interval : float
        Share of the samples between the ends of an interval.
    """

    columns: dict[str, Floats]
    most_probable: dict[str, float]
    interval: float


def samples_at(folder: str) -> Optional[Samples]:
    """The samples beside a model; None where the calibration left none.

    Raises
    ------
    InputError
        The file cannot be read, or is none that a calibration writes.
    """
    path = os.path.join(folder, "samples.json")
    if not os.path.isfile(path):
        return None
    try:
        with open(path, encoding="utf-8") as file:
            raw = json.load(file)
        if raw["schema"] != SCHEMA:
            raise ValueError(f"schema {raw['schema']!r}; {SCHEMA} is read")
        columns = {one["name"]: np.array(one["samples"], dtype=np.float64) for one in raw["unknowns"]}
        if len({len(values) for values in columns.values()}) > 1:
            raise ValueError("its unknowns have unequal numbers of samples")
        return Samples(columns, {one["name"]: float(one["most_probable"]) for one in raw["unknowns"]}, float(raw["interval"]))
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}", place=in_file(path)) from None
    except (ValueError, KeyError, TypeError) as error:
        why = f"no {error} in it" if isinstance(error, KeyError) else str(error)
        raise InputError(f"{path}: {why}; expected what calibrate writes", place=in_file(path)) from None


def frame_of_samples(samples: Samples) -> Frame:
    """The samples as a pandas frame, a row a sample."""
    frame: Frame = wanted("pandas", "tables").DataFrame(samples.columns)
    frame.index.name = "sample"
    frame.attrs["most_probable"] = samples.most_probable
    frame.attrs["interval"] = samples.interval
    return frame
