"""Genu: from what a laboratory measures of a knee to a model of that knee.

The functions do what the command ``build-model`` does, with the same bytes, in the process of Python.
Lengths are millimetres, angles degrees, forces newtons, moments newton-metres.

Build a knee, and look at what was made::

    import genu

    genu.phantom("S192803-phantom", "knee")              # a synthetic specimen, with its truth
    build = genu.build("knee", progress=True)
    build.metrics["cartilage"]["femur.volume_mm3"]
    build.surface("cartilage", "femur").to_trimesh()      # or .vertices, .faces, .to_pyvista()
    build.hexahedra("femur").to_meshio()
    build.frames.femur                                    # 4 x 4, CT from femur

Load its model, change a number, calibrate it::

    model = build.model
    model.bundle("ACL_AM")["stiffness_n_per_mm"] *= 1.1
    poses = genu.simulate(model, trials)                  # pandas in, pandas out
    fit = genu.calibrate(model, measured, out="calibrated")

Functions
---------
init, check, phantom
    Make a specimen's folder, judge its inputs; make a synthetic specimen.
build, inspect, options
    Make a build from a specimen's folder; what its stages made; what may be set.
cohort, cohort_infer
    Many builds on one page and in tables; what each knee's calibration says to the others.
simulate, calibrate, validate, diagnose, export, import_abaqus, import_opensim, import_febio
    Work with a model.
plan, next_tests, credibility
    A reconstruction before it is done, or many of which the best are sought; which tests to do next; what speaks for a knee's model.
read_surface, read_hexahedra, read_table
    Open single files of a build.
to_xarray; plots.laxity, plots.forces
    Answers to a grid of trials as a dataset; pictures of answers.
run
    Any command line of ``build-model``.

Classes
-------
Build, Model, Surface, Hexahedra, Frames, Calibration, Validation, Diagnosis, Plan, Sweep, NextTests, Credibility, Check, Specimen,
Cohort

Errors
------
GenuError, with ``file``, ``row``, ``column``, ``stage``, ``code`` and ``advice``. StageError, InputError, MachineError, OptionError and
UsageError are its kinds.

Only numpy is needed. pandas, trimesh, pyvista, meshio, matplotlib and xarray are imported when a function needs them:
``pip install "./python[all]"`` in a clone brings them.
"""

from __future__ import annotations

import importlib
from typing import Any

from genu._genu import __version__

_HOMES = {
    "build": "_verbs",
    "phantom": "_verbs",
    "simulate": "_verbs",
    "calibrate": "_verbs",
    "validate": "_verbs",
    "diagnose": "_verbs",
    "export": "_verbs",
    "import_abaqus": "_verbs",
    "import_opensim": "_verbs",
    "import_febio": "_verbs",
    "Calibration": "_verbs",
    "Validation": "_verbs",
    "Diagnosis": "_verbs",
    "plan": "_asked",
    "next_tests": "_asked",
    "credibility": "_asked",
    "Plan": "_asked",
    "Sweep": "_asked",
    "NextTests": "_asked",
    "Credibility": "_asked",
    "check": "_specimens",
    "init": "_specimens",
    "inspect": "_specimens",
    "options": "_specimens",
    "cohort": "_specimens",
    "cohort_infer": "_specimens",
    "Check": "_specimens",
    "Specimen": "_specimens",
    "Cohort": "_specimens",
    "run": "_call",
    "Build": "_build",
    "Frames": "_build",
    "Model": "_model",
    "Surface": "_meshes",
    "Hexahedra": "_meshes",
    "read_surface": "_meshes",
    "read_hexahedra": "_meshes",
    "read_table": "_tables",
    "to_xarray": "_grid",
    "GenuError": "_errors",
    "StageError": "_errors",
    "InputError": "_errors",
    "MachineError": "_errors",
    "OptionError": "_errors",
    "UsageError": "_errors",
}

# Modules of their own, imported when they are first named.
_MODULES = {"plots"}

__all__ = ["__version__", *sorted({*_HOMES, *_MODULES})]


def __getattr__(name: str) -> Any:
    # numpy is imported with the first thing that needs it: the command and `import genu` start at once.
    if name in _MODULES:
        return importlib.import_module(f"genu.{name}")
    if name not in _HOMES:
        raise AttributeError(f"module 'genu' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"genu.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(_HOMES) | _MODULES)
