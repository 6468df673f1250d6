"""Specimens before a build, what is known of builds, and many knees together."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from typing import Any, Mapping, Optional, Sequence, Union

from genu._call import absolute, as_html, run
from genu._arrays import Given, SurfaceLike, specimen_of
from genu._errors import InputError
from genu._tables import read_table
from genu._types import Frame, InferKnee, Input, Option, Path, Place, Side, Stage


@dataclass
class Check:
    """What :func:`check` found.

    Attributes
    ----------
    folder : str
        The specimen's folder.
    inputs : list of dict
        ``input``, ``state`` (``"ok"``, ``"look"``, ``"missing"``, ``"fault"``), ``found``, ``cost``.
    """

    folder: str
    inputs: list[Input] = field(repr=False)

    @property
    def faults(self) -> list[Input]:
        """The inputs that would stop a build."""
        return [i for i in self.inputs if i["state"] == "fault"]

    @property
    def ok(self) -> bool:
        """Whether a build would begin."""
        return not self.faults

    def _repr_html_(self) -> str:
        return as_html(f"genu.Check of {self.folder}", {i["input"]: f"{i['state']}: {i['found']}" for i in self.inputs})


def check(specimen: Place, *, out: Optional[Path] = None) -> Check:
    """Read and judge all inputs of a specimen; build nothing. Load against displacement goes into check.html.

    Parameters
    ----------
    specimen : str or path-like
        The folder that holds specimen.toml.
    out : str or path-like, optional
        Where check.html goes; ``specimen/build`` where None.

    Returns
    -------
    Check
        Also where an input would stop a build.

    Raises
    ------
    InputError
        No specimen there, or a specimen.toml that cannot be read.
    """
    place = absolute(specimen)
    words: list[Any] = ["check", place, "--json", *(["--out", absolute(out)] if out is not None else [])]
    try:
        text = run(*words)
    except InputError as error:
        if error.table is None:
            raise
        text = error.table
    return Check(place, json.loads(text))


@dataclass
class Specimen:
    """What :func:`init` wrote; its folder is taken wherever a path is.

    Attributes
    ----------
    folder : str
        The specimen's folder.
    words : str
        What was guessed of the files, and what is missing.
    """

    folder: str
    words: str

    def __fspath__(self) -> str:
        return self.folder

    @classmethod
    def from_arrays(
        cls,
        folder: Path,
        *,
        side: Side,
        bones: Mapping[str, SurfaceLike],
        scans: Optional[Mapping[str, SurfaceLike]] = None,
        cartilage: Optional[Mapping[str, SurfaceLike]] = None,
        landmarks: Optional[Mapping[str, Sequence[float]]] = None,
        laxity: Optional[Mapping[str, Any]] = None,
        name: str = "knee",
    ) -> Specimen:
        """Write a specimen folder from surfaces and tables in memory.

        Parameters
        ----------
        folder : str or path-like
            A new or empty folder.
        side : ``"left"`` or ``"right"``
            Which knee.
        bones : dict
            ``femur`` and ``tibfib``, and ``patella`` where it is there: closed surfaces [mm], CT frame. Each is a
            :class:`Surface`, an object with ``vertices`` and ``faces`` (trimesh), or a pair of arrays (n, 3) and (m, 3).
        scans : dict, optional
            Of the same names: scans of the dissected bones with cartilage on [mm], each in its own frame.
        cartilage : dict, optional
            ``femur``, ``tibia_medial``, ``tibia_lateral`` [mm], CT frame, in place of scans.
        landmarks : dict, optional
            Points of the CT frame by name [mm], such as ``femoral_head_center``.
        laxity : dict, optional
            Measured laxity by the name of its data set; tables as in :func:`simulate`.
        name : str
            The specimen's id.

        Returns
        -------
        Specimen

        Raises
        ------
        InputError
            A name that is not known, an array of another shape, a face of a vertex that is not there, neither scans nor
            cartilage, a folder with something in it. Nothing is left behind.
        MachineError
            The disk is full, or the folder may not be written.

        Examples
        --------
        >>> bones = {"femur": (vertices, faces), "tibfib": tibia}  # doctest: +SKIP
        >>> knee = genu.Specimen.from_arrays("knee1", side="left", bones=bones, scans=scans)  # doctest: +SKIP
        """
        return cls(*specimen_of(folder, Given(side, name, bones, scans or {}, cartilage or {}, landmarks or {}, laxity or {})))


def init(folder: Path, files: Union[Path, Sequence[Path]] = (), *, side: Optional[Side] = None) -> Specimen:
    """Write a specimen folder to fill in, or filled in as far as given files tell.

    Parameters
    ----------
    folder : str or path-like
        A new or empty folder.
    files : path or sequence of paths
        Surfaces, tables or folders of them: bones, scans, side and frames are guessed from geometry.
    side : ``"left"`` or ``"right"``, optional
        Which knee, where the files do not show it, or show it wrongly.

    Returns
    -------
    Specimen

    Raises
    ------
    InputError
        A folder with something in it; a file that cannot be read.
    """
    given = [files] if isinstance(files, (str, os.PathLike)) else list(files)
    words: list[Any] = ["init", absolute(folder)]
    words += ["--side", side] if side is not None else []
    words += ["--from", *(absolute(f) for f in given)] if given else []
    return Specimen(absolute(folder), run(*words))


def inspect(build: Place, stage: Optional[Stage] = None) -> list[dict[str, Any]]:
    """What each stage of a build made: the lines of its log, each with its folder and files.

    Parameters
    ----------
    build : Build, str or path-like
        A build, or the specimen's or the build's folder.
    stage : str, optional
        One stage only.

    Returns
    -------
    list of dict
        As in :attr:`Build.log`, with ``folder`` and ``files``; the last is ``{"failed": {...}}`` where a build stopped.
    """
    found: list[dict[str, Any]] = json.loads(run("inspect", absolute(build), *([stage] if stage else []), "--json"))
    return found


def options(stage: Optional[Stage] = None) -> list[Option]:
    """Every option, or those of one stage: ``key``, ``default`` (as TOML), ``value``, ``unit``, ``source``, ``meaning``, ``choices``."""
    found: list[Option] = json.loads(run("options", *([stage] if stage else []), "--json"))
    return found


@dataclass
class Cohort:
    """What :func:`cohort` found.

    Attributes
    ----------
    folder : str
        Where cohort.html and the tables are.
    knees : list of dict
        ``knee``, ``status``, ``failed``, ``last_stage``, ``warnings``, ``outliers``, ``report``.
    """

    folder: str
    knees: list[dict[str, Any]] = field(repr=False)

    @property
    def page(self) -> str:
        """The path of cohort.html."""
        return os.path.join(self.folder, "cohort.html")

    @property
    def tables(self) -> list[str]:
        """Names of the tables."""
        return sorted(f[:-4] for f in os.listdir(self.folder) if f.endswith(".csv"))

    def table(self, name: str) -> Frame:
        """A table as a pandas frame."""
        return read_table(os.path.join(self.folder, f"{name}.csv"))

    def _repr_html_(self) -> str:
        return as_html("genu.Cohort", {k["knee"]: f"{k['status']}, {len(k['outliers'])} outliers" for k in self.knees})


def cohort(builds: Sequence[Place], out: Path, *, force: bool = False) -> Cohort:
    """Put many builds on one page and into tidy tables.

    Parameters
    ----------
    builds : sequence of builds or paths
        Builds, their folders, or those of the specimens that hold them. One that failed is a row like any other.
    out : str or path-like
        Folder for cohort.html and the tables.
    force : bool
        Write over files in ``out`` that were changed since, or that no such call wrote; else they are an :class:`InputError`.

    Returns
    -------
    Cohort

    Raises
    ------
    InputError
        No build in any of them.
    """
    place = absolute(out)
    found = json.loads(run("cohort", *(absolute(b) for b in builds), "--out", place, "--json", *(["--force"] if force else [])))
    return Cohort(place, found["knees"])


def cohort_infer(builds: Sequence[Place], out: Path, *, force: bool = False) -> list[InferKnee]:
    """Tell each knee what the calibrations of the others say of its ligaments, contact and cartilage.

    Parameters
    ----------
    builds : sequence of builds or paths
        Calibrated builds of two knees or more, with the same options of calibration.
    out : str or path-like
        Folder for the files of priors and infer.csv.
    force : bool
        Write over files in ``out`` that were changed since, or that no such call wrote; else they are an :class:`InputError`.

    Returns
    -------
    list of dict
        A knee each: ``knee``, ``specimen``, ``model``, ``informed``, ``prior`` (``file``, ``shares``, ``numbers``) and ``next``, the command
        that builds it with that prior. In Python: ``genu.build(specimen, options={"calibrate.shared_prior": prior["file"]})``.
        A knee built so is not independent of the others, and says so: ``model.spec["calibrated"]["shared_prior"]``.

    Raises
    ------
    InputError
        A build without a calibration, with other options, or twice; fewer than two knees.
    """
    words = [*(absolute(b) for b in builds), "--out", absolute(out), "--json", *(["--force"] if force else [])]
    found: list[InferKnee] = json.loads(run("cohort", "infer", *words))["knees"]
    return found
