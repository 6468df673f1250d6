"""Calls that are wrong: mypy and pyright tell each before anything runs (test_types.py). Nobody runs this file."""

import numpy

import genu

model = genu.Model("model.json")
genu.simulate(model, protocol="ap_laxity")  # wrong: protocol
genu.simulate(model, protocol="pivot-shift", without=3)  # wrong: without
genu.simulate(model, protocol="pivot-shift", solver="implicit")  # wrong: solver
genu.simulate(model)  # wrong: neither trials nor a protocol
genu.simulate(model, "kla.csv", protocol="pivot-shift")  # wrong: both
genu.simulate(3, protocol="pivot-shift")  # wrong: model
genu.simulate(model, 3)  # wrong: trials
genu.simulate(model, "kla.csv", compression_n=30.0)  # wrong: a compression of trials
genu.simulate(model, protocol="pivot-shift").no_such_method()  # wrong: a frame has none
model.parameters().no_such_method()  # wrong: a frame has none
genu.Build("knee").summary().no_such_method()  # wrong: a frame has none
genu.inspect(3)  # wrong: build
genu.cohort([3], "out")  # wrong: build
genu.validate({"a": 3}, "out")  # wrong: model
genu.validate({"a": model}, "out", solver="implicit")  # wrong: solver
genu.plots.laxity(genu.read_table("a.csv"), coordinate="ap")  # wrong: coordinate
genu.export(model, "obj", "out")  # wrong: format
genu.calibrate(model, "kla.csv", "out", method="swarm")  # wrong: method
genu.build("knee", to="bone")  # wrong: stage
genu.Build("knee").surface("bone", "femur")  # wrong: stage
genu.init("knee", side="medial")  # wrong: side
genu.build("knee", progress="bar")  # wrong: progress
genu.check("knee").inputs[0]["status"]  # wrong: key
genu.plan(model, {"cuts": ["ACL"]}, "out")  # wrong: key
genu.plan(model, "graft.toml", "out").value("drawer", 30, "intact")  # wrong: test
genu.plan(model, "graft.toml", "out", sweep={"tension": [40.0]})  # wrong: key
genu.plan(model, "graft.toml", "out", sweep={"tension_n": 40.0})  # wrong: no list
genu.plan(model, "graft.toml", "out", sweep={"tension_n": [40.0], "map": ["tension"]})  # wrong: choice of a map
genu.plan(model, "graft.toml", "out", sweep="sweep.toml").value("varus", 30, "intact")  # wrong: a sweep has none
genu.plan(model, "graft.toml", "out").best  # wrong: one plan has no best
genu.plan(model, "graft.toml", "out", sweep="sweep.toml").best[0]["choices"]["tension"]  # wrong: key
genu.next_tests(model, "ACL", count="six")  # wrong: count
genu.credibility("knee", context={"influence": "much"})  # wrong: level
genu.credibility("knee").grade("inputs")  # wrong: factor
genu.cohort_infer([3, 4], "out")  # wrong: build
genu.cohort_infer(["a", "b"], "out")[0]["files"]  # wrong: key
genu.export(model, "opensim", "out", contact="hertz")  # wrong: contact
genu.import_febio("knee.feb", "out", side="medial")  # wrong: side
genu.Model("model.json", source=3)  # wrong: source

genu.simulate(model, protocol="pivot-shift", without="ACL")
genu.simulate(model, protocol="pivot-shift", without=["ACL", "LCL"], compression_n=30.0)
for trials in ("kla.csv", genu.read_table("kla.csv")):
    genu.simulate(model, trials, read_as="kla", samples=8)
genu.simulate(genu.Build("knee"), {"load_ap_n": [0.0, 100.0]})
genu.simulate(genu.calibrate(model, "kla.csv", "out"), [{"load_ap_n": 100.0}])
genu.simulate(genu.diagnose(model, {"kla": "kla.csv"}, "out"), genu.read_table("kla.csv").to_dict("records"))
genu.inspect(genu.Build("knee"))
genu.cohort([genu.Build("knee"), "other"], "out")
for told in genu.cohort_infer([genu.Build("knee"), "other"], "out"):
    genu.build(told["knee"], options={"calibrate.shared_prior": told["prior"]["file"]})
genu.simulate(genu.import_febio("knee.feb", "out", side="left"), protocol="ap-laxity")
genu.export(model, "opensim", "out", contact="jam", poses=genu.read_table("kla.csv"))
genu.validate({"a": model, "b": "b/model.json"}, "out", samples=8, solver="explicit")
samples = genu.Build("knee").samples
if samples is not None:
    genu.plots.forces(genu.simulate(model, protocol="passive-flexion"), "ACL").set_title(f"{len(samples)} samples")
genu.build(genu.init("knee", ["femur.stl"]), to="bones", progress=True)
genu.plan(model, {"cut": ["ACL"]}, "out", samples=0).value("anterior drawer", 30, "deficient")
genu.credibility(genu.Build("knee"), context={"influence": "medium"}).grade("model-inputs")
swept = genu.plan(model, {"cut": ["ACL"]}, "out", sweep={"tension_n": numpy.arange(20, 100, 20), "at_flexion_deg": [0, 20.0], "map": ["tension_n", "at_flexion_deg"]})
swept.table().sort_values("rank")["chance"].head(len(swept.best))
genu.plan(model, "graft.toml", "out", sweep="sweep.toml", samples=8).best[0]["choices"]["tension_n"] * 2
