"""Plan, next tests, credibility: what the command tells, number for number; their errors."""

import inspect
import json
import os
import subprocess
import sys

import pytest

import genu

pandas = pytest.importorskip("pandas")

GRAFT = {
    "cut": ["ACL"],
    "graft": [
        {
            "name": "hamstring",
            "femur": {"native": "ACL"},
            "tibia": {"native": "ACL", "move_mm": [0, 0, 1.5]},
            "stiffness_n_per_mm": 200,
            "tension_n": 40,
        }
    ],
    "tests": {"flexions_deg": [30], "passive_deg": [30]},
}

GRAFT_TOML = """
cut = ["ACL"]

[[graft]]
name = "hamstring"
femur = { native = "ACL" }
tibia = { native = "ACL", move_mm = [0.0, 0.0, 1.5] }
stiffness_n_per_mm = 200.0
tension_n = 40.0

[tests]
flexions_deg = [30.0]
passive_deg = [30.0]
"""


def command(*words):
    """What the command prints as data, in a process of its own."""
    run = subprocess.run([sys.executable, "-m", "genu", *map(str, words), "--json"], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout)


def test_a_plan_has_the_commands_numbers(calibration, tmp_path):
    (tmp_path / "graft.toml").write_text(GRAFT_TOML)
    words = ["plan", calibration.model.file, tmp_path / "graft.toml", "--samples", 4, "--seed", 7]
    told = command(*words, "--out", tmp_path / "command")
    found = genu.plan(calibration, GRAFT, tmp_path / "python", samples=4, seed=7)
    assert found.raw == told and found.samples == 4
    assert genu.plan(calibration, tmp_path / "graft.toml", tmp_path / "file", samples=4, seed=7).raw == told
    assert genu.plan(calibration, GRAFT, tmp_path / "other", samples=4, seed=8).raw != told
    intact, deficient = (found.value("anterior drawer", 30, state) for state in ("intact", "deficient"))
    assert deficient["value"] > intact["value"] > 0
    assert intact["lower"] <= intact["mean"] <= intact["upper"]
    rows = found.table().set_index(["test", "flexion_deg", "state", "quantity"])
    assert rows.loc[("anterior drawer", 30, "deficient", "laxity"), "value"] == pytest.approx(deficient["value"], abs=1e-4)
    assert found.grafts[0]["name"] == "hamstring" and os.path.isfile(found.page)
    assert all(0 <= chance["chance"] <= 1 for chance in found.chances)


def test_a_plan_at_fault_is_told_with_its_place(model, tmp_path):
    with pytest.raises(genu.InputError, match="cut") as told:
        genu.plan(model, {**GRAFT, "cut": ["XCL"]}, tmp_path / "none")
    assert told.value.file == "graft"
    (tmp_path / "graft.toml").write_text(GRAFT_TOML.replace("tension_n", "tenshun_n"))
    with pytest.raises(genu.InputError, match="tenshun_n") as told:
        genu.plan(model, tmp_path / "graft.toml", tmp_path / "none")
    assert told.value.file == str(tmp_path / "graft.toml") and told.value.row == 9
    found = genu.plan(model, GRAFT, tmp_path / "plan")
    assert found.samples == 0 and found.value("varus", 30, "intact")["mean"] is None
    with pytest.raises(KeyError, match="45 deg"):
        found.value("varus", 45, "intact")


SWEEP = {"femur_forwards_mm": [-4, 0], "tension_n": [20, 40]}
SWEEP_TOML = "femur_forwards_mm = [-4.0, 0.0]\ntension_n = [20.0, 40.0]\n"


def test_many_plans_have_the_commands_numbers_and_the_best_comes_first(calibration, tmp_path):
    (tmp_path / "graft.toml").write_text(GRAFT_TOML)
    (tmp_path / "sweep.toml").write_text(SWEEP_TOML)
    words = ["plan", calibration.model.file, tmp_path / "graft.toml", "--sweep", tmp_path / "sweep.toml", "--samples", 4]
    told = command(*words, "--out", tmp_path / "command")
    found = genu.plan(calibration, GRAFT, tmp_path / "python", sweep=SWEEP, samples=4)
    # paths of the results are their own
    assert {**found.raw, "file": None, "page": None} == {**told, "file": None, "page": None}
    assert (tmp_path / "python" / "sweep.csv").read_bytes() == (tmp_path / "command" / "sweep.csv").read_bytes()
    assert isinstance(found, genu.Sweep) and os.path.isfile(found.page) and found.samples == 4
    assert found.graft == "hamstring" and found.varied == SWEEP and found.plans == 4 and len(found.best) == found.done
    # the best by rank are the table's, number for number
    table = found.table()
    assert list(table.columns) == found.raw["columns"] and list(table["plan"]) == [1, 2, 3, 4]
    ranked = table.dropna(subset=["rank"]).sort_values("rank")
    assert [one["plan"] for one in found.best] == list(ranked["plan"])
    for one, (_, row) in zip(found.best, ranked.iterrows(), strict=True):
        assert one["choices"] == {key: row[key] for key in SWEEP}
        for name, number in one["numbers"].items():
            # a number that is not there is an empty cell; the table has four digits
            assert pandas.isna(row[name]) if number is None else row[name] == pytest.approx(number, abs=1e-4), name
    # the row of a plan is that plan
    alone = genu.plan(calibration, GRAFT, tmp_path / "alone", samples=4)
    assert isinstance(alone, genu.Plan)
    same = next(one for one in found.best if one["choices"] == {"femur_forwards_mm": 0, "tension_n": 40})
    assert same["numbers"]["slack_length_mm"] == alone.grafts[0]["slack_length_mm"]
    assert same["numbers"]["chance_varus_30"] == next(t["chance"] for t in alone.tests if t["test"] == "varus")


def test_a_sweep_at_fault_is_told_with_its_place_and_writes_nothing(model, tmp_path):
    (tmp_path / "sweep.toml").write_text("\ntenshun_n = [40]\n")
    with pytest.raises(genu.GenuError, match="no key tenshun_n; did you mean tension_n") as told:
        genu.plan(model, GRAFT, tmp_path / "none", sweep=tmp_path / "sweep.toml")
    error = told.value
    assert isinstance(error, genu.InputError) and error.code == "file" and error.stage is None and error.advice
    assert (error.file, error.row) == (str(tmp_path / "sweep.toml"), 2)
    # from memory a line is a key
    for sweep, row, words in [
        ({"tension_n": [40], "tenshun_n": [40]}, 2, "no key tenshun_n"),
        ({"tension_n": 40}, 1, "expected a list of numbers"),
        ({"at_flexion_deg": [20], "tension_n": [40, 4000]}, 2, "expected 1 to 500"),
        ({"tension_n": [40, 40.0]}, 1, "twice"),
        ({}, None, "nothing is varied"),
    ]:
        with pytest.raises(genu.InputError, match=words) as told:
            genu.plan(model, GRAFT, tmp_path / "none", sweep=sweep)
        assert (told.value.file, told.value.row) == ("sweep", row), sweep
    assert not (tmp_path / "none").exists()


def test_where_no_plan_can_be_done_the_table_says_why(model, tmp_path):
    numpy = pytest.importorskip("numpy")
    with pytest.raises(genu.InputError, match="none of the 2 plans could be done") as told:
        genu.plan(model, GRAFT, tmp_path, sweep={"stiffness_n_per_mm": [0.1], "tension_n": numpy.array([400.0, 500.0])}, samples=0)
    assert told.value.file == "graft"
    table = genu.read_table(tmp_path / "sweep.csv")
    assert len(table) == 2 and table["fault"].str.contains("out of reach").all() and table["rank"].isna().all()


def test_next_tests_are_those_of_the_command(calibration, tmp_path):
    words = ["next-tests", calibration.model.file, "--for", "LCL", "--count", 3, "--compression", 40, "--noise-mm", 0.5, "--single"]
    told = command(*words, "--out", tmp_path / "command.csv")
    out = tmp_path / "python.csv"
    found = genu.next_tests(calibration, "LCL", count=3, compression_n=40, noise_mm=0.5, single=True, out=out)
    assert {**found.raw, "file": None} == {**told, "file": None} and found.raw["file"] == str(out)
    assert out.read_bytes() == (tmp_path / "command.csv").read_bytes()
    assert 0 < len(found.tests) <= 3 and all(0 < test["left"] < 1 for test in found.tests)
    widest = max(found.spread, key=lambda spread: spread["now"])
    assert 0 < widest["then"] < widest["now"]
    # without a file of its own
    other = genu.next_tests(calibration, "drawer", samples=24)
    assert other.raw["file"] is None and other.samples <= 24 and other.raw["without"] == []
    assert len(genu.simulate(calibration, found.trials)) == len(found.trials)


def test_next_tests_say_what_they_cannot_answer(calibration, model, tmp_path):
    with pytest.raises(genu.InputError, match="no samples of a posterior"):
        genu.next_tests(model, "ACL")
    # this phantom dislocates without its ACL: that the cut is heard shows in the refusal
    with pytest.raises(genu.InputError, match="leaves the plateau"):
        genu.next_tests(calibration, "drawer", without="ACL", samples=12)
    with pytest.raises(genu.UsageError, match="did you mean pivot-shift"):
        genu.next_tests(calibration, "pivot-shfit")
    with pytest.raises(genu.UsageError, match="compression"):
        genu.next_tests(calibration, "ACL", compression_n=-1)


def test_credibility_is_that_of_the_command(build, tmp_path):
    (tmp_path / "context.toml").write_text('question = "How loose is it?"\ninfluence = "medium"\nconsequence = "low"\n')
    told = command("credibility", build.folder, "--context", tmp_path / "context.toml", "--out", tmp_path / "command")
    context = {"question": "How loose is it?", "influence": "medium", "consequence": "low"}
    found = genu.credibility(build, context=context, out=tmp_path / "python")
    assert found.raw == told and found.risk == "medium"
    assert (tmp_path / "python" / "credibility.json").read_bytes() == (tmp_path / "command" / "credibility.json").read_bytes()
    assert os.path.isfile(found.page) and len(found.factors) == 8
    assert found.grade("model-inputs") == found.factor("model-inputs")["grade"]
    assert {e["factor"] for e in found.evidence} == {f["factor"] for f in found.factors if f["evidence"]}
    # a folder of a build, and no context
    assert genu.credibility(build.folder, out=tmp_path / "plain").risk is None
    with pytest.raises(genu.InputError, match="influence"):
        genu.credibility(build, context={"influence": "much"}, out=tmp_path / "none")
    with pytest.raises(genu.InputError, match="no build"):
        genu.credibility(tmp_path)


def test_every_function_with_a_folder_for_results_may_be_forced():
    functions = {name: getattr(genu, name) for name in genu.__all__ if inspect.isfunction(getattr(genu, name))}
    takes = {name: inspect.signature(function).parameters for name, function in functions.items()}
    found = {name for name, parameters in takes.items() if "out" in parameters}
    assert {"calibrate", "cohort", "export", "plan", "validate"} <= found
    # check writes a page of its own, as a build does
    assert {name for name in found if "force" not in takes[name]} == {"check"}
    assert {name for name, parameters in takes.items() if "anew" in parameters} == {"calibrate"}


def test_what_cannot_be_kept_is_told_before_the_model_is_read(tmp_path):
    nowhere = tmp_path / "nowhere" / "model.json"
    trials = {"load_ap_n": [0.0, 100.0]}
    for name, call in {
        "validate/compare.csv": lambda out: genu.validate({"a": nowhere}, out),
        "calibrate/model.json": lambda out: genu.calibrate(nowhere, trials, out),
        "diagnose/diagnosis.json": lambda out: genu.diagnose(nowhere, {"kla": trials}, out),
        "plan/plan.json": lambda out: genu.plan(nowhere, {"cut": ["ACL"]}, out),
        "sweep/sweep.json": lambda out: genu.plan(nowhere, GRAFT, out, sweep=SWEEP),
        "cohort/knees.csv": lambda out: genu.cohort([tmp_path / "nothing"], out),
    }.items():
        file = tmp_path / name
        file.parent.mkdir()
        with pytest.raises(genu.InputError) as raised:
            call(file.parent)
        assert "--force" not in str(raised.value)
        file.write_text("by hand")
        with pytest.raises(genu.InputError, match="--force") as raised:
            call(file.parent)
        assert raised.value.file == str(file) and file.read_text() == "by hand"


def test_a_search_is_taken_up_unless_it_is_to_begin_anew(model, measured, tmp_path):
    saved, own = tmp_path / "checkpoint.cbor", tmp_path / "model.json"
    saved.write_bytes(b"of another search")
    for force in (False, True):
        with pytest.raises(genu.InputError, match="checkpoint"):
            genu.calibrate(model, measured, tmp_path, force=force)
    own.write_text("by hand")
    with pytest.raises(genu.InputError, match="--force"):
        genu.calibrate(model, measured, tmp_path, anew=True)
    assert saved.read_bytes() == b"of another search" and own.read_text() == "by hand"


def test_a_result_that_was_edited_stays_until_forced(build, tmp_path):
    verbs = {
        "cohort.html": lambda out, **more: genu.cohort([build], out, **more),
        "credibility.json": lambda out, **more: genu.credibility(build, out=out, **more),
    }
    for name, verb in verbs.items():
        file = tmp_path / name / name
        for _ in range(2):
            verb(file.parent)
        file.write_text("by hand")
        with pytest.raises(genu.InputError, match="--force") as raised:
            verb(file.parent)
        assert raised.value.file == str(file) and "--force" in raised.value.advice
        assert file.read_text() == "by hand"
        verb(file.parent, force=True)
        assert file.read_text() != "by hand"
        verb(file.parent)
