"""A knee like ours in OpenSim: Blankevoort1991Ligament fibres and ElasticFoundationForce between closed cartilages, one anterior trial.

usage: opensim_knee.py MODEL.json FEMUR.ply TIBIA.ply TIBIA.ply [SECONDS] [-- COMMAND...]
  needs: pip install opensim==4.6 trimesh
  cartilages are closed surfaces in mm, CT frame; COMMAND is ours (cargo bench --bench solver), whose trial times are set beside OpenSim's.

Flexion is held at the CT pose's, 20 N press the joint together, 89 N push the tibia forwards over the first 0.6 of SECONDS (default 0.3). Contact
stiffness is the law's last slope times the layer both sides share; dashpots are ours (0.05 N s/mm a fibre, here as 30 N s/m on translations).
The ratio sets OpenSim's processor time for each simulated second, times the 1.5 s in which a trial of ours is loaded (its 3 s of settling left out), beside
our trial.
"""
import json, re, subprocess, sys, tempfile, time
from pathlib import Path
import numpy as np
import opensim as osim
import trimesh

# our loading step [s]
LOADED = 1.5


def vec(v):
    return osim.Vec3(*(float(x) for x in v))


def contact(model, frame, path, name, folder):
    mesh = trimesh.load(path, process=True)
    if not mesh.is_watertight:
        sys.exit(f"{path}: open surface; OpenSim's contact needs closed ones")
    mesh.apply_scale(1e-3)
    file = folder / f"{name}.obj"
    mesh.export(file)
    geometry = osim.ContactMesh(str(file), vec((0, 0, 0)), vec((0, 0, 0)), frame, name)
    model.addContactGeometry(geometry)
    return len(mesh.faces)


def build(spec, files, seconds, folder):
    model = osim.Model()
    model.setGravity(vec((0, 0, 0)))
    origin = np.array(spec["frames"]["femur"]["origin"]) * 1e-3
    femur = osim.Body("femur", 1.0, vec((0, 0, 0)), osim.Inertia(1e-2, 1e-2, 1e-2, 0, 0, 0))
    model.addBody(femur)
    joint = osim.FreeJoint("knee", model.getGround(), vec(origin), vec((0, 0, 0)), femur, vec((0, 0, 0)), vec((0, 0, 0)))
    model.addJoint(joint)
    # the femur's frame stands at its origin, axes along CT
    offset = osim.PhysicalOffsetFrame("femur_ct", femur, osim.Transform(vec(-origin)))
    femur.addComponent(offset)
    triangles = contact(model, offset, files[0], "femur", folder)
    for k, file in enumerate(files[1:]):
        triangles += contact(model, model.getGround(), file, f"tibia{k}", folder)
        table = spec["contact"]
        slope = (table["pressure_mpa"][-1] - table["pressure_mpa"][-2]) / (table["overclosure_mm"][-1] - table["overclosure_mm"][-2])
        force = osim.ElasticFoundationForce()
        force.setName(f"contact{k}")
        # N/m per m2; two meshes of the same stiffness in series give half of it
        force.addGeometry("femur")
        force.addGeometry(f"tibia{k}")
        force.setStiffness(2 * slope * 1e9)
        force.setDissipation(1.0)
        force.setStaticFriction(table["friction"])
        force.setDynamicFriction(table["friction"])
        force.setViscousFriction(0.0)
        force.setTransitionVelocity(0.01)
        model.addForce(force)
    bundles = {b["name"]: b for b in spec["bundles"]}
    others = sorted({b["law"] for b in bundles.values()} - {"smooth"})
    if others:
        sys.exit(f"bundles of the law {', '.join(others)}: OpenSim's fibre has the quadratic toe of Blankevoort 1991 alone; give a model whose bundles are smooth")
    counts = {n: sum(f["bundle"] == n for f in spec["fibres"]) for n in bundles}
    for k, fibre in enumerate(spec["fibres"]):
        b = bundles[fibre["bundle"]]
        ends = [np.array(fibre["femur"]) * 1e-3, np.array(fibre["tibia"]) * 1e-3]
        slack = np.linalg.norm(ends[0] - ends[1]) / b["reference_strain"]
        # ours is N/mm of the bundle, theirs N a strain of the fibre; their transition strain is twice our toe
        stiffness = float(b["stiffness_n_per_mm"] / counts[b["name"]] * slack * 1e3)
        ground = model.getGround()
        ligament = osim.Blankevoort1991Ligament(f"fibre{k}", offset, vec(ends[0]), ground, vec(ends[1]), stiffness, float(slack))
        ligament.set_transition_strain(2 * b["toe_strain"])
        ligament.set_damping_coefficient(0.003)
        model.addForce(ligament)
    for k in range(6):
        coordinate = joint.upd_coordinates(k)
        damper = osim.SpringGeneralizedForce(coordinate.getName())
        damper.setViscosity(0.03 if k < 3 else 30.0)
        model.addForce(damper)
    tibia = spec["frames"]["tibia"]
    push = osim.PrescribedForce("load", femur)
    superior, anterior = np.array(tibia["superior"]), np.array(tibia["anterior"])
    functions = []
    for axis in range(3):
        f = osim.PiecewiseLinearFunction()
        for t, part in [(0, 0), (0.6 * seconds, 1), (10 * seconds, 1)]:
            f.addPoint(t, float(-20 * superior[axis] - 89 * part * anterior[axis]))
        functions.append(f)
    push.setForceFunctions(*functions)
    push.setForceIsInGlobalFrame(True)
    model.addForce(push)
    model.finalizeConnections()
    return model, triangles


def main():
    arguments = sys.argv[1:]
    ours = arguments[arguments.index("--") + 1 :] if "--" in arguments else []
    arguments = arguments[: arguments.index("--")] if "--" in arguments else arguments
    if len(arguments) < 4:
        sys.exit(__doc__)
    spec = json.loads(Path(arguments[0]).read_text())
    seconds = float(arguments[4]) if len(arguments) > 4 else 0.3
    with tempfile.TemporaryDirectory() as folder:
        model, triangles = build(spec, arguments[1:4], seconds, Path(folder))
        state = model.initSystem()
        knee = osim.FreeJoint.safeDownCast(model.getJointSet().get("knee"))
        knee.upd_coordinates(0).setLocked(state, True)
        manager = osim.Manager(model)
        manager.setIntegratorAccuracy(1e-3)
        manager.initialize(state)
        start, cpu = time.perf_counter(), time.process_time()
        state = manager.integrate(seconds)
        wall, cpu = time.perf_counter() - start, time.process_time() - cpu
    q = [knee.get_coordinates(k).getValue(state) for k in range(6)]
    print(f"OpenSim: {triangles} contact triangles, {len(spec['fibres'])} fibres, {seconds} s simulated: {cpu:.1f} s of processor, {wall:.1f} s by the clock")
    print(f"OpenSim: {cpu / seconds:.0f} s of processor for each simulated second")
    print("OpenSim: femur turned [deg]", np.degrees(q[:3]).round(2), "moved [mm]", (np.array(q[3:]) * 1e3).round(2))
    if ours:
        out = subprocess.run(ours, capture_output=True, text=True, check=True).stdout
        print(out, end="")
        for name in ["quasi-static trial, median", "explicit trial, median"]:
            found = re.search(re.escape(name) + r"\s+([\d.]+) ms", out)
            if found:
                print(f"ratio: OpenSim takes {1e3 * LOADED * cpu / seconds / float(found[1]):.0f} times as long as our {name.split(',')[0]}")


main()
