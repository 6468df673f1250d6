"""Calls that are wrong: mypy tells each before anything runs (test_types.py). Nobody runs this file."""

import genu

model = genu.Model("model.json")
genu.simulate(model, protocol="ap_laxity")  # wrong: protocol
genu.simulate(model, protocol="pivot-shift", without=3)  # wrong: without
genu.simulate(model, protocol="pivot-shift", solver="implicit")  # wrong: solver
genu.export(model, "obj", "out")  # wrong: format
genu.calibrate(model, "kla.csv", "out", method="swarm")  # wrong: method
genu.build("knee", to="bone")  # wrong: stage
genu.Build("knee").surface("bone", "femur")  # wrong: stage
genu.init("knee", side="medial")  # wrong: side
genu.build("knee", progress="bar")  # wrong: progress
genu.check("knee").inputs[0]["status"]  # wrong: key
genu.plan(model, {"cuts": ["ACL"]}, "out")  # wrong: key
genu.plan(model, "graft.toml", "out").value("drawer", 30, "intact")  # wrong: test
genu.next_tests(model, "ACL", count="six")  # wrong: count
genu.credibility("knee", context={"influence": "much"})  # wrong: level
genu.credibility("knee").grade("inputs")  # wrong: factor

genu.simulate(model, protocol="pivot-shift", without="ACL")
genu.simulate(model, protocol="pivot-shift", without=["ACL", "LCL"])
genu.build(genu.init("knee", ["femur.stl"]), to="bones", progress=True)
genu.plan(model, {"cut": ["ACL"]}, "out", samples=0).value("anterior drawer", 30, "deficient")
genu.credibility(genu.Build("knee"), context={"influence": "medium"}).grade("model-inputs")
