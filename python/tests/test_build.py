"""A build, and what it leaves behind, as what the field uses."""

import hashlib
import os
import pathlib
import subprocess
import sys
from html import unescape

import numpy as np
import pytest

import genu
from genu._build import View


def digests(folder):
    """Of every file that a build leaves but those that tell times."""
    out = {}
    for path in sorted(pathlib.Path(folder).rglob("*")):
        if path.is_file() and path.name not in ("log.jsonl", ".lock"):
            out[str(path.relative_to(folder))] = hashlib.sha256(path.read_bytes()).hexdigest()
    return out


def command():
    return os.path.join(os.path.dirname(sys.executable), "build-model")


def test_stages_metrics_and_warnings(build):
    assert build.stages[0] == "ingest" and build.stages[-1] == "assemble"
    assert build.metrics["cartilage"]["femur.volume_mm3"] > 5000
    assert all(isinstance(w, str) for ws in build.warnings.values() for w in ws)
    assert build.failure is None
    assert os.path.isfile(build.report)
    assert "femur.ply" in build.files("bones")
    assert build.sources == []


def test_progress_tells_every_stage_and_never_goes_back(build, events):
    assert [s for s in dict.fromkeys(e[0] for e in events)] == build.stages
    shares = [e[1] for e in events]
    assert shares == sorted(shares) and 0 <= shares[0] and shares[-1] <= 1


def test_a_surface_opens_in_trimesh_and_pyvista(build):
    surface = build.surface("cartilage", "femur")
    assert surface.vertices.dtype == np.float64 and surface.vertices.shape[1] == 3
    assert surface.faces.max() == len(surface.vertices) - 1
    assert surface.point_data["thickness_mm"].shape == (len(surface.vertices),)
    trimesh = pytest.importorskip("trimesh")
    mesh = surface.to_trimesh()
    assert isinstance(mesh, trimesh.Trimesh) and mesh.is_watertight and mesh.is_winding_consistent
    volume = build.metrics["cartilage"]["femur.volume_mm3"]
    assert mesh.volume == pytest.approx(volume, rel=1e-6)
    pytest.importorskip("pyvista")
    poly = surface.to_pyvista()
    assert poly.n_cells == len(surface.faces) and poly.volume == pytest.approx(volume, rel=1e-3)
    assert "thickness_mm" in poly.point_data


def test_a_surface_is_what_another_reader_reads(build):
    trimesh = pytest.importorskip("trimesh")
    path = build.path("bones", "femur.ply")
    theirs = trimesh.load(path, process=False)
    ours = genu.read_surface(path)
    assert np.array_equal(theirs.faces, ours.faces) and np.allclose(theirs.vertices, ours.vertices)


def test_hexahedra_open_in_meshio_and_pyvista(build, tmp_path):
    hexahedra = build.hexahedra("tibia_medial")
    assert len(hexahedra.cells) == build.metrics["overclosure"]["tibia_medial.elements"]
    assert hexahedra.cell_data["scaled_jacobian"].min() == pytest.approx(
        build.metrics["overclosure"]["tibia_medial.scaled_jacobian_min"], abs=1e-6
    )
    meshio = pytest.importorskip("meshio")
    mesh = hexahedra.to_meshio()
    mesh.write(tmp_path / "tibia.inp")
    assert len(meshio.read(tmp_path / "tibia.inp").cells_dict["hexahedron"]) == len(hexahedra.cells)
    theirs = meshio.read(build.path("overclosure", "tibia_medial.vtu"))
    assert np.array_equal(theirs.cells_dict["hexahedron"], hexahedra.cells)
    assert np.allclose(theirs.points, hexahedra.points)
    pytest.importorskip("pyvista")
    assert hexahedra.to_pyvista().n_cells == len(hexahedra.cells)


def test_frames_and_transforms_are_matrices(build):
    frames = build.frames
    for matrix in (frames.femur, frames.tibia):
        assert matrix.shape == (4, 4)
        assert np.allclose(matrix[:3, :3].T @ matrix[:3, :3], np.eye(3), atol=1e-9)
    assert set(frames.pose) >= {"fe_deg", "vv_deg", "ie_deg", "ml_mm", "ap_mm", "si_mm"}
    for matrix in build.transforms.values():
        assert np.linalg.det(matrix) == pytest.approx(1.0) and np.allclose(matrix[3], [0, 0, 0, 1])


def test_tables_are_frames(build):
    pytest.importorskip("pandas")
    assert len(build.fibres) == 30 and set(build.fibres["source"]) <= {"marked", "literature", "given"}
    assert {"ligament", "bone", "centroid"} <= set(build.sites.columns)
    assert list(build.summary()["stage"]) == build.stages


def test_the_command_makes_the_same_bytes(specimen, build, tmp_path):
    subprocess.run([command(), specimen, "--out", tmp_path / "build", "--to", "assemble", "--quiet"], check=True)
    ours, theirs = digests(build.folder), digests(tmp_path / "build")
    assert ours == theirs and len(ours) > 40


def test_options_threads_and_the_last_stage(specimen, build, tmp_path):
    one = genu.build(
        specimen, out=tmp_path / "build", to="bones", options={"bones": {"edge_mm": 2.5}}, jobs=1
    )
    assert one.stages == ["ingest", "register", "bones"]
    assert one.metrics["bones"]["femur.edge_p50_mm"] > 1.3 * build.metrics["bones"]["femur.edge_p50_mm"]
    with pytest.raises(genu.UsageError, match="edge_mn"):
        genu.build(specimen, out=tmp_path / "other", options={"bones.edge_mn": 2.0})


def test_the_knee_that_can_be_pulled_at_stands_in_a_frame(build):
    with pytest.raises(genu.InputError, match="was not calibrated"):
        build.view()
    page = "<!doctype html><html><head></head><body><p title='a \"b\"'>&amp;</p></body></html>"
    html = View(page, 700)._repr_html_()
    inside = html.split("srcdoc='", 1)[1].split("'", 1)[0]
    assert html.startswith("<iframe") and "height:700px" in html
    assert unescape(inside).replace("<script>location.hash = 'live&';</script>", "") == page


def test_what_is_not_there_is_told(build, tmp_path):
    with pytest.raises(genu.InputError, match="femur, tibfib"):
        build.surface("bones", "patella")
    with pytest.raises(genu.InputError, match="has not been run"):
        build.path("calibrate")
    with pytest.raises(genu.InputError, match="no build in"):
        genu.Build(tmp_path)
    (tmp_path / "a.ply").write_text("ply\nformat ascii 1.0\nend_header\n")
    with pytest.raises(genu.InputError) as told:
        genu.read_surface(tmp_path / "a.ply")
    assert told.value.file == str(tmp_path / "a.ply")
    whole = pathlib.Path(build.path("bones", "femur.ply")).read_bytes()
    (tmp_path / "cut.ply").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(genu.InputError, match="cut off"):
        genu.read_surface(tmp_path / "cut.ply")
    (tmp_path / "a.vtu").write_text("<VTKFile>")
    with pytest.raises(genu.InputError, match="a.vtu"):
        genu.read_hexahedra(tmp_path / "a.vtu")
