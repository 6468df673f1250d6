"""The verbs of build-model: models and tables in, models and tables out."""

from __future__ import annotations

import json
import os
import warnings
from dataclasses import dataclass, field
from typing import Any, Mapping, Optional, Sequence, Union, overload

from genu import _errors
from genu._build import Build
from genu._call import absolute, as_html, called, names, run, settings, spoken, watching
from genu._errors import GenuError, in_file
from genu._model import Model, ModelLike, compiled, model_at
from genu._tables import frame_of, read_table, table_at
from genu._types import Contact, Format, Frame, Method, Path, Place, Progress, Protocol, Side, Solver, Stage, Table


def phantom(id: str, folder: Path, *, seed: int = 1, volume: bool = False) -> str:
    """Write a synthetic specimen with known truth.

    Parameters
    ----------
    id : str
        Such as ``"S192803-phantom"``; the error for an unknown name lists those there are.
    folder : str or path-like
        A new or empty folder.
    seed : int
        Seed of its noise.
    volume : bool
        Write a CT volume in place of the CT surfaces.

    Returns
    -------
    str
        The specimen's folder, for :func:`build`.

    Raises
    ------
    GenuError
        An unknown name, or a folder with something in it.
    """
    place = absolute(folder)
    run("phantom", id, place, "--seed", seed, *(["--volume"] if volume else []))
    return place


def build(
    specimen: Place,
    *,
    out: Optional[Path] = None,
    to: Optional[Stage] = None,
    from_: Optional[Stage] = None,
    options: Optional[Mapping[str, Any]] = None,
    force: bool = False,
    seed: Optional[int] = None,
    jobs: Optional[int] = None,
    progress: Progress = None,
) -> Build:
    """Build the model of a specimen; a stage whose inputs have not changed is not run again.

    Parameters
    ----------
    specimen : str or path-like
        The folder that holds specimen.toml.
    out : str or path-like, optional
        Where the build goes; ``specimen/build`` where None.
    to : str, optional
        Stop after this stage, such as ``"assemble"``.
    from_ : str, optional
        Run this stage and those after it, even if nothing changed.
    options : dict, optional
        ``{"hexmesh": {"edge_length_mm": 0.75}}`` or ``{"hexmesh.edge_length_mm": 0.75}``.
    force : bool
        Run every stage, even if nothing changed.
    seed : int, optional
        Seed of whatever is random.
    jobs : int, optional
        Threads; all where None. The result does not depend on it.
    progress : callable, True or None
        ``progress(stage, share, message)``; True draws a bar. See :func:`run`.

    Returns
    -------
    Build

    Raises
    ------
    StageError
        A stage cannot go on: ``stage`` names it, ``file`` and ``row`` where its sentence does.
    InputError, OptionError, UsageError
        A file, an option or the call is at fault.
    KeyboardInterrupt
        Ctrl-C. The same call goes on from the stages that were finished.
    """
    words: list[Any] = [absolute(specimen), "--quiet"]
    words += ["--out", absolute(out)] if out is not None else []
    words += ["--to", to] if to is not None else []
    words += ["--from", from_] if from_ is not None else []
    words += ["--force"] if force else []
    words += ["--seed", seed] if seed is not None else []
    run(*words, *settings(options), jobs=jobs, progress=progress)
    return Build(out if out is not None else os.path.join(absolute(specimen), "build"))


@overload
def simulate(
    model: ModelLike,
    trials: Table,
    *,
    protocol: None = None,
    without: Union[str, Sequence[str]] = (),
    solver: Solver = "quasistatic",
    read_as: Optional[str] = None,
    samples: Optional[int] = None,
    jobs: Optional[int] = None,
    progress: Progress = None,
) -> Frame: ...
@overload
def simulate(
    model: ModelLike,
    trials: None = None,
    *,
    protocol: Protocol,
    without: Union[str, Sequence[str]] = (),
    solver: Solver = "quasistatic",
    read_as: Optional[str] = None,
    to_flexion_deg: Optional[float] = None,
    compression_n: Optional[float] = None,
    samples: Optional[int] = None,
    jobs: Optional[int] = None,
    progress: Progress = None,
) -> Frame: ...
def simulate(
    model: ModelLike,
    trials: Optional[Table] = None,
    *,
    protocol: Optional[Protocol] = None,
    without: Union[str, Sequence[str]] = (),
    solver: Solver = "quasistatic",
    read_as: Optional[str] = None,
    to_flexion_deg: Optional[float] = None,
    compression_n: Optional[float] = None,
    samples: Optional[int] = None,
    jobs: Optional[int] = None,
    progress: Progress = None,
) -> Frame:
    """Predict what a model does under the loads of trials or of a protocol.

    Parameters
    ----------
    model : Model, Build, str or path-like
        The knee; an edited :class:`Model` is taken as it stands.
    trials : pandas.DataFrame, dict of columns, list of dicts, str or path-like, optional
        Laxity trials with the columns of FORMAT.md: ``trial``, ``test``, ``nominal_flexion_deg``, ``load_vv_nm``,
        ``load_ie_nm``, ``load_ml_n``, ``load_ap_n``, ``load_si_n``, ``fe_deg``. Clinical signs, of the tibia.
    protocol : str, optional
        ``"ap-laxity"``, ``"passive-flexion"`` or ``"pivot-shift"``, in place of trials.
    without : str or sequence of str
        Bundles or ligaments to cut, such as ``"ACL"`` or ``["ACL", "LCL"]``.
    solver : str
        ``"quasistatic"`` or ``"explicit"``.
    read_as : str, optional
        Predict what the apparatus of this data set would read, with what :func:`diagnose` added to it.
    to_flexion_deg : float, optional
        Where passive flexion ends [deg].
    compression_n : float, optional
        Joint compression in a protocol [N].
    samples : int, optional
        Samples of the posterior by which mean and 90 % interval are told, where the model has any; 0 leaves them out.
    jobs, progress
        As in :func:`build`.

    Returns
    -------
    pandas.DataFrame
        A row a trial: the columns of the trials with predicted ``vv_deg``, ``ie_deg``, ``ml_mm``, ``ap_mm``, ``si_mm``,
        a force per bundle, ``force_ACL_AM_n``, ... [N], sums of ligaments, ``group_ACL_n``, ..., and the contact of each
        compartment, ``contact_medial_force_n``, ...; of a calibrated model each with ``_mean``, ``_lower``, ``_upper``.
        ``attrs["warnings"]`` lists what is odd, ``attrs["notices"]`` the same as dicts with ``kind``, ``weight``, ``row``
        and more.

    Raises
    ------
    InputError
        The trials or the model are at fault; ``row`` is the line of the table, its header being line 1.
    UsageError
        Neither or both of ``trials`` and ``protocol``; an unknown ligament.
    """
    files: dict[str, bytes] = {}
    words: list[Any] = ["model", "--out", "results", "--solver", solver]
    words += ["--trials", table_at(trials, "trials", files)] if trials is not None else []
    words += ["--protocol", protocol] if protocol is not None else []
    words += ["--without", ",".join(names(without))] if names(without) else []
    words += ["--read-as", read_as] if read_as is not None else []
    words += ["--to-flexion", to_flexion_deg] if to_flexion_deg is not None else []
    words += ["--compression", compression_n] if compression_n is not None else []
    words += ["--samples", samples] if samples is not None else []
    with watching(progress) as watcher:
        ready = compiled(model)
        text, warnings, notices = ready.simulate(spoken(words), _errors.made, (jobs, watcher), files)
    found = frame_of(text)
    found.attrs["warnings"] = warnings
    found.attrs["notices"] = json.loads(notices)
    return found


@dataclass
class Calibration:
    """What :func:`calibrate` found.

    Attributes
    ----------
    folder : str
        Where its files are.
    model : Model
        The calibrated model.
    parameters : pandas.DataFrame
        ``design_variable``, ``bundle``, ``kind``, ``value``, ``lower``, ``upper``, ...: 90 % intervals.
    history : pandas.DataFrame
        What the method lowers: the cost by evaluation; of ``posterior``, half the sum of squares that each start left.
    metrics : dict
        Figures: ``cost``, ``rms`` by coordinate, ``trials``, ...
    words : str
        What the command tells.
    """

    folder: str
    model: Model = field(repr=False)
    parameters: Frame = field(repr=False)
    history: Frame = field(repr=False)
    metrics: dict[str, Any] = field(repr=False)
    words: str = field(repr=False, default="")

    def table(self, name: str) -> Frame:
        """Another table of the folder as a pandas frame, such as ``"forces"`` or ``"fit"``."""
        return read_table(os.path.join(self.folder, f"{name}.csv"))

    def _repr_html_(self) -> str:
        rms = ", ".join(f"{name} {value}" for name, value in self.metrics.get("rms", {}).items())
        return as_html("genu.Calibration", {"folder": self.folder, "trials": self.metrics.get("trials"), "rms": rms})


def calibrate(
    model: ModelLike,
    targets: Table,
    out: Path,
    *,
    method: Method = "posterior",
    options: Optional[Mapping[str, Any]] = None,
    seed: Optional[int] = None,
    anew: bool = False,
    force: bool = False,
    jobs: Optional[int] = None,
    progress: Progress = None,
) -> Calibration:
    """Find the ligament parameters with which a model answers as the knee did.

    Parameters
    ----------
    model : Model, Build, str or path-like
        Where the search starts.
    targets : pandas.DataFrame, dict of columns, list of dicts, str or path-like
        Measured laxity, columns as in FORMAT.md.
    out : str or path-like
        Folder for model.json, parameters.csv, history.csv and more.
    method : str
        ``"posterior"`` or ``"swarm-simplex"`` (the paper's recipe).
    options : dict, optional
        Of stage ``calibrate``: ``{"inference.starts": 3}``.
    anew : bool
        Begin anew where an interrupted calibration could be taken up.
    force : bool
        Write over files in ``out`` that were changed since, or that no such call wrote; else they are an :class:`InputError`.
    seed, jobs, progress
        As in :func:`build`. An interrupted calibration is taken up by the same call.

    Returns
    -------
    Calibration

    Raises
    ------
    InputError, OptionError, UsageError
    """
    place = absolute(out)
    start, files = model_at(model)
    words: list[Any] = ["calibrate", start, "--targets", table_at(targets, "targets", files)]
    words += ["--out", place, "--method", method, *settings(options, "calibrate")]
    words += ["--seed", seed] if seed is not None else []
    words += ["--anew"] if anew else []
    words += ["--force"] if force else []
    told = called(words, files, jobs=jobs, progress=progress)
    return Calibration(
        place,
        Model(place),
        read_table(os.path.join(place, "parameters.csv")),
        read_table(os.path.join(place, "history.csv")),
        _json(os.path.join(place, "metrics.json")),
        told,
    )


@dataclass
class Validation:
    """What :func:`validate` found.

    Attributes
    ----------
    folder : str
        Where its files are.
    differences : pandas.DataFrame
        How far the models differ in each protocol (RMSD), with the published figures.
    words : str
        What the command tells.
    """

    folder: str
    differences: Frame = field(repr=False)
    words: str = field(repr=False, default="")

    def protocol(self, model: str, name: str) -> Frame:
        """A model's answers to ``"ap_laxity"``, ``"passive_flexion"``, ``"pivot_shift"`` or ``"pivot_shift_no_acl"``."""
        return read_table(os.path.join(self.folder, model, f"{name}.csv"))

    def table(self, name: str) -> Frame:
        """Another table of the folder as a pandas frame."""
        return read_table(os.path.join(self.folder, f"{name}.csv"))


def validate(
    models: Mapping[str, ModelLike],
    out: Path,
    *,
    passive: Optional[Mapping[str, Table]] = None,
    solver: Optional[Solver] = None,
    samples: Optional[int] = None,
    options: Optional[Mapping[str, Any]] = None,
    force: bool = False,
    jobs: Optional[int] = None,
    progress: Progress = None,
) -> Validation:
    """Run the validation protocols on models of one knee and compare them.

    Parameters
    ----------
    models : dict
        By name, each a Model, Build, Calibration or a path.
    out : str or path-like
        Folder for the results.
    passive : dict, optional
        By name, measured passive flexion: a table with ``fe_deg``, ``vv_deg``, ``ie_deg``, ``ml_mm``, ``ap_mm``, ``si_mm``, or its path.
    solver : {"explicit", "quasistatic"}, optional
        How the joint model is solved, or every model where none is joint; models of single data sets beside a joint one are quasi-static.
        With ``"explicit"``, the default, the quasi-static answer stands beside it: columns ``ap_mm_quasistatic`` and so on, and
        ``table("solvers")``.
    samples : int, optional
        Samples of the posterior by which mean and 90 % interval stand beside every value, where a model has any; 0 leaves them out.
    options : dict, optional
        Of stage ``validate``: ``{"ap_flexions_deg": [30, 60]}``.
    force : bool
        Write over files in ``out`` that were changed since, or that no such call wrote; else they are an :class:`InputError`.
    jobs, progress
        As in :func:`build`.

    Returns
    -------
    Validation

    Raises
    ------
    InputError, UsageError
    """
    place = absolute(out)
    files: dict[str, bytes] = {}
    words: list[Any] = ["validate", "--out", place, *settings(options, "validate")]
    if solver is not None:
        words += ["--solver", solver]
    words += ["--samples", samples] if samples is not None else []
    words += ["--force"] if force else []
    for name, table in (passive or {}).items():
        words += ["--passive", f"{name}={table_at(table, f'passive {name}', files)}"]
    for name, model in models.items():
        path, more = model_at(model, name)
        files.update(more)
        words.append(f"{name}={path}")
    told = called(words, files, jobs=jobs, progress=progress)
    return Validation(place, read_table(os.path.join(place, "compare.csv")), told)


@dataclass
class Diagnosis:
    """What :func:`diagnose` found.

    Attributes
    ----------
    folder : str
        Where diagnosis.json, report.html, components/ and model.json are.
    raw : dict
        diagnosis.json as it stands.
    model : Model
        The model with what was added.
    """

    folder: str
    raw: dict[str, Any] = field(repr=False)
    model: Model = field(repr=False)

    @property
    def verdict(self) -> str:
        """``"decisive"``, ``"probable"``, ``"one_of"``, ``"unnamed"`` or ``"none"``."""
        return str(self.raw["verdict"])

    @property
    def answers(self) -> list[dict[str, Any]]:
        """Rival answers, best first."""
        found: list[dict[str, Any]] = self.raw["answers"]
        return found

    @property
    def description(self) -> str:
        """Words for a reader."""
        return str(self.raw["description"])

    @property
    def report(self) -> str:
        """The path of report.html."""
        return os.path.join(self.folder, "report.html")

    def _repr_html_(self) -> str:
        return as_html("genu.Diagnosis", {"verdict": self.verdict, "description": self.description, "report": self.report})


def diagnose(
    model: ModelLike,
    measured: Mapping[str, Table],
    out: Path,
    *,
    before: Optional[Mapping[str, Table]] = None,
    without_effect: Union[str, Sequence[str]] = (),
    options: Optional[Mapping[str, Any]] = None,
    force: bool = False,
    jobs: Optional[int] = None,
    progress: Progress = None,
) -> Diagnosis:
    """Find the effect that a model lacks, by measured laxity.

    Parameters
    ----------
    model : Model, Build, Calibration, str or path-like
        The knee.
    measured : dict
        By the data set's name (``"kla"``, ``"rks"``), laxity trials as a table or a path.
    out : str or path-like
        Folder for diagnosis.json, report.html, components/ and model.json.
    before : dict, optional
        What the same knee read before, whole or untreated, as `measured`: nothing is sought in it.
    without_effect : sequence of str
        Effects to leave out of the catalogue.
    options : dict, optional
        Options of the diagnosis by name, ``{"most_effects": 1}``; those of the knee's calibration with the stage before them,
        ``{"calibrate": {"priors": "read"}}``.
    force : bool
        Write over files in ``out`` that were changed since, or that no such call wrote; else they are an :class:`InputError`.
    jobs, progress
        As in :func:`build`.

    Returns
    -------
    Diagnosis

    Raises
    ------
    InputError, OptionError, UsageError
    """
    place = absolute(out)
    path, files = model_at(model)
    words: list[Any] = ["diagnose", path, "--out", place]
    for name, table in measured.items():
        words += ["--measured", f"{name}={table_at(table, f'measured {name}', files)}"]
    for name, table in (before or {}).items():
        words += ["--before", f"{name}={table_at(table, f'before {name}', files)}"]
    words += ["--without-effect", ",".join(names(without_effect))] if names(without_effect) else []
    words += ["--force"] if force else []
    words += settings(options, "diagnose", "calibrate")
    called(words, files, jobs=jobs, progress=progress)
    return Diagnosis(place, _json(os.path.join(place, "diagnosis.json")), Model(place))


def export(
    model: ModelLike,
    format: Format,
    out: Path,
    *,
    poses: Optional[Table] = None,
    contact: Contact | None = None,
    force: bool = False,
) -> list[str]:
    """Write a model as another program reads it.

    Parameters
    ----------
    model : Model, Build, str or path-like
        The knee.
    format : str
        ``"abaqus"``, ``"febio"``, ``"opensim"``, ``"vtk"``, ``"stl"``, ``"ply"`` or ``"glb"``.
    out : str or path-like
        Folder for the files.
    poses : pandas.DataFrame, str or path-like, optional
        Results of :func:`simulate`, for a time series (with ``"vtk"``); or trials, of which each becomes a file (with ``"abaqus"``,
        ``"febio"`` or ``"opensim"``).
    contact : {"elastic", "jam"}, optional
        Contact of an OpenSim model: ElasticFoundationForce, which OpenSim itself has, or Smith2018ArticularContactForce, for
        OpenSim with JAM, which :func:`import_opensim` reads. The first where none is given.
    force : bool
        Write over files that were edited since an earlier export wrote them.

    Returns
    -------
    list of str
        Paths of the files in ``out``. What the format cannot hold of the model is told by :func:`warnings.warn`.

    Raises
    ------
    InputError, UsageError
    """
    place = absolute(out)
    path, files = model_at(model)
    words: list[Any] = ["export", path, "--format", format, "--out", place, "--json"]
    words += ["--poses", table_at(poses, "poses", files)] if poses is not None else []
    words += ["--contact", contact] if contact is not None else []
    words += ["--force"] if force else []
    for odd in json.loads(called(words, files))["warnings"]:
        warnings.warn(odd, stacklevel=2)
    return sorted(os.path.join(d, f) for d, _, fs in os.walk(place) for f in fs)


def import_abaqus(deck: Path, out: Path, *, force: bool = False) -> Model:
    """Turn a published Abaqus knee deck into a model in the folder ``out``.

    Parameters
    ----------
    deck : str or path-like
        Its main file.
    out : str or path-like
        Folder for the model.
    force : bool
        Write over files in ``out`` that were changed since, or that no such call wrote; else they are an :class:`InputError`.

    Raises
    ------
    InputError
        The deck cannot be read; ``file`` and ``row`` say where.
    """
    place = absolute(out)
    run("import-abaqus", absolute(deck), "--out", place, *(["--force"] if force else []))
    return Model(place)


def import_opensim(
    file: Path, out: Path, *, femur: str | None = None, tibia: str | None = None, side: Side | None = None, force: bool = False
) -> Model:
    """Turn an OpenSim knee with JAM's ligaments and contact into a model in the folder ``out``.

    Parameters
    ----------
    file : str or path-like
        The model (.osim), its meshes beside it or in its folder Geometry.
    out : str or path-like
        Folder for the model.
    femur, tibia : str, optional
        Names of the bodies, where names and contact do not tell them.
    side : {"left", "right"}, optional
        Which knee, where ligaments and names do not tell it.
    force : bool
        Write over files in ``out`` that were changed since, or that no such call wrote; else they are an :class:`InputError`.

    Raises
    ------
    InputError
        The file cannot be read; ``file`` and ``row`` say where.
    """
    return _imported("import-opensim", file, out, (femur, tibia, side), force)


def import_febio(
    file: Path, out: Path, *, femur: str | None = None, tibia: str | None = None, side: Side | None = None, force: bool = False
) -> Model:
    """Turn a FEBio knee of rigid bones, springs and sliding contact into a model in the folder ``out``.

    Parameters
    ----------
    file : str or path-like
        The file (.feb), of format 4.0, 3.0 or 2.5, in mm, N and MPa.
    out : str or path-like
        Folder for the model.
    femur, tibia : str, optional
        Names of the rigid bodies, where names and contact do not tell them.
    side : {"left", "right"}, optional
        Which knee, where ligaments and names do not tell it.
    force : bool
        Write over files in ``out`` that were changed since, or that no such call wrote; else they are an :class:`InputError`.

    Raises
    ------
    InputError
        The file cannot be read; ``file`` and ``row`` say where.
    """
    return _imported("import-febio", file, out, (femur, tibia, side), force)


def _imported(verb: str, file: Path, out: Path, given: tuple[str | None, str | None, str | None], force: bool) -> Model:
    """A model by one of the imports that take bodies and a side."""
    place = absolute(out)
    words: list[Any] = [verb, absolute(file), "--out", place]
    for name, value in zip(("--femur", "--tibia", "--side"), given, strict=True):
        words += [name, value] if value is not None else []
    words += ["--force"] if force else []
    run(*words)
    return Model(place)


def _json(path: str) -> Any:
    try:
        with open(path, encoding="utf-8") as file:
            return json.load(file)
    except OSError as error:
        raise GenuError(f"cannot read {path}: {error.strerror}", place=in_file(path)) from None
