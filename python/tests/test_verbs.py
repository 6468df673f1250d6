"""The verbs on a model: pandas in, pandas out; their errors."""

import json
import os
import subprocess
import sys

import pytest

import genu

pandas = pytest.importorskip("pandas")

DIAGNOSIS_KEYS = {"schema", "verdict", "answers", "description", "gap"}


def test_simulate_answers_every_trial_in_the_columns_of_the_format(model, trials):
    poses = genu.simulate(model, trials)
    assert list(poses["trial"]) == list(trials["trial"])
    assert list(poses["fe_deg"]) == list(trials["fe_deg"])
    ap = poses.set_index("trial")["ap_mm"]
    assert ap["anterior_30"] > ap["posterior_30"] + 2
    assert {f"force_{b}_n" for b in model.bundles} <= set(poses.columns)


def test_an_edited_number_changes_the_answer_and_the_file_does_not_change(build, model, trials):
    before = json.dumps(build.model.spec)
    few = trials[trials["test"] == "anterior"]
    loose = model.copy()
    for bundle in loose.spec["bundles"]:
        if bundle["name"].startswith("ACL"):
            bundle["stiffness_n_per_mm"] *= 0.3
    assert (genu.simulate(loose, few)["ap_mm"] > genu.simulate(model, few)["ap_mm"] + 0.1).all()
    assert json.dumps(build.model.spec) == before


def test_tables_may_be_dicts_or_files(model, trials, tmp_path):
    few = trials.head(1)
    expected = genu.simulate(model, few)
    few.to_csv(tmp_path / "few.csv", index=False)
    for table in (few.to_dict("list"), few.to_dict("records"), tmp_path / "few.csv"):
        assert genu.simulate(model, table).equals(expected)


def test_a_protocol_with_a_ligament_cut(model):
    whole = genu.simulate(model, protocol="pivot-shift")
    cut = genu.simulate(model, protocol="pivot-shift", without=["ACL"])
    assert len(whole) == len(cut) and (cut["force_ACL_AM_n"] == 0).all()
    passive = genu.simulate(model, protocol="passive-flexion", to_flexion_deg=30)
    assert passive["fe_deg"].max() == 30


def test_models_are_saved_and_read_from_anywhere(model, trials, tmp_path):
    few = trials.head(1)
    edited = model.copy()
    edited.bundle("LCL")["reference_strain"] = 1.05
    place = edited.save(tmp_path / "a" / "b")
    again = genu.Model(place)
    assert again.bundle("LCL")["reference_strain"] == 1.05
    # the column model has a digest of the names by which each file finds its surfaces
    here, there = (genu.simulate(m, few).drop(columns="model") for m in (again, edited))
    assert here.equals(there)
    assert {s.faces.shape[1] for s in again.surfaces().values()} == {3}
    names, ends = again.fibres()
    assert ends.shape == (len(names), 2, 3) and len(again.parameters()) == len(again.bundles)
    with pytest.raises(KeyError, match="ACL_AM"):
        again.bundle("ACL")


def test_calibrate_comes_nearer_and_tells_how_far(model, measured, calibration):
    # the fit moves the frames too, so what it predicts stands in its own table
    fit = calibration.table("fit")
    after = float((fit["residual_ap_mm"] ** 2).mean() ** 0.5)
    assert calibration.metrics["rms"]["ap_mm"] == pytest.approx(after, abs=1e-3)
    before = genu.simulate(model, measured)["ap_mm"] - measured["ap_mm"]
    assert after < 0.5 * float((before**2).mean() ** 0.5)
    assert {"bundle", "kind", "value", "lower", "upper"} <= set(calibration.parameters.columns)
    assert (calibration.parameters["lower"] <= calibration.parameters["upper"]).all()
    assert calibration.history["best_cost"].is_monotonic_decreasing
    assert calibration.metrics["trials"] == len(measured)
    assert len(calibration.table("forces")) > 0


def test_validate_compares(calibration, tmp_path):
    stiffer = calibration.model.copy()
    stiffer.bundle("LCL")["stiffness_n_per_mm"] *= 1.2
    found = genu.validate({"stiffer": stiffer, "fitted": calibration}, tmp_path, options={"ap_flexions_deg": [30]})
    assert len(found.differences) > 0
    assert set(found.protocol("fitted", "ap_laxity")["fe_deg"].round()) == {30}


def test_export_writes_what_meshio_reads(model, tmp_path):
    meshio = pytest.importorskip("meshio")
    files = genu.export(model, "stl", tmp_path)
    assert {os.path.basename(f) for f in files} >= {"femur_bone.stl", "tibia_bone.stl"}
    assert len(meshio.read(files[0]).cells_dict["triangle"]) > 1000
    deck = genu.export(model, "abaqus", tmp_path / "deck")
    main = next(f for f in deck if f.endswith(".inp"))
    assert genu.import_abaqus(main, tmp_path / "back").bundles == model.bundles


def test_an_opensim_knee_goes_out_and_comes_back(model, tmp_path):
    files = genu.export(model, "opensim", tmp_path / "jam", contact="jam")
    osim = next(f for f in files if f.endswith(".osim"))
    back = genu.import_opensim(osim, tmp_path / "back")
    assert back.side == model.side and len(back.fibres()[0]) == len(model.fibres()[0])
    broken = tmp_path / "broken.osim"
    broken.write_text("<OpenSimDocument>")
    with pytest.raises(genu.InputError, match="broken.osim"):
        genu.import_opensim(broken, tmp_path / "none")
    with pytest.raises(genu.GenuError, match="--contact goes with --format opensim"):
        genu.export(model, "stl", tmp_path / "stl", contact="jam")
    # what OpenSim itself has is no contact that import_opensim knows
    with pytest.warns(UserWarning, match="^contact is linear"):
        written = genu.export(model, "opensim", tmp_path / "plain")
    plain = next(f for f in written if f.endswith(".osim"))
    with pytest.raises(genu.InputError, match="Smith2018ArticularContactForce"):
        genu.import_opensim(plain, tmp_path / "none")


def test_a_febio_knee_goes_out_and_comes_back(model, tmp_path):
    feb = next(f for f in genu.export(model, "febio", tmp_path / "feb") if f.endswith(".feb"))
    back = genu.import_febio(feb, tmp_path / "back")
    assert back.side == model.side and len(back.fibres()[0]) == len(model.fibres()[0])
    broken = tmp_path / "broken.feb"
    broken.write_text("<febio_spec>")
    with pytest.raises(genu.InputError, match="broken.feb"):
        genu.import_febio(broken, tmp_path / "none")
    with pytest.raises(genu.InputError, match="no rigid body thigh"):
        genu.import_febio(feb, tmp_path / "none", femur="thigh", tibia="tibia")


def test_errors_carry_their_parts(model, trials, tmp_path):
    bad = trials.head(2).astype({"load_ap_n": object})
    bad.loc[1, "load_ap_n"] = "many"
    bad.to_csv(tmp_path / "bad.csv", index=False)
    with pytest.raises(genu.InputError) as told:
        genu.simulate(model, tmp_path / "bad.csv")
    assert told.value.file == str(tmp_path / "bad.csv") and told.value.row == 3 and told.value.stage is None
    with pytest.raises(genu.UsageError):
        genu.simulate(model)
    with pytest.raises(genu.UsageError, match="XCL"):
        genu.simulate(model, trials, without=["XCL"])
    with pytest.raises(genu.InputError) as told:
        genu.simulate(tmp_path / "none.json", trials)
    assert told.value.file == str(tmp_path / "none.json")
    (tmp_path / "broken.json").write_text('{\n  "schema": ,\n}')
    with pytest.raises(genu.InputError) as told:
        genu.Model(tmp_path / "broken.json")
    assert told.value.row == 2
    with pytest.raises(genu.GenuError, match="S192803-phantom"):
        genu.phantom("nobody", tmp_path / "nobody")
    with pytest.raises(genu.UsageError):
        genu.run("no-such-folder", "--nonsense")


def test_a_stage_that_stops_is_named(specimen, tmp_path):
    import shutil

    broken = tmp_path / "broken"
    shutil.copytree(specimen, broken, ignore=shutil.ignore_patterns("build"))
    (broken / "landmarks.csv").write_text("name,frame,x_mm,y_mm,z_mm\nepicondyle_medial,ct,1,2\n")
    with pytest.raises(genu.StageError) as told:
        genu.build(broken, to="ingest")
    assert told.value.stage == "ingest" and told.value.file == "landmarks.csv" and told.value.row == 2
    failure = json.loads((broken / "build" / "failure.json").read_text())
    assert failure["stage"] == "ingest" and "landmarks.csv" in failure["message"]


def test_diagnose_answers(model, measured, tmp_path):
    found = genu.diagnose(model, {"kla": measured}, tmp_path)
    assert DIAGNOSIS_KEYS <= set(found.raw)
    assert found.verdict in {"decisive", "probable", "one_of", "unnamed", "none"}
    assert found.description and os.path.isfile(found.report)
    assert found.model.bundles == model.bundles


def test_options_of_a_diagnosis_and_of_its_knee_are_heard_and_others_refused(model, measured, tmp_path):
    fewer = {"most_effects": 0, "calibrate": {"priors": "none"}}
    found = genu.diagnose(model, {"kla": measured}, tmp_path / "few", options=fewer)
    assert found.verdict in {"unnamed", "none"} and not found.raw["answers"], "no effect may be named"
    with pytest.raises(genu.UsageError, match="hexmesh"):
        genu.diagnose(model, {"kla": measured}, tmp_path / "no", options={"hexmesh": {"layers": 3}})


def test_a_model_tells_what_it_is_as_the_command_does(model, trials, tmp_path):
    trials.head(1).to_csv(tmp_path / "one.csv", index=False)
    words = ["simulate", model.file, "--trials", str(tmp_path / "one.csv"), "--out", str(tmp_path / "r.csv"), "--json"]
    run = subprocess.run([sys.executable, "-m", "genu", *words], capture_output=True, text=True, check=True)
    told = json.loads(run.stdout)["model"]
    assert (model.standing, model.digest) == (told["standing"], told["digest"])
    assert model.stage == "09-assemble/model.json"
    for part in (told["id"], told["standing"], model.stage, told["digest"][:12]):
        assert part in repr(model), repr(model)
    # a number that is edited is another model, and says so
    edited = model.copy()
    edited.bundle("ACL_AM")["stiffness_n_per_mm"] *= 2
    assert edited.digest != model.digest and "as edited" in edited.stage and "as edited" in repr(edited)
    edited.bundle("ACL_AM")["stiffness_n_per_mm"] /= 2
    assert edited.digest == model.digest
    edited.bundle("ACL_AM")["stiffness_n_per_mm"] = "stiff"
    assert "no model as it stands" in repr(edited)
