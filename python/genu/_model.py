"""model.json as an object whose numbers can be edited."""

from __future__ import annotations

import copy
import json
import os
import secrets
from typing import Any, Optional, Protocol, Union

import numpy as np

from genu import _errors, _genu
from genu._call import Files, as_html, wanted
from genu._errors import InputError, in_file, writing
from genu._meshes import Surface, read_surface
from genu._samples import frame_of_samples, samples_at
from genu._types import Floats, Frame, Path


class Model:
    """A knee model: model.json and the surfaces it names.

    The first call of :func:`genu.simulate` compiles it; the next ones answer at once, until a number is edited.

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
            raise InputError(f"cannot read {place}: {error.strerror}", place=in_file(place)) from None
        except ValueError as error:
            row = error.lineno if isinstance(error, json.JSONDecodeError) else None
            where = f" line {row}" if row else ""
            told = f"{place}{where}: {error}; expected a model.json as build-model writes it"
            raise InputError(told, place=in_file(place, row)) from None
        if not isinstance(self.spec, dict) or "bundles" not in self.spec:
            raise InputError(f"{place}: no bundles in it; expected a model.json as build-model writes it", place=in_file(place))
        self.folder = os.path.dirname(place)
        self.file = place
        self._as_read = copy.deepcopy(self.spec)
        self._known: Optional[tuple[str, tuple[str, str, str]]] = None
        self._ready: Optional[tuple[str, _genu.Compiled]] = None

    def __repr__(self) -> str:
        size = f"{self.side}, {len(self.bundles)} bundles, {len(self.spec['fibres'])} fibres"
        try:
            told = f"{self.standing}: {self.stage}, digest {self.digest[:12]} of model and surfaces"
        except InputError:  # as edited it is no model; the next call says why
            told = f"no model as it stands: {self.file}"
        return f"<genu.Model {self.id}, {told}; {size}>"

    @property
    def standing(self) -> str:
        """What was done to the model, in the command's words: ``"calibrated to kla and rks together"``."""
        return self._told()[0]

    @property
    def stage(self) -> str:
        """Where in its build the model lies, ``"10-calibrate/joint/model.json"``, or its file's name; followed by ``as edited`` where it was."""
        return self._told()[1]

    @property
    def digest(self) -> str:
        """blake3 of the model as it stands and of the surfaces that it names, as the command tells it; no digest of a file."""
        return self._told()[2]

    @property
    def id(self) -> str:
        """The specimen's name."""
        return str(self.spec["id"])

    @property
    def side(self) -> str:
        """``"left"`` or ``"right"``."""
        return str(self.spec["side"])

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
        bundles: list[dict[str, Any]] = self.spec["bundles"]
        for bundle in bundles:
            if bundle["name"] == name:
                return bundle
        raise KeyError(f"no bundle {name}; the model has {', '.join(self.bundles)}")

    def parameters(self) -> Frame:
        """The bundles as a pandas frame, a row each. A copy: edit by :meth:`bundle` or ``spec``."""
        frame: Frame = wanted("pandas", "tables").DataFrame(copy.deepcopy(self.spec["bundles"]))
        return frame

    @property
    def samples(self) -> Optional[Frame]:
        """The posterior's samples as a pandas frame, a row a sample, a column an unknown; None where there are none.

        Columns are called as in parameters.csv and frames.csv, such as ``"ACL_AM.reference_strain"`` [-] and
        ``"femur.medial.turn_deg"``; docs/schema/samples.schema.json has the others with their units. ``attrs`` has
        ``most_probable``, by column, and ``interval``, the share of the samples between the ends of an interval. A model
        that was edited has none: the samples are those of its file. Whether the file itself was changed since is not asked
        here; :func:`genu.simulate` says so in ``attrs["warnings"]``.

        Raises
        ------
        InputError
            samples.json beside the model cannot be read.
        """
        found = samples_at(self.folder) if self._may_have_samples() else None
        return None if found is None else frame_of_samples(found)

    @property
    def sample_columns(self) -> Optional[dict[str, Floats]]:
        """The posterior's samples as arrays by the name of the unknown, without pandas; as :attr:`samples`."""
        found = samples_at(self.folder) if self._may_have_samples() else None
        return None if found is None else found.columns

    def fibres(self) -> tuple[list[str], Floats]:
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
            The file, or a folder for ``model.json``. Where it is a symbolic link, the file that it leads to is written,
            and the link stays.

        Returns
        -------
        str
            The path of the file that was written.

        Raises
        ------
        InputError
            A number or a name in ``spec`` is none that a model.json may have; at ``path`` there is something else than a file.
        MachineError
            The disk is full, or the folder may not be written.
        """
        place = os.path.abspath(os.fspath(path))
        if not place.endswith(".json"):
            place = os.path.join(place, "model.json")
        if os.path.islink(place):
            place = os.path.realpath(place)
        if os.path.lexists(place) and (os.path.islink(place) or not os.path.isfile(place)):
            raise InputError(f"{place} is no regular file; nothing was written there, name another file", place=in_file(place))
        folder = os.path.dirname(place)
        with writing(folder):
            os.makedirs(folder, exist_ok=True)
        own, there = os.path.realpath(self.folder), os.path.realpath(folder)  # links would break the way up
        text = _genu.moved(self._text(), own, there, _errors.made)
        temporary = f"{place}.{secrets.token_hex(4)}.tmp"
        try:
            with writing(place):
                with open(temporary, "x", encoding="utf-8") as file:
                    file.write(text)
                os.replace(temporary, place)
        finally:
            if os.path.lexists(temporary):
                os.remove(temporary)
        return place

    def _may_have_samples(self) -> bool:
        """Whether samples.json beside the file is of this model, as the command judges it."""
        as_read = self.spec == self._as_read and os.path.basename(self.file) == "model.json"
        return as_read and self.spec.get("calibrated") is not None

    def _text(self) -> str:
        """model.json with the numbers as they are now."""
        try:
            return json.dumps(self.spec, default=_plain, allow_nan=False)
        except ValueError as error:
            raise InputError(f"the model as edited: {error}; a model's numbers are finite") from None

    def _given(self, name: str) -> tuple[str, Files]:
        """The path at which the program finds this model, and its text where the file on the disk is another."""
        if self.spec == self._as_read and os.path.isfile(self.file):  # its samples lie beside it
            return self.file, {}
        # in the folder of the file, so that mesh paths hold as they stand
        place = f"{self.file} as edited" + ("" if name == "model" else f" ({name})")
        return place, {place: self._text().encode()}

    def _told(self) -> tuple[str, str, str]:
        """What the command tells of the model; asked anew only where a number was edited since."""
        text = self._text()
        if self._known is None or self._known[0] != text:
            place, files = self._given("model")
            self._known = (text, _genu.told(place, _errors.made, files))
        return self._known[1]

    def _compiled(self) -> _genu.Compiled:
        """The model ready to answer; compiled anew only where a number was edited since."""
        text = self._text()
        if self._ready is None or self._ready[0] != text:
            place, files = self._given("model")
            self._ready = (text, _genu.Compiled(place, _errors.made, files))
        return self._ready[1]

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_ready": None}  # what is compiled belongs to this process

    def _repr_html_(self) -> str:
        try:
            told = dict(zip(("standing", "stage", "digest of model and surfaces"), self._told()))
        except InputError:  # as edited it is no model; the next call says why
            told = {"standing": "no model as it stands"}
        rows = {"specimen": self.id, **told, "side": self.side, "file": self.file, "bundles": ", ".join(self.bundles)}
        edited = " (edited)" if self.spec != self._as_read else ""
        return as_html(f"genu.Model{edited}", {**rows, "fibres": len(self.spec["fibres"])})


class HasModel(Protocol):
    """What has a model: a build, a calibration, a diagnosis."""

    @property
    def model(self) -> Model: ...


ModelLike = Union[Model, HasModel, Path]


def _plain(value: Any) -> Any:
    """Scalars and arrays of numpy as JSON has them."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise InputError(f"the model as edited: {value!r} is a {type(value).__name__}; a number, text, list or dict was expected")


def _meant(model: ModelLike) -> Model | str:
    """The model itself, or the path that was given of it."""
    if isinstance(model, (str, os.PathLike)):
        return os.path.abspath(os.fspath(model))
    found = model if isinstance(model, Model) else getattr(model, "model", None)  # a build, a calibration, a diagnosis
    if not isinstance(found, Model):
        raise TypeError(f"a model, what has one (a build), or a path was expected, not {type(model).__name__}")
    return found


def model_at(model: ModelLike, name: str = "model") -> tuple[str, Files]:
    """The path at which the program finds a model, and files in memory where it was edited."""
    found = _meant(model)
    return (found, {}) if isinstance(found, str) else found._given(name)


def compiled(model: ModelLike) -> _genu.Compiled:
    """A model, a build, a calibration or a path, ready to answer."""
    found = _meant(model)
    return _genu.Compiled(found, _errors.made, {}) if isinstance(found, str) else found._compiled()
