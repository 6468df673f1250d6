"""What a knee's model is asked: a reconstruction before it is done, which tests to do next, what speaks for it."""

from __future__ import annotations

import json
import os
import tempfile
from dataclasses import dataclass, field
from typing import Any, Mapping, Optional, Sequence, Union, overload

from genu._build import Build
from genu._call import Files, absolute, as_html, called, names, toml_text
from genu._model import ModelLike, model_at
from genu._tables import read_table
from genu._types import (
    Chance, Context, Evidence, Factor, FactorName, Grade, Frame, GraftPlan, GraftTold, Level, NextTest, Path, Place, PlanTest, Progress,
    RankedPlan, Spread, State, SweepKey, SweepLists, TestTold, Value,
)


def _toml_at(table: Union[Path, Mapping[str, Any]], name: str, files: Files) -> str:
    """The path at which the program finds a file of TOML: as given, or ``name``, whose text goes into ``files``."""
    if isinstance(table, (str, os.PathLike)):
        return absolute(table)
    files[name] = toml_text(table).encode()
    return name


@dataclass
class Plan:
    """What :func:`plan` found.

    Attributes
    ----------
    folder : str
        Where plan.json, plan.csv and plan.html are.
    raw : dict
        plan.json as it stands.
    """

    folder: str
    raw: dict[str, Any] = field(repr=False)

    @property
    def tests(self) -> list[TestTold]:
        """Every test with its values by state."""
        found: list[TestTold] = self.raw["tests"]
        return found

    @property
    def grafts(self) -> list[GraftTold]:
        """The grafts, as fixed."""
        found: list[GraftTold] = self.raw["grafts"]
        return found

    @property
    def planned(self) -> dict[str, Any]:
        """What was planned: graft.toml with the defaults of all that it leaves out."""
        found: dict[str, Any] = self.raw["planned"]
        return found

    @property
    def chances(self) -> list[Chance]:
        """How likely the knee is restored."""
        found: list[Chance] = self.raw["chances"]
        return found

    @property
    def samples(self) -> int:
        """Samples of the posterior by which intervals stand; 0 where there are none."""
        return int(self.raw["samples"])

    @property
    def warnings(self) -> list[str]:
        """What is odd, in sentences; ``raw["notices"]`` has the same as values."""
        found: list[str] = self.raw["warnings"]
        return found

    @property
    def page(self) -> str:
        """The path of plan.html."""
        return os.path.join(self.folder, "plan.html")

    def value(self, test: PlanTest, flexion_deg: float, state: State, quantity: str = "laxity") -> Value:
        """A number of a state in a test.

        Parameters
        ----------
        test : str
            Such as ``"anterior drawer"``.
        flexion_deg : float
            One of those at which the plan tests [deg].
        state : str
            ``"intact"``, ``"deficient"`` or ``"reconstructed"``.
        quantity : str
            ``"laxity"``, ``"ap_mm"``, ``"contact_medial_force_n"``, ``"graft_NAME_n"``, ...

        Raises
        ------
        KeyError
            No such test, state or quantity.
        """
        for one in self.tests:
            if one["test"] == test and one["flexion_deg"] == flexion_deg:
                return one["states"][state][quantity]
        raise KeyError(f"no {test} at {flexion_deg} deg in this plan")

    def table(self) -> Frame:
        """plan.csv as a pandas frame: a row a value."""
        return read_table(os.path.join(self.folder, "plan.csv"))

    def _repr_html_(self) -> str:
        return as_html("genu.Plan", {c["of"]: c["chance"] if c["chance"] is not None else c["most_probable"] for c in self.chances})


@dataclass
class Sweep:
    """What :func:`plan` found of many plans.

    Attributes
    ----------
    folder : str
        Where sweep.csv, sweep.json and sweep.html are.
    raw : dict
        sweep.json as it stands.
    """

    folder: str
    raw: dict[str, Any] = field(repr=False)

    @property
    def best(self) -> list[RankedPlan]:
        """The best plans by rank, at most twenty, each with its choices and numbers."""
        found: list[RankedPlan] = self.raw["best"]
        return found

    @property
    def graft(self) -> str:
        """The graft that is varied."""
        return str(self.raw["graft"])

    @property
    def varied(self) -> dict[SweepKey, list[float]]:
        """The choices, and the values of each."""
        found: dict[SweepKey, list[float]] = self.raw["varied"]
        return found

    @property
    def plans(self) -> int:
        """How many plans were asked."""
        return int(self.raw["plans"])

    @property
    def done(self) -> int:
        """How many of them could be done; of each other the table has a ``fault``."""
        return int(self.raw["done"])

    @property
    def samples(self) -> int:
        """Samples of the posterior by which chances and intervals stand; 0 where there are none."""
        return int(self.raw["samples"])

    @property
    def warnings(self) -> list[str]:
        """What is odd, in sentences; ``raw["notices"]`` has the same as values."""
        found: list[str] = self.raw["warnings"]
        return found

    @property
    def page(self) -> str:
        """The path of sweep.html."""
        return os.path.join(self.folder, "sweep.html")

    def table(self) -> Frame:
        """sweep.csv as a pandas frame: a row a plan, in the order of the values. ``table().sort_values("rank")`` has the best first."""
        return read_table(os.path.join(self.folder, "sweep.csv"))

    def _repr_html_(self) -> str:
        def words(one: RankedPlan) -> str:
            return ", ".join(f"{key} {value:g}" for key, value in one["choices"].items())

        count = {"plans": f"{self.plans}, {self.done} could be done", "samples": self.samples}
        return as_html("genu.Sweep", {**count, **{f"rank {one['rank']}": words(one) for one in self.best[:3]}})


@overload
def plan(
    model: ModelLike,
    graft: Union[Path, GraftPlan],
    out: Path,
    *,
    sweep: None = None,
    samples: Optional[int] = None,
    seed: Optional[int] = None,
    force: bool = False,
    jobs: Optional[int] = None,
    progress: Progress = None,
) -> Plan: ...
@overload
def plan(
    model: ModelLike,
    graft: Union[Path, GraftPlan],
    out: Path,
    *,
    sweep: Union[Path, SweepLists],
    samples: Optional[int] = None,
    seed: Optional[int] = None,
    force: bool = False,
    jobs: Optional[int] = None,
    progress: Progress = None,
) -> Sweep: ...
def plan(
    model: ModelLike,
    graft: Union[Path, GraftPlan],
    out: Path,
    *,
    sweep: Union[None, Path, SweepLists] = None,
    samples: Optional[int] = None,
    seed: Optional[int] = None,
    force: bool = False,
    jobs: Optional[int] = None,
    progress: Progress = None,
) -> Union[Plan, Sweep]:
    """Plan a ligament's reconstruction: cut, graft, and what the knee does then; or many plans that differ in the choices of one graft.

    Parameters
    ----------
    model : Model, Build, Calibration, str or path-like
        The knee.
    graft : dict, str or path-like
        What is cut and put in: a path of graft.toml, or its keys as a dict, such as ``{"cut": ["ACL"], "graft": [{...}]}``.
    out : str or path-like
        Folder for plan.json, plan.csv and plan.html; of a sweep for sweep.json, sweep.csv and sweep.html.
    sweep : dict, str or path-like, optional
        Ask many plans: a path of sweep.toml, or its keys as a dict, such as ``{"tension_n": [40, 80], "at_flexion_deg": [0, 20]}``.
        Each value is asked with each value of the others.
    samples : int, optional
        Samples of the posterior by which mean and 90 % interval are told, where the model has any; 0 leaves them out.
    seed : int, optional
        Draws which samples are asked; the first where None.
    force : bool
        Write over files in ``out`` that were changed since, or that no such call wrote; else they are an :class:`InputError`.
    jobs, progress
        As in :func:`build`.

    Returns
    -------
    Plan, or Sweep where ``sweep`` is given

    Raises
    ------
    InputError
        The plan, the sweep or the model is at fault; ``file`` and ``row`` say where. From memory they are called ``graft`` and ``sweep``.
        Also a sweep of which no plan can be done: then sweep.csv in ``out`` has why, plan by plan.
    UsageError
    """
    place = absolute(out)
    path, files = model_at(model)
    words: list[Any] = ["plan", path, _toml_at(graft, "graft", files), "--out", place, "--json"]
    words += ["--sweep", _toml_at(sweep, "sweep", files)] if sweep is not None else []
    words += ["--samples", samples] if samples is not None else []
    words += ["--seed", seed] if seed is not None else []
    words += ["--force"] if force else []
    found = json.loads(called(words, files, jobs=jobs, progress=progress))
    return Plan(place, found) if sweep is None else Sweep(place, found)


@dataclass
class NextTests:
    """What :func:`next_tests` found.

    Attributes
    ----------
    raw : dict
        What ``next-tests --json`` tells.
    trials : pandas.DataFrame
        The tests as trials without readings, of each flexion the unloaded knee first; :func:`simulate` reads them.
    """

    raw: dict[str, Any] = field(repr=False)
    trials: Frame = field(repr=False)

    @property
    def tests(self) -> list[NextTest]:
        """The tests, the most telling first."""
        found: list[NextTest] = self.raw["tests"]
        return found

    @property
    def spread(self) -> list[Spread]:
        """What is wanted, number by number: how well it is known now, and with the tests."""
        found: list[Spread] = self.raw["spread"]
        return found

    @property
    def samples(self) -> int:
        """Samples of the posterior that count."""
        return int(self.raw["samples"])

    @property
    def warnings(self) -> list[str]:
        """What is odd, in sentences; ``raw["notices"]`` has the same as values."""
        found: list[str] = self.raw["warnings"]
        return found

    def _repr_html_(self) -> str:
        rows = {f"{t['test']} at {t['flexion_deg']} deg": f"{100 * t['left']:.0f} % of the spread is left" for t in self.tests}
        return as_html(f"genu.NextTests for {self.raw['wanted']}", rows)


def next_tests(
    model: ModelLike,
    quantity: str,
    *,
    without: Union[str, Sequence[str]] = (),
    count: Optional[int] = None,
    single: bool = False,
    noise_deg: Optional[float] = None,
    noise_mm: Optional[float] = None,
    compression_n: Optional[float] = None,
    samples: Optional[int] = None,
    out: Optional[Path] = None,
    force: bool = False,
    jobs: Optional[int] = None,
    progress: Progress = None,
) -> NextTests:
    """Choose the laxity tests that, done together, would narrow a force or a motion of a calibrated knee most.

    Parameters
    ----------
    model : Model, Build, Calibration, str or path-like
        A calibrated knee, as it was calibrated: an edited one has no samples.
    quantity : str
        A ligament or bundle, such as ``"ACL"``, for its force in the drawers of 133 N; or ``"drawer"``, or ``"pivot-shift"``.
    without : str or sequence of str
        Bundles or ligaments that are cut where the quantity is asked; the tests are done on the knee as it is.
    count : int, optional
        Most tests, 1 to 12; 6 where None.
    single : bool
        One load a test; without it two may act at once.
    noise_deg, noise_mm : float, optional
        Noise of a measured angle [deg] and shift [mm], one standard deviation; that of laxity files which state none where None.
    compression_n : float, optional
        Compression of the joint in the tests [N]; 20 where None.
    samples : int, optional
        Samples of the posterior.
    out : str or path-like, optional
        Also write the trials to this file (CSV).
    force : bool
        Write over that file where it was changed since, or where no such call wrote it; else it is an :class:`InputError`.
    jobs, progress
        As in :func:`build`.

    Returns
    -------
    NextTests

    Raises
    ------
    InputError
        The model has no samples of a posterior.
    UsageError
        An unknown quantity, or a number out of its range.
    """
    path, files = model_at(model)
    words: list[Any] = ["next-tests", path, "--for", quantity, "--json"]
    words += ["--without", ",".join(names(without))] if names(without) else []
    words += ["--single"] if single else []
    words += ["--force"] if force else []
    given = {"count": count, "noise-deg": noise_deg, "noise-mm": noise_mm, "compression": compression_n, "samples": samples}
    for name, value in given.items():
        words += [f"--{name}", value] if value is not None else []
    with tempfile.TemporaryDirectory() as own:
        file = absolute(out) if out is not None else os.path.join(own, "trials.csv")
        found = json.loads(called([*words, "--out", file], files, jobs=jobs, progress=progress))
        found["file"] = file if out is not None else None
        return NextTests(found, read_table(file))


@dataclass
class Credibility:
    """What :func:`credibility` found.

    Attributes
    ----------
    folder : str
        Where credibility.json and credibility.html are.
    raw : dict
        credibility.json as it stands.
    """

    folder: str
    raw: dict[str, Any] = field(repr=False)

    @property
    def factors(self) -> list[Factor]:
        """The factors of ASME V&V 40 in their order, each with its evidence."""
        found: list[Factor] = self.raw["factors"]
        return found

    @property
    def risk(self) -> Optional[Level]:
        """Model risk by influence and consequence; None where the context does not state both."""
        found: Optional[Level] = self.raw["model_risk"]
        return found

    @property
    def page(self) -> str:
        """The path of credibility.html."""
        return os.path.join(self.folder, "credibility.html")

    def factor(self, name: FactorName) -> Factor:
        """A factor, such as ``"model-inputs"``."""
        for one in self.factors:
            if one["factor"] == name:
                return one
        raise KeyError(f"no factor {name}; there are {', '.join(f['factor'] for f in self.factors)}")

    def grade(self, name: FactorName) -> Grade:
        """The grade of a factor: that of its weakest evidence."""
        return self.factor(name)["grade"]

    @property
    def evidence(self) -> list[Evidence]:
        """Every piece of evidence, factor by factor; ``pandas.DataFrame(found.evidence)`` is a table of it."""
        return [one for factor in self.factors for one in factor["evidence"]]

    def _repr_html_(self) -> str:
        return as_html(f"genu.Credibility of {self.raw['knee']}", {f["name"]: f["grade"] for f in self.factors})


def credibility(
    build: Place, *, context: Union[None, Path, Context] = None, out: Optional[Path] = None, force: bool = False
) -> Credibility:
    """Tell what speaks for a knee's model, factor by factor as ASME V&V 40 asks.

    Parameters
    ----------
    build : Build, str or path-like
        A build, or the folder of it or of the specimen that holds it.
    context : dict, str or path-like, optional
        Question, context of use and risk of the model: a file of TOML, or its keys as a dict, such as
        ``{"influence": "medium", "consequence": "low"}``. Where None, credibility.toml of the specimen, if it is there.
    out : str or path-like, optional
        Folder for credibility.html and credibility.json; that of the build where None.
    force : bool
        Write over files in ``out`` that were changed since, or that no such call wrote; else they are an :class:`InputError`.

    Returns
    -------
    Credibility

    Raises
    ------
    InputError
        No build there, or a context that cannot be read.
    """
    files: Files = {}
    found = build if isinstance(build, Build) else Build(build)
    words: list[Any] = ["credibility", found.folder, "--json"]
    words += ["--context", _toml_at(context, "context", files)] if context is not None else []
    words += ["--out", absolute(out)] if out is not None else []
    words += ["--force"] if force else []
    return Credibility(absolute(out) if out is not None else found.folder, json.loads(called(words, files)))
