"""What is done with results: samples of a posterior, pictures, grids; files that are links; the parts of an error."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

import genu

pandas = pytest.importorskip("pandas")


def test_samples_are_those_of_the_file(calibration, model, build):
    with open(os.path.join(calibration.folder, "samples.json"), encoding="utf-8") as file:
        raw = json.load(file)
    found = calibration.model.samples
    assert list(found.columns) == [one["name"] for one in raw["unknowns"]] and len(found) == len(raw["unknowns"][0]["samples"])
    first = raw["unknowns"][0]
    assert found[first["name"]].tolist() == first["samples"]
    assert found.attrs["most_probable"][first["name"]] == first["most_probable"] and found.attrs["interval"] == raw["interval"]
    plain = calibration.model.sample_columns
    assert list(plain) == list(found.columns) and np.array_equal(plain[first["name"]], found[first["name"]])
    # a model before its calibration has none, nor one that was edited since
    assert model.samples is None and build.samples is None and model.sample_columns is None
    edited = calibration.model.copy()
    edited.bundle("LCL")["stiffness_n_per_mm"] *= 1.1
    assert edited.samples is None


def test_samples_of_no_calibration_are_told(calibration, tmp_path):
    import shutil

    place = tmp_path / "calibrated"
    shutil.copytree(calibration.folder, place)
    for text, words in [('{"schema": "samples/0"}', "samples/1 is read"), ('{"schema": "samples/1"}', "unknowns"), ("{", "expected what calibrate writes")]:
        (place / "samples.json").write_text(text)
        with pytest.raises(genu.InputError, match=words) as told:
            genu.Model(place).samples
        assert told.value.file == str(place / "samples.json")
    (place / "samples.json").unlink()
    assert genu.Model(place).samples is None


def test_a_build_is_taken_where_its_folder_is(build, tmp_path):
    assert genu.inspect(build) == genu.inspect(build.folder)
    assert genu.Build(build).folder == build.folder
    (knee,) = genu.cohort([build], tmp_path / "cohort").knees
    assert knee["status"] == "built"
    with pytest.raises(TypeError, match="has a folder"):
        genu.inspect(7)
    with pytest.raises(TypeError, match="a path was expected, not int"):
        genu.simulate(7, protocol="pivot-shift")


@pytest.mark.skipif(not hasattr(os, "symlink") or os.name == "nt", reason="no symbolic links")
def test_a_link_is_written_through(model, tmp_path):
    real = tmp_path / "real" / "model.json"
    first = model.save(real)
    for link in (tmp_path / "real" / "l.json", tmp_path / "l.json"):
        link.symlink_to(real)
        edited = model.copy()
        edited.bundle("LCL")["reference_strain"] = 1.05 + len(str(link)) * 1e-4
        assert edited.save(link) == first == str(real)
        assert link.is_symlink() and os.path.realpath(link) == str(real)
        again = genu.Model(real)
        assert again.bundle("LCL") == edited.bundle("LCL") and again.surfaces()
    # where the link leads there is no file yet
    new = tmp_path / "new.json"
    new.symlink_to(tmp_path / "later" / "model.json")
    assert genu.Model(model.save(new)).bundles == model.bundles and new.is_symlink()
    assert {p.name for p in tmp_path.rglob("*") if "tmp" in p.name} == set()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes on this system")
def test_what_is_no_file_is_not_replaced(model, tmp_path):
    os.mkfifo(tmp_path / "pipe.json")
    (tmp_path / "folder.json").mkdir()
    (tmp_path / "round.json").symlink_to(tmp_path / "round.json")
    before = sorted(os.listdir(tmp_path))
    for name in before:
        with pytest.raises(genu.InputError, match="no regular file") as told:
            model.save(tmp_path / name)
        assert told.value.file == str(tmp_path / name)
    assert sorted(os.listdir(tmp_path)) == before


def as_json(*words):
    """The error of a command as data."""
    run = subprocess.run([sys.executable, "-m", "genu", *map(str, words), "--json"], capture_output=True, text=True)
    return json.loads(run.stderr)


def test_an_error_has_what_its_json_has(model, specimen, tmp_path):
    none, used = tmp_path / "none.json", tmp_path / "used"
    used.mkdir()
    (used / "log.jsonl").mkdir()
    (tmp_path / "bad.csv").write_text("trial,test\n1\n")
    out = ["--out", tmp_path / "out.csv"]
    cases = [
        ["simulate", none, "--protocol", "pivot-shift", *out],
        ["simulate", model.file, "--trials", tmp_path / "bad.csv", *out],
        ["simulate", model.file, "--protocol", "pivot-shift", "--without", "XCL", *out],
        [specimen, "--out", tmp_path / "build", "--to", "ingest", "--set", "ingest.nonsense=1"],
        [specimen, "--out", tmp_path / "bad.csv", "--to", "ingest"],
    ]
    seen = set()
    for words in cases:
        told = as_json(*words)
        with pytest.raises(genu.GenuError) as raised:
            genu.run(*words)
        for key in ("code", "key", "value", "advice", "stage", "file", "row", "column"):
            assert getattr(raised.value, key) == told.get(key), (words, key)
        assert str(raised.value) == told["message"]
        seen.add(told["code"])
    assert {"file", "usage"} <= seen
    # what the module finds has its kind, and no advice
    with pytest.raises(genu.InputError) as raised:
        genu.Build(tmp_path)
    assert (raised.value.code, raised.value.advice, raised.value.key) == ("file", None, None)


def test_a_wrong_option_is_told_with_its_key_and_value(specimen, tmp_path):
    with pytest.raises(genu.UsageError) as told:
        genu.build(specimen, out=tmp_path / "build", options={"bones": {"edge_mm": -4}})
    assert (told.value.code, told.value.key, float(told.value.value)) == ("usage", "bones.edge_mm", -4.0)
    assert told.value.advice


def test_validate_takes_samples(calibration, tmp_path):
    options = {"ap_flexions_deg": [30]}
    found = genu.validate({"fitted": calibration}, tmp_path / "few", samples=4, solver="quasistatic", options=options)
    assert "ap_mm_lower" in found.protocol("fitted", "ap_laxity").columns
    none = genu.validate({"fitted": calibration}, tmp_path / "none", samples=0, solver="quasistatic", options=options)
    assert "ap_mm_lower" not in none.protocol("fitted", "ap_laxity").columns


def drawn(call):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    try:
        return call()
    finally:
        plt.close("all")


def test_laxity_is_drawn_with_its_band_and_the_measured_points(calibration, measured):
    answered = genu.simulate(calibration, measured, samples=8)
    ax = drawn(lambda: genu.plots.laxity(answered, measured))
    curve, points = ax.lines
    drawers = answered[answered["test"].isin(["anterior", "posterior"])].sort_values("load_ap_n")
    assert curve.get_xdata().tolist() == drawers["ap_mm"].tolist() and curve.get_ydata().tolist() == drawers["load_ap_n"].tolist()
    assert len(points.get_xdata()) == 2 and len(ax.collections) == 1
    assert "[mm]" in ax.get_xlabel() and "[N]" in ax.get_ylabel()
    # without measured points, without samples, into given axes
    plain = genu.simulate(calibration, measured, samples=0)
    assert drawn(lambda: genu.plots.laxity(plain, coordinate="ie_deg", ax=ax)) is ax
    assert len(ax.lines) == 3 and len(ax.collections) == 1
    for call, words in [
        (lambda: genu.plots.laxity(plain, coordinate="si_mm"), "si_mm"),
        (lambda: genu.plots.laxity(plain, flexions_deg=[7]), "nothing to draw"),
        (lambda: genu.plots.laxity(plain[["ap_mm"]]), "load_ap_n"),
    ]:
        with pytest.raises(genu.GenuError, match=words):
            call()


def test_forces_are_drawn_over_flexion(model):
    passive = genu.simulate(model, protocol="passive-flexion", to_flexion_deg=30)
    ax = drawn(lambda: genu.plots.forces(passive, ["ACL", "LCL"]))
    assert [line.get_label() for line in ax.lines] == ["ACL", "LCL"]
    assert ax.lines[0].get_ydata().tolist() == passive["group_ACL_n"].tolist()
    every = drawn(lambda: genu.plots.forces(passive))
    labels = [line.get_label() for line in every.lines]
    assert "ACL" in labels and "ACL_AM" not in labels and "dMCL" in labels and len(set(labels)) == len(labels)
    with pytest.raises(genu.InputError, match="no force of XCL; there are ACL"):
        genu.plots.forces(passive, "XCL")


def test_without_matplotlib_the_way_to_it_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    frame = pandas.DataFrame({"fe_deg": [0.0], "group_ACL_n": [1.0]})
    with pytest.raises(ImportError, match=r"\[plots\]"):
        genu.plots.forces(frame)


def test_a_grid_of_trials_becomes_a_dataset(model, trials):
    pytest.importorskip("xarray")
    answered = genu.simulate(model, trials[trials["test"].isin(["anterior", "posterior"])])
    grid = genu.to_xarray(answered)
    assert dict(grid.sizes) == {"nominal_flexion_deg": 2, "load_ap_n": 2}
    one = answered.set_index("trial").loc["anterior_30", "ap_mm"]
    assert float(grid["ap_mm"].sel(nominal_flexion_deg=30, load_ap_n=100)) == one
    assert grid["ap_mm"].attrs["units"] == "mm" and grid["load_ap_n"].attrs["units"] == "N"
    with pytest.raises(genu.InputError, match="two rows have nominal_flexion_deg 60") as told:
        genu.to_xarray(answered.iloc[[0, 2, 3]], by=["nominal_flexion_deg"])
    assert told.value.row == 4
    with pytest.raises(genu.InputError, match="no column load"):
        genu.to_xarray(answered, by="load")
