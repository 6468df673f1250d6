"""Surfaces and hexahedra of a build as arrays, and as the objects of other packages."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from genu._call import as_html, wanted
from genu._errors import InputError, in_file
from genu._types import Array, Path

_PLY = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "<i2", "int16": "<i2", "ushort": "<u2", "uint16": "<u2",
    "int": "<i4", "int32": "<i4", "uint": "<u4", "uint32": "<u4", "float": "<f4", "float32": "<f4", "double": "<f8", "float64": "<f8",
}
_VTK_HEXAHEDRON = 12


@dataclass(eq=False)
class Surface:
    """A surface of triangles.

    Attributes
    ----------
    vertices : ndarray, shape (n, 3), float64
        Positions [mm], CT frame.
    faces : ndarray, shape (m, 3), int64
        Vertices of each triangle, counter-clockwise from outside.
    point_data : dict of ndarray, shape (n,)
        What is known of each vertex, such as ``thickness_mm``.
    name : str
        The file's name without its ending.
    """

    vertices: Array
    faces: Array
    point_data: dict[str, Array] = field(default_factory=dict)
    name: str = ""

    def __eq__(self, other: object) -> bool:
        """Whether vertices, faces and point data are the same numbers; the name does not matter."""
        if not isinstance(other, Surface):
            return NotImplemented
        return _same((self.vertices, self.faces), (other.vertices, other.faces)) and _same_data(self.point_data, other.point_data)

    __hash__ = None  # type: ignore[assignment]  # arrays change

    def _repr_html_(self) -> str:
        data = ", ".join(self.point_data) or "none"
        return as_html("genu.Surface", {"name": self.name, "vertices": len(self.vertices), "faces": len(self.faces), "point data": data})

    def to_trimesh(self) -> Any:
        """The surface as ``trimesh.Trimesh``, its vertices as they are; ``vertex_attributes`` hold the point data."""
        trimesh = wanted("trimesh", "surfaces")
        return trimesh.Trimesh(self.vertices, self.faces, vertex_attributes=dict(self.point_data), process=False)

    def to_pyvista(self) -> Any:
        """The surface as ``pyvista.PolyData`` with its point data."""
        pyvista = wanted("pyvista", "view")
        threes = np.full((len(self.faces), 1), 3, dtype=np.int64)
        mesh = pyvista.PolyData(self.vertices, np.hstack([threes, self.faces]).ravel())
        for name, values in self.point_data.items():
            mesh.point_data[name] = values
        return mesh

    def to_meshio(self) -> Any:
        """The surface as ``meshio.Mesh`` with cells ``triangle``."""
        meshio = wanted("meshio", "meshes")
        return meshio.Mesh(self.vertices, [("triangle", self.faces)], point_data=dict(self.point_data))


@dataclass(eq=False)
class Hexahedra:
    """A mesh of hexahedra.

    Attributes
    ----------
    points : ndarray, shape (n, 3), float64
        Nodes [mm], CT frame.
    cells : ndarray, shape (m, 8), int64
        Nodes of each element, in the order of VTK and Abaqus.
    cell_data : dict of ndarray, shape (m,)
        What is known of each element, such as ``scaled_jacobian``.
    name : str
        The file's name without its ending.
    """

    points: Array
    cells: Array
    cell_data: dict[str, Array] = field(default_factory=dict)
    name: str = ""

    def __eq__(self, other: object) -> bool:
        """Whether points, cells and cell data are the same numbers; the name does not matter."""
        if not isinstance(other, Hexahedra):
            return NotImplemented
        return _same((self.points, self.cells), (other.points, other.cells)) and _same_data(self.cell_data, other.cell_data)

    __hash__ = None  # type: ignore[assignment]  # arrays change

    def _repr_html_(self) -> str:
        data = ", ".join(self.cell_data) or "none"
        return as_html("genu.Hexahedra", {"name": self.name, "points": len(self.points), "cells": len(self.cells), "cell data": data})

    def to_meshio(self) -> Any:
        """The mesh as ``meshio.Mesh`` with cells ``hexahedron``; its ``write`` knows VTU, Abaqus, Gmsh and more."""
        meshio = wanted("meshio", "meshes")
        data = {name: [values] for name, values in self.cell_data.items()}
        return meshio.Mesh(self.points, [("hexahedron", self.cells)], cell_data=data)

    def to_pyvista(self) -> Any:
        """The mesh as ``pyvista.UnstructuredGrid`` with its cell data."""
        pyvista = wanted("pyvista", "view")
        grid = pyvista.UnstructuredGrid({_VTK_HEXAHEDRON: self.cells}, self.points)
        for name, values in self.cell_data.items():
            grid.cell_data[name] = values
        return grid


def _same(a: tuple[Array, ...], b: tuple[Array, ...]) -> bool:
    return all(np.array_equal(x, y) for x, y in zip(a, b))


def _same_data(a: dict[str, Array], b: dict[str, Array]) -> bool:
    # a number that is not known is the same as one that is not known
    return a.keys() == b.keys() and all(np.array_equal(a[k], b[k], equal_nan=a[k].dtype.kind == "f") for k in a)


def read_surface(path: Path) -> Surface:
    """Read a surface as Genu writes it: binary PLY of triangles.

    Parameters
    ----------
    path : str or path-like
        A ``.ply`` of a build.

    Returns
    -------
    Surface

    Raises
    ------
    InputError
        No such file, or not such a PLY.
    """
    path = os.fspath(path)
    raw = _bytes(path)
    end = raw.find(b"end_header\n")
    if not raw.startswith(b"ply") or end < 0 or b"format binary_little_endian" not in raw[:end]:
        raise InputError(f"{path}: not a binary little-endian PLY; a surface as build-model writes it was expected", place=in_file(path))
    elements: list[tuple[str, int, list[list[str]]]] = []
    for line in raw[:end].decode("ascii", "replace").splitlines():
        words = line.split()
        if words[:1] == ["element"]:
            elements.append((words[1], int(words[2]), []))
        elif words[:1] == ["property"] and elements:
            elements[-1][2].append(words[1:])
    at = end + len(b"end_header\n")
    found: dict[str, Array] = {}
    for name, count, properties in elements:
        dtype = _ply_type(path, properties)
        if at + count * dtype.itemsize > len(raw):
            raise InputError(f"{path}: cut off: {count} of element {name} were expected", place=in_file(path))
        found[name] = np.frombuffer(raw, dtype, count, at)
        at += count * dtype.itemsize
    if "vertex" not in found or "face" not in found:
        raise InputError(f"{path}: no elements vertex and face; a surface was expected", place=in_file(path))
    vertex, face = found["vertex"], found["face"]
    if len(face) and not (face["count"] == 3).all():
        raise InputError(f"{path}: faces that are not triangles", place=in_file(path))
    vertices = np.column_stack([vertex[c] for c in "xyz"]).astype(np.float64)
    data = {name: np.array(vertex[name]) for name in vertex.dtype.names or () if name not in ("x", "y", "z")}
    return Surface(vertices, face["list"].astype(np.int64), data, _stem(path))


def _ply_type(path: str, properties: list[list[str]]) -> np.dtype[Any]:
    fields: list[Any] = []
    for words in properties:
        if words[0] == "list":
            fields += [("count", _PLY[words[1]]), ("list", _PLY[words[2]], (3,))]
        elif words[0] in _PLY:
            fields.append((words[1], _PLY[words[0]]))
        else:
            raise InputError(f"{path}: property of the unknown type {words[0]}", place=in_file(path))
    return np.dtype(fields)


def read_hexahedra(path: Path) -> Hexahedra:
    """Read a hexahedral mesh as Genu writes it: VTU in text.

    Parameters
    ----------
    path : str or path-like
        A ``.vtu`` of a build.

    Returns
    -------
    Hexahedra

    Raises
    ------
    InputError
        No such file, or not such a VTU.
    """
    path = os.fspath(path)
    try:
        piece = ElementTree.fromstring(_bytes(path)).find("UnstructuredGrid/Piece")
    except ElementTree.ParseError as error:
        raise InputError(f"{path}: {error}; a VTU as build-model writes it was expected", place=in_file(path)) from None
    points = None if piece is None else piece.find("Points/DataArray")
    connectivity = None if piece is None else piece.find("Cells/DataArray[@Name='connectivity']")
    if piece is None or points is None or connectivity is None or points.get("format") != "ascii":
        raise InputError(f"{path}: not an unstructured grid in text; a VTU as build-model writes it was expected", place=in_file(path))
    data = {a.get("Name", ""): _numbers(a, float) for a in piece.findall("CellData/DataArray")}
    try:
        nodes, cells = _numbers(points, float).reshape(-1, 3), _numbers(connectivity, np.int64).reshape(-1, 8)
    except ValueError:
        raise InputError(f"{path}: cells that are not hexahedra", place=in_file(path)) from None
    return Hexahedra(nodes, cells, data, _stem(path))


def _numbers(array: ElementTree.Element, kind: Any) -> Array:
    return np.array((array.text or "").split(), dtype=kind)


def _bytes(path: str) -> bytes:
    try:
        with open(path, "rb") as file:
            return file.read()
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}", place=in_file(path)) from None


def _stem(path: str) -> str:
    return os.path.splitext(os.path.basename(path))[0]
