"""What a build left behind, stage by stage."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from typing import Any, Literal, Optional

import numpy as np

from genu._call import absolute, as_html, wanted
from genu._errors import InputError, in_file
from genu._meshes import Hexahedra, Surface, read_hexahedra, read_surface
from genu._model import Model
from genu._tables import read_table
from genu._types import Floats, Frame, Place, Stage


@dataclass(eq=False)
class Frames:
    """Anatomical frames.

    Attributes
    ----------
    femur, tibia : ndarray, shape (4, 4)
        CT from the bone's frame; the columns are the unit vectors medial, anterior, superior, and the origin [mm].
        As the axes are anatomical, the frame is right-handed for one side and left-handed for the other;
        ``numpy.linalg.inv`` gives the way back for both.
    pose : dict
        Grood-Suntay coordinates in CT: ``fe_deg``, ``vv_deg``, ``ie_deg``, ``ml_mm``, ``ap_mm``, ``si_mm``.
    raw : dict
        frames.json as it stands.
    """

    femur: Floats
    tibia: Floats
    pose: dict[str, float]
    raw: dict[str, Any] = field(repr=False, default_factory=dict)

    def __eq__(self, other: object) -> bool:
        """Whether frames and pose are the same numbers."""
        if not isinstance(other, Frames):
            return NotImplemented
        same = np.array_equal(self.femur, other.femur) and np.array_equal(self.tibia, other.tibia)
        return same and self.pose == other.pose

    __hash__ = None  # type: ignore[assignment]  # arrays change


class View:
    """A page of a knee that can be pulled at, in a frame of a notebook.

    Attributes
    ----------
    page : str
        The page, as HTML.
    height_px : int
        Height of the frame [px].
    """

    def __init__(self, page: str, height_px: int) -> None:
        self.page, self.height_px = page, height_px

    def __repr__(self) -> str:
        return f"<genu.View of {len(self.page) / 1e6:.1f} MB: the last value of a notebook's cell shows it>"

    def _repr_html_(self) -> str:
        from html import escape

        # a frame without an address takes the place of the knee from a script, not from a link
        page = self.page.replace("<head>", "<head><script>location.hash = 'live&';</script>", 1)
        return (
            f"<iframe title='Pull at the knee' srcdoc='{escape(page)}' style='width:100%;height:{self.height_px}px;border:0'>"
            "</iframe>"
        )


class Build:
    """A build's folder: stages, metrics, warnings, and what each stage made.

    Parameters
    ----------
    folder : str or path-like, or what has a folder
        The folder of a build, or of the specimen that holds ``build/``.

    Attributes
    ----------
    folder : str
        The build's folder.

    Raises
    ------
    InputError
        No build there.
    """

    def __init__(self, folder: Place) -> None:
        given = absolute(folder)
        places = [os.path.join(given, "build"), given]
        found = [p for p in places if os.path.isfile(os.path.join(p, "log.jsonl"))]
        if not found:
            raise InputError(f"no build in {given}: no log.jsonl there or in build/; run genu.build first", place=in_file(given))
        self.folder = found[0]

    def __repr__(self) -> str:
        return f"<genu.Build {self.folder}: {', '.join(self.stages) or 'no stage done'}>"

    def _repr_html_(self) -> str:
        stages = ", ".join(self.stages) or "none"
        rows = {"folder": self.folder, "stages": stages, "warnings": sum(map(len, self.warnings.values()))}
        stopped = {"stopped at": self.failure["stage"]} if self.failure else {}
        of_earlier = {"of an earlier run": ", ".join(self.outdated)} if self.outdated else {}
        return as_html("genu.Build", {**rows, **stopped, **of_earlier})

    @property
    def log(self) -> list[dict[str, Any]]:
        """The lines of log.jsonl: ``stage``, ``seconds``, ``peak_memory_mib``, ``digest``, ``cached``, ``warnings``, ``metrics``;
        ``outdated`` where the stage's folder is of an earlier run."""
        with open(os.path.join(self.folder, "log.jsonl"), encoding="utf-8") as file:
            return [json.loads(line) for line in file if line.strip()]

    @property
    def _current(self) -> list[dict[str, Any]]:
        return [r for r in self.log if not r.get("outdated")]

    @property
    def stages(self) -> list[str]:
        """Names of the stages that are done, in order; without those that an earlier run left and the last did not come to."""
        return [r["stage"] for r in self._current]

    @property
    def outdated(self) -> list[str]:
        """Stages whose folders an earlier run left, made of other inputs or options; :func:`genu.build` makes them anew."""
        return [r["stage"] for r in self.log if r.get("outdated")]

    @property
    def metrics(self) -> dict[str, dict[str, Any]]:
        """By stage, its figures with dotted names, such as ``metrics["cartilage"]["femur.volume_mm3"]``."""
        return {r["stage"]: _flat(r["metrics"]) for r in self._current}

    @property
    def warnings(self) -> dict[str, list[str]]:
        """By stage, what it warns of; stages without a warning are left out."""
        return {r["stage"]: list(r["warnings"]) for r in self._current if r["warnings"]}

    @property
    def notices(self) -> dict[str, list[dict[str, Any]]]:
        """By stage, what it warns of as values: ``kind``, ``weight``, ``text``; ``file``, ``row``, ``column``, ``element``, ``places``
        and ``count`` where they are known."""
        return {r["stage"]: list(r["notices"]) for r in self._current if r.get("notices")}

    @property
    def failure(self) -> Optional[dict[str, Any]]:
        """What stopped the build, ``stage`` and ``message``, with ``file``, ``row`` and ``marks`` where they are known; None where
        nothing did."""
        path = os.path.join(self.folder, "failure.json")
        found: Optional[dict[str, Any]] = self._json(path) if os.path.isfile(path) else None
        return found

    @property
    def report(self) -> str:
        """The path of report.html."""
        return os.path.join(self.folder, "report.html")

    def view(self, height_px: int = 900) -> View:
        """The knee that can be pulled at, as the report shows it; in a notebook the last value of a cell.

        Parameters
        ----------
        height_px : int
            Height of the frame [px].

        Returns
        -------
        View
            Shown by notebooks; offline, the page is inside.

        Raises
        ------
        InputError
            No report, or one of a knee that was not calibrated.
        """
        try:
            with open(self.report, encoding="utf-8") as file:
                page = file.read()
        except OSError as error:
            raise InputError(f"cannot read {self.report}: {error.strerror}; genu.report writes it") from None
        if 'id="live-module"' not in page:
            raise InputError(f"{self.report} has no knee to pull at: its build was not calibrated; give laxity, and build to stage calibrate or farther")
        return View(page, height_px)

    def summary(self) -> Frame:
        """The log as a pandas frame: a row a stage, with seconds, memory [MiB] and the number of warnings."""
        rows = [
            {
                "stage": r["stage"],
                "seconds": r["seconds"],
                "peak_memory_mib": r["peak_memory_mib"],
                "cached": r["cached"],
                "warnings": len(r["warnings"]),
            }
            for r in self.log
        ]
        frame: Frame = wanted("pandas", "tables").DataFrame(rows)
        return frame

    def path(self, stage: Stage, *names: str) -> str:
        """The path of a stage's folder, or of a file in it.

        Parameters
        ----------
        stage : str
            Its name without the number, such as ``"cartilage"``.
        *names : str
            Parts of the path below the stage's folder.

        Raises
        ------
        InputError
            The stage has not been run.
        """
        for entry in sorted(os.listdir(self.folder)):
            number, dash, name = entry.partition("-")
            if dash and name == stage and number[:2].isdigit():
                return os.path.join(self.folder, entry, *names)
        raise InputError(f"{self.folder}: stage {stage} has not been run; done are {', '.join(self.stages) or 'none'}", place=in_file(self.folder))

    def files(self, stage: Stage) -> list[str]:
        """The files of a stage, by their paths below its folder, in order."""
        top = self.path(stage)
        found = [os.path.relpath(os.path.join(d, f), top) for d, _, fs in os.walk(top) for f in fs]
        return sorted(f.replace(os.sep, "/") for f in found)

    def surface(self, stage: Stage, name: str) -> Surface:
        """A surface of a stage.

        Parameters
        ----------
        stage : str
            Such as ``"bones"`` or ``"cartilage"``.
        name : str
            The file's name without ``.ply``: ``femur``, ``tibfib``, ``tibia_medial``, ``tibia_lateral``, ...

        Returns
        -------
        Surface
            Vertices [mm] in the CT frame.
        """
        return read_surface(self._one(stage, name, ".ply"))

    def hexahedra(self, name: str, stage: Literal["overclosure", "hexmesh"] = "overclosure") -> Hexahedra:
        """The hexahedra of a cartilage.

        Parameters
        ----------
        name : str
            ``femur``, ``tibia_medial`` or ``tibia_lateral``.
        stage : str
            ``"overclosure"`` (those of the model) or ``"hexmesh"`` (as swept).

        Returns
        -------
        Hexahedra
            Nodes [mm] in the CT frame.
        """
        return read_hexahedra(self._one(stage, name, ".vtu"))

    def table(self, stage: Stage, name: str) -> Frame:
        """A table of a stage as a pandas frame; ``name`` is the path below its folder without ``.csv``."""
        return read_table(self._one(stage, name, ".csv"))

    def json(self, stage: Stage, name: str) -> Any:
        """A JSON file of a stage; ``name`` is the path below its folder without ``.json``."""
        return self._json(self._one(stage, name, ".json"))

    @property
    def frames(self) -> Frames:
        """The anatomical frames of stage ``frames``."""
        raw = self.json("frames", "frames")
        return Frames(_matrix(raw["femur"]), _matrix(raw["tibia"]), dict(raw["gs_ct_pose"]), raw)

    @property
    def transforms(self) -> dict[str, Floats]:
        """CT from each scan's frame, 4 x 4 [mm], by bone; of stage ``register``."""
        raw = self.json("register", "transforms")
        return {bone: np.array(t["ct_from_scan"], dtype=np.float64) for bone, t in raw.items() if "ct_from_scan" in t}

    @property
    def fibres(self) -> Frame:
        """The ligament fibres as a pandas frame, ends [mm] in the CT frame."""
        return self.table("attachments", "fibres")

    @property
    def sites(self) -> Frame:
        """The attachment sites as a pandas frame; ``centroid`` [mm] in the CT frame."""
        frame: Frame = wanted("pandas", "tables").DataFrame(self.json("attachments", "sites"))
        return frame

    @property
    def model(self) -> Model:
        """The best known model: calibrated to all data together, else to the one data set, else assembled."""
        return Model(self.folder)

    @property
    def samples(self) -> Optional[Frame]:
        """The posterior's samples of :attr:`model`, a row a sample, a column an unknown; None where there are none. See :attr:`Model.samples`."""
        return self.model.samples

    @property
    def assembled(self) -> Model:
        """The assembled model, before any calibration."""
        return Model(self.path("assemble", "model.json"))

    @property
    def sources(self) -> list[str]:
        """The sets of laxity that the build was calibrated to; empty where there are none."""
        if "calibrate" not in self.stages:
            return []
        top = self.path("calibrate")
        return sorted(d for d in os.listdir(top) if os.path.isfile(os.path.join(top, d, "model.json")))

    def calibrated(self, source: str) -> Model:
        """The model calibrated to ``source``, such as ``"kla"`` or ``"joint"``."""
        return Model(self.path("calibrate", source, "model.json"))

    def _one(self, stage: Stage, name: str, ending: str) -> str:
        path = self.path(stage, *name.split("/")) + ending
        if not os.path.isfile(path):
            there = [f[: -len(ending)] for f in self.files(stage) if f.endswith(ending)]
            raise InputError(f"{path}: no such file; stage {stage} has {', '.join(there) or 'none of this kind'}", place=in_file(path))
        return path

    @staticmethod
    def _json(path: str) -> Any:
        with open(path, encoding="utf-8") as file:
            return json.load(file)


def _matrix(frame: dict[str, Any]) -> Floats:
    out = np.eye(4)
    out[:3] = np.column_stack([frame[k] for k in ("medial", "anterior", "superior", "origin")])
    return out


def _flat(value: Any, prefix: str = "") -> dict[str, Any]:
    if not isinstance(value, dict):
        return {prefix: value}
    out: dict[str, Any] = {}
    for key, inner in value.items():
        out.update(_flat(inner, f"{prefix}.{key}" if prefix else key))
    return out
