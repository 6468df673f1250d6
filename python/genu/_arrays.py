"""A specimen's folder written from arrays."""

from __future__ import annotations

import csv
import os
import shutil
from dataclasses import dataclass, field
from typing import Any, Mapping, Sequence

import numpy as np

from genu._call import Files, absolute, run, toml
from genu._errors import InputError, in_file, writing
from genu._tables import table_at
from genu._types import Array, Path

# a Surface, whatever has vertices and faces (trimesh), or a pair of arrays
SurfaceLike = Any

_BONES = ("femur", "tibfib", "patella")
_CARTILAGE = ("femur", "tibia_medial", "tibia_lateral")


def arrays_of(name: str, given: SurfaceLike) -> tuple[Array, Array]:
    """Vertices (n, 3) [mm] and faces (m, 3) of whatever holds them, checked."""
    pair: Any = (given.vertices, given.faces) if hasattr(given, "faces") else given
    try:
        both = tuple(pair)
        hidden = sum(int(np.sum(a.mask)) for a in both if isinstance(a, np.ma.MaskedArray))
        vertices, faces = (np.asarray(a) for a in both)
    except (TypeError, ValueError):
        raise InputError(f"{name}: a surface, or a pair of arrays (vertices, faces), was expected, not {type(given).__name__}") from None
    if hidden:
        raise InputError(f"{name}: {hidden} masked numbers, which were not measured; leave out their vertices and the faces of these")
    if vertices.ndim != 2 or vertices.shape[1] != 3 or vertices.dtype.kind not in "fiu" or not np.isfinite(vertices).all():
        raise InputError(f"{name}: vertices of shape {vertices.shape}, {vertices.dtype}; finite numbers of shape (n, 3) [mm] were expected")
    if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu":
        raise InputError(f"{name}: faces of shape {faces.shape}, {faces.dtype}; whole numbers of shape (m, 3) were expected")
    if len(faces) == 0 or faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(f"{name}: faces name vertices from 0 to {len(vertices) - 1}; others were given, or none")
    return vertices.astype("<f8"), faces.astype("<i4")


def written(path: str, name: str, given: SurfaceLike) -> None:
    """A surface as binary PLY."""
    vertices, faces = arrays_of(name, given)
    head = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\nproperty double x\nproperty double y\nproperty double z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.empty(len(faces), dtype=[("count", "u1"), ("list", "<i4", (3,))])
    rows["count"], rows["list"] = 3, faces
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "wb") as file:
        file.write(head.encode() + vertices.tobytes() + rows.tobytes())


def copied(given: str, path: str, data: str) -> None:
    """A table's file, as it is."""
    try:
        with open(given, "rb") as table:
            content = table.read()
    except OSError as error:
        raise InputError(f"laxity.{data}: cannot read {given}: {error.strerror}", place=in_file(given)) from None
    with open(path, "wb") as file:
        file.write(content)


def _known(what: str, given: Mapping[str, Any], known: Sequence[str], needed: Sequence[str]) -> None:
    for name in given:
        if name not in known:
            raise InputError(f"{what}: {name} is not known; expected {', '.join(known)}")
    missing = [name for name in needed if name not in given]
    if missing:
        raise InputError(f"{what}: {', '.join(missing)} missing")


@dataclass(frozen=True)
class Given:
    """What a specimen is made of, as it was given."""

    side: str
    name: str
    bones: Mapping[str, SurfaceLike]
    scans: Mapping[str, SurfaceLike] = field(default_factory=dict)
    cartilage: Mapping[str, SurfaceLike] = field(default_factory=dict)
    landmarks: Mapping[str, Sequence[float]] = field(default_factory=dict)
    laxity: Mapping[str, Any] = field(default_factory=dict)


def _checked(given: Given) -> None:
    _known("bones", given.bones, _BONES, ("femur", "tibfib"))
    _known("scans", given.scans, _BONES, ("femur", "tibfib") if given.scans else ())
    _known("cartilage", given.cartilage, _CARTILAGE, _CARTILAGE if given.cartilage else ())
    if given.side not in ("left", "right"):
        raise InputError(f"side is {given.side!r}; left or right was expected")
    if not given.scans and not given.cartilage:
        raise InputError("neither scans nor cartilage was given, and bones alone do not show cartilage; expected scans={...} or cartilage={...}")
    for data in given.laxity:
        if not data.replace("_", "").replace("-", "").isalnum():
            raise InputError(f"laxity: {data!r} is no name of a data set; letters, digits, _ and - were expected")


def specimen_of(folder: Path, given: Given) -> tuple[str, str]:
    """Writes the folder, whole or not at all; gives its path and what a check says of it."""
    _checked(given)
    place = absolute(folder)
    if os.path.isdir(place) and os.listdir(place):
        raise InputError(f"{place} is not empty; give a new folder", place=in_file(place))
    if os.path.lexists(place) and not os.path.isdir(place):
        raise InputError(f"{place} is no folder; give a new one", place=in_file(place))
    made = not os.path.isdir(place)
    try:
        with writing(place):
            _write(place, given)
        return place, _judged(place)
    except BaseException:
        shutil.rmtree(place, ignore_errors=True)
        if not made:
            os.makedirs(place, exist_ok=True)
        raise


def _judged(place: str) -> str:
    """What a check says. Where an input is at fault, the folder stands as asked for, and the words tell it."""
    try:
        return run("check", place)
    except InputError as error:
        return str(error)


def _write(place: str, given: Given) -> None:
    lines = ["[specimen]", f"id = {toml(given.name)}", f"side = {toml(given.side)}"]
    for table, surfaces in (("ct", given.bones), ("scans", given.scans), ("cartilage", given.cartilage)):
        if surfaces:
            lines += ["", f"[{table}]"]
        for part, surface in surfaces.items():
            written(os.path.join(place, table, f"{part}.ply"), f"{table}.{part}", surface)
            lines.append(f"{part} = {toml(f'{table}/{part}.ply')}")
    if given.cartilage:
        lines.append('frame = "ct"')
    if given.landmarks:
        lines += ["", "[points]", 'landmarks = "landmarks.csv"']
        _write_landmarks(os.path.join(place, "landmarks.csv"), given.landmarks)
    if given.laxity:
        lines += ["", "[laxity]"]
        lines += _write_laxity(place, given.laxity)
    with open(os.path.join(place, "specimen.toml"), "w", encoding="utf-8") as toml_file:
        toml_file.write("\n".join(lines) + "\n")


def _write_landmarks(path: str, landmarks: Mapping[str, Sequence[float]]) -> None:
    with open(path, "w", encoding="utf-8", newline="") as points:
        rows = csv.writer(points, lineterminator="\n")
        rows.writerow(["name", "frame", "x_mm", "y_mm", "z_mm"])
        for point, place_mm in landmarks.items():
            numbers = np.asarray(place_mm, dtype=float)
            if numbers.shape != (3,) or not np.isfinite(numbers).all():
                raise InputError(f"landmarks: {point} is {place_mm!r}; three finite numbers [mm] were expected")
            rows.writerow([point, "ct", *(repr(float(x)) for x in numbers)])


def _write_laxity(place: str, laxity: Mapping[str, Any]) -> list[str]:
    """Writes each table; gives its line of specimen.toml."""
    lines = []
    os.makedirs(os.path.join(place, "laxity"), exist_ok=True)
    for data, table in laxity.items():
        files: Files = {}
        at = table_at(table, data, files)
        path = os.path.join(place, "laxity", f"{data}.csv")
        if at in files:
            with open(path, "wb") as file:
                file.write(files[at])
        else:
            copied(at, path, data)
        lines.append(f"{data} = {toml(f'laxity/{data}.csv')}")
    return lines
