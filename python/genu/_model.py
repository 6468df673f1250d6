"""model.json as an object whose numbers can be edited."""

from __future__ import annotations

import copy
import json
import os
from typing import Any, Optional

import numpy as np

from genu import _errors, _genu
from genu._call import Path
from genu._errors import InputError
from genu._meshes import Surface, read_surface


class Model:
    """A knee model: model.json and the surfaces it names.

    Parameters
    ----------
    path : str or path-like
        model.json, or a folder that holds it, or the folder of a build or specimen: then its joint calibrated
        model, else that of its one data set, else the assembled one, as in the command.
    source : str, optional
        Of a build: the model calibrated to this data set alone.
    as_assembled : bool
        Of a build: the assembled model, before any calibration.

    Attributes
    ----------
    spec : dict
        model.json as it stands; every number may be edited. The columns and units are those of the file.
    folder : str
        Where the mesh paths of ``spec`` start from.
    file : str
        The file that was read.

    Raises
    ------
    InputError
        No such file, or not a model.
    """

    def __init__(self, path: Path, source: Optional[str] = None, as_assembled: bool = False) -> None:
        given = os.path.abspath(os.fspath(path))
        place = os.fspath(_genu.model_file(given, _errors.made, as_assembled, source))
        try:
            with open(place, encoding="utf-8") as file:
                self.spec: dict[str, Any] = json.load(file)
        except OSError as error:
            raise InputError(f"cannot read {place}: {error.strerror}") from None
        except ValueError as error:
            row = f" line {error.lineno}" if isinstance(error, json.JSONDecodeError) else ""
            raise InputError(f"{place}{row}: {error}; expected a model.json as build-model writes it") from None
        if not isinstance(self.spec, dict) or "bundles" not in self.spec:
            raise InputError(f"{place}: no bundles in it; expected a model.json as build-model writes it")
        self.folder = os.path.dirname(place)
        self.file = place
        self._as_read = copy.deepcopy(self.spec)

    def __repr__(self) -> str:
        return f"<genu.Model {self.id}: {self.side}, {len(self.bundles)} bundles, {len(self.spec['fibres'])} fibres>"

    @property
    def id(self) -> str:
        """The specimen's name."""
        return self.spec["id"]

    @property
    def side(self) -> str:
        """``"left"`` or ``"right"``."""
        return self.spec["side"]

    @property
    def bundles(self) -> list[str]:
        """Names of the ligament bundles, in the order of the file."""
        return [b["name"] for b in self.spec["bundles"]]

    def bundle(self, name: str) -> dict[str, Any]:
        """A ligament bundle, to be read and edited.

        Parameters
        ----------
        name : str
            Such as ``"ACL_AM"``.

        Returns
        -------
        dict
            ``reference_strain`` [-], ``stiffness_n_per_mm``, ``reference_length_mm``, ``toe_strain`` [-], ``law``, ...

        Raises
        ------
        KeyError
            No such bundle; the message names those there are.
        """
        for bundle in self.spec["bundles"]:
            if bundle["name"] == name:
                return bundle
        raise KeyError(f"no bundle {name}; the model has {', '.join(self.bundles)}")

    def parameters(self) -> Any:
        """The bundles as a pandas frame, a row each. A copy: edit by :meth:`bundle` or ``spec``."""
        from genu._call import wanted

        return wanted("pandas", "tables").DataFrame(copy.deepcopy(self.spec["bundles"]))

    def fibres(self) -> tuple[list[str], np.ndarray]:
        """The fibres' bundle names and their ends.

        Returns
        -------
        names : list of str
            Of the n fibres' bundles.
        ends : ndarray, shape (n, 2, 3)
            Femoral and tibial end [mm], CT frame.
        """
        fibres = self.spec["fibres"]
        ends = np.array([[f["femur"], f["tibia"]] for f in fibres], dtype=np.float64).reshape(-1, 2, 3)
        return [f["bundle"] for f in fibres], ends

    def surfaces(self) -> dict[str, Surface]:
        """The surfaces that the model names (bones, then contact faces), by the paths it names them."""
        names = [b["bone"] for b in self.spec["bodies"]]
        names += [p[side] for p in self.spec["contact"]["pairs"] for side in ("femur", "tibia")]
        return {n: read_surface(os.path.join(self.folder, n)) for n in dict.fromkeys(names)}

    def copy(self) -> "Model":
        """A model of its own with the same numbers."""
        other = copy.copy(self)
        other.spec = copy.deepcopy(self.spec)
        return other

    def save(self, path: Path) -> str:
        """Write model.json; its mesh paths are turned so that they hold from there.

        Parameters
        ----------
        path : str or path-like
            The file, or a folder for ``model.json``.

        Returns
        -------
        str
            The file's path.
        """
        place = os.path.abspath(os.fspath(path))
        if not place.endswith(".json"):
            place = os.path.join(place, "model.json")
        folder = os.path.dirname(place)
        os.makedirs(folder, exist_ok=True)
        temporary = f"{place}.tmp"
        with open(temporary, "w", encoding="utf-8") as file:
            json.dump(self._seen_from(folder), file, indent=2)
            file.write("\n")
        os.replace(temporary, place)
        return place

    def _seen_from(self, folder: str) -> dict[str, Any]:
        spec = copy.deepcopy(self.spec)
        own, there = os.path.realpath(self.folder), os.path.realpath(folder)  # links would break the way up

        def moved(name: str) -> str:
            return os.path.relpath(os.path.join(own, name), there).replace(os.sep, "/")

        for body in spec["bodies"]:
            body["bone"] = moved(body["bone"])
            body["cartilage"] = [moved(c) for c in body["cartilage"]]
        for pair in spec["contact"]["pairs"]:
            pair["femur"], pair["tibia"] = moved(pair["femur"]), moved(pair["tibia"])
        return spec


def model_file(model: Any, folder: str, name: str = "model") -> str:
    """The path of a model: as given, or of an edited one written below ``folder``."""
    if isinstance(model, Model):
        if model.spec == model._as_read and os.path.isfile(model.file):  # its samples lie beside it
            return model.file
        return model.save(os.path.join(folder, f"{name}.json"))
    if hasattr(model, "model") and isinstance(model.model, Model):  # a build, a calibration, a diagnosis
        return model_file(model.model, folder, name)
    return os.path.abspath(os.fspath(model))
