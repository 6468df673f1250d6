"""Words that a call takes, as types: a wrong one is told before the program runs."""

from __future__ import annotations

import os
import typing
from typing import TYPE_CHECKING, Any, Callable, Literal, Mapping, Optional, Sequence, TypedDict, Union

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import pandas

    Frame = pandas.DataFrame
else:
    Frame = Any  # pandas is imported where a function needs it

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
State = Literal["intact", "deficient", "reconstructed"]
PlanTest = Literal[
    "unloaded", "anterior drawer", "posterior drawer", "internal rotation", "external rotation", "varus", "valgus", "pivot shift",
]
SweepKey = Literal[
    "femur_depth_percent", "femur_height_percent", "tibia_front_percent", "tibia_medial_percent",
    "femur_forwards_mm", "femur_upwards_mm", "femur_lateral_mm", "tibia_forwards_mm", "tibia_upwards_mm", "tibia_lateral_mm",
    "tension_n", "at_flexion_deg", "stiffness_n_per_mm",
]
Level = Literal["low", "medium", "high"]
Grade = Literal["no-evidence", "weak", "adequate", "strong"]
FactorName = Literal[
    "code-verification", "calculation-verification", "model-form", "model-inputs", "comparator", "equivalence",
    "output-comparison", "applicability",
]
Stage = Literal[
    "segment", "ingest", "register", "bones", "cartilage", "frames", "attachments", "hexmesh", "overclosure",
    "contact-law", "assemble", "calibrate", "validate", "diagnose",
]


class HasFolder(typing.Protocol):
    """What lies in a folder: a build, a specimen, a calibration."""

    @property
    def folder(self) -> str: ...


class WritesCsv(typing.Protocol):
    """A frame of polars."""

    def write_csv(self) -> Any: ...


Place = Union[Path, HasFolder]
# A list of numbers, or an array of them.
Values = Union[Sequence[float], Array]
# A frame of pandas or polars, a dict of columns, a list of dicts, or a path.
Table = Union[Path, Frame, Mapping[Any, Any], Sequence[Mapping[Any, Any]], WritesCsv]


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
    range: Optional[list[float]]
    source: str
    meaning: str
    choices: list[str]


class SharedNumber(TypedDict):
    """What other knees say of a number: in standard deviations of its own prior, and as values at -1, 0 and 1 of them."""

    name: str
    mean: float
    sd: float
    before: list[float]
    after: list[float]


class SharedPrior(TypedDict):
    """What other knees say of a knee: the file, the share of the variance in common by sort of numbers, and what the file holds."""

    file: str
    shares: dict[Literal["strain", "stiffness", "other"], float]
    numbers: list[SharedNumber]


class InferKnee(TypedDict):
    """A knee, as :func:`genu.cohort_infer` tells it. ``next`` is the command that builds it with its prior."""

    knee: str
    specimen: str
    model: str
    informed: int
    prior: SharedPrior
    next: Optional[str]


class Site(TypedDict, total=False):
    """Where a graft leaves a bone: one of the first four keys, docs/plan.md."""

    native: str
    point_mm: Sequence[float]
    quadrant_percent: Sequence[float]
    plateau_percent: Sequence[float]
    move_mm: Sequence[float]


class _GraftPlaces(TypedDict):
    name: str
    femur: Site
    tibia: Site


class Graft(_GraftPlaces, total=False):
    """A graft as graft.toml has it: a stiffness, or cross-section and modulus; a tension, or a slack length."""

    stiffness_n_per_mm: float
    cross_section_mm2: float
    modulus_mpa: float
    free_length_mm: float
    toe_strain: float
    tension_n: float
    at_flexion_deg: float
    slack_length_mm: float


class PlanTests(TypedDict, total=False):
    """How a planned knee is tested; each key has a default."""

    flexions_deg: Sequence[float]
    passive_deg: Sequence[float]
    drawer_n: float
    rotation_nm: float
    varus_valgus_nm: float
    pivot: Sequence[float]
    compression_n: float
    restored_mm: float
    restored_deg: float


class GraftPlan(TypedDict, total=False):
    """graft.toml as a dict."""

    name: str
    cut: Sequence[str]
    graft: Sequence[Graft]
    tests: PlanTests


class SweepLists(TypedDict, total=False):
    """sweep.toml as a dict: the values of each choice, of which all combinations are asked."""

    graft: str
    map: Sequence[SweepKey]
    femur_depth_percent: Values
    femur_height_percent: Values
    tibia_front_percent: Values
    tibia_medial_percent: Values
    femur_forwards_mm: Values
    femur_upwards_mm: Values
    femur_lateral_mm: Values
    tibia_forwards_mm: Values
    tibia_upwards_mm: Values
    tibia_lateral_mm: Values
    tension_n: Values
    at_flexion_deg: Values
    stiffness_n_per_mm: Values


class RankedPlan(TypedDict):
    """One of the best plans of a sweep. ``plan`` is its number in the table, ``numbers`` are its numbers by their columns there."""

    rank: int
    plan: int
    choices: dict[SweepKey, float]
    numbers: dict[str, Optional[float]]
    flags: list[str]


class Value(TypedDict):
    """A number of the most probable knee, with mean and 90 % interval over the samples where there are any."""

    value: float
    mean: Optional[float]
    lower: Optional[float]
    upper: Optional[float]


class TestTold(TypedDict):
    """A test of a plan. ``load`` is VV, IE [N m], ML, AP, SI [N]; ``chance`` is a share of the samples, None where there are none."""

    test: PlanTest
    flexion_deg: float
    load: list[float]
    states: dict[State, dict[str, Value]]
    flags: dict[State, list[str]]
    off: dict[str, Value]
    chance: Optional[float]


class GraftTold(TypedDict):
    """A graft as it was put in."""

    name: str
    femur_mm: list[float]
    tibia_mm: list[float]
    quadrant_percent: Optional[list[float]]
    plateau_percent: Optional[list[float]]
    length_mm: float
    slack_length_mm: float
    stiffness_n_per_mm: float
    like: Optional[str]


class Fails(TypedDict):
    """The test in which a planned knee is most often unlike the intact one; ``samples``: in how many, and of how many."""

    test: str
    flexion_deg: float
    samples: Optional[list[int]]


class Chance(TypedDict):
    """How likely a planned knee is like the intact one: a share of the samples, None where there are none."""

    of: str
    chance: Optional[float]
    most_probable: bool
    fails: Optional[Fails]


class NextTest(TypedDict):
    """A laxity test to do next. ``load`` is VV, IE [N m], ML, AP, SI [N]; ``left`` the share of the spread that is left with it and those before."""

    test: str
    flexion_deg: float
    load: list[float]
    reads: list[str]
    left: float


class Spread(TypedDict):
    """How well a number is known: standard deviations."""

    quantity: str
    now: float
    then: float


class Context(TypedDict, total=False):
    """credibility.toml as a dict: what a model is for."""

    question: str
    context_of_use: str
    influence: Level
    consequence: Level
    flexion_deg: Sequence[float]


class Evidence(TypedDict):
    """One number, what made it, and what it is worth."""

    id: str
    factor: FactorName
    what: str
    value: Optional[float]
    unit: str
    limits: list[float]
    more_is_better: bool
    grade: Grade
    why: str
    stage: Optional[str]
    test: Optional[str]
    file: str
    digest: Optional[str]
    test_digest: Optional[str]
    date: Optional[str]
    as_built: Optional[bool]


class Factor(TypedDict):
    """A factor of ASME V&V 40 with its evidence; ``enough`` is None where no risk is stated."""

    factor: FactorName
    name: str
    question: str
    grade: Grade
    enough: Optional[bool]
    evidence: list[Evidence]
