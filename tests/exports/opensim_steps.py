"""Loads every protocol of an OpenSim export, and takes some through to rest.

usage: opensim_steps.py EXPORT_FOLDER MODEL.json RESULTS.csv
Each file must hold the flexions and loads of steps.csv. Files of trials in RESULTS.csv, which `simulate` wrote, go through follow.py of the folder: where
they end they must be within 0.2 mm and 0.2 deg of ours. Needs `pip install opensim==4.6`. Ends with status 77 where it is not installed.
"""

import csv
import json
import os
import subprocess
import sys

try:
    import numpy as np
    import opensim
except ImportError:
    print("opensim is not installed")
    sys.exit(77)

# the tree stays as it is
sys.dont_write_bytecode = True
from opensim_statics import POSE, Knee  # noqa: E402

NAMES = ["valgus", "external", "lateral", "anterior", "superior"]
LOADS = ["load_vv_nm", "load_ie_nm", "load_ml_n", "load_ap_n", "load_si_n"]
LIMIT = 0.2


def main():
    folder, model, results = (os.path.abspath(p) for p in sys.argv[1:4])
    opensim.Logger.setLevelString("Error")
    frames = json.load(open(model))["frames"]
    files = {}
    for row in csv.DictReader(open(os.path.join(folder, "steps.csv"))):
        files.setdefault(row["file"], []).append(row)
    there = {name for name in os.listdir(folder) if name.endswith(".osim")} - {"model.osim"}
    assert set(files) == there and len(files) >= 6, (sorted(files), sorted(there))
    os.chdir(folder)
    still = opensim.Model("model.osim")
    still.initSystem()
    assert still.getNumControls() == 0
    for name, rows in files.items():
        knee = opensim.Model(name)
        state = knee.initSystem()
        turn = []
        for row in rows:
            state.setTime(float(row["to_s"]))
            knee.assemble(state)
            knee.realizeDynamics(state)
            turn.append(np.degrees(knee.getCoordinateSet().get("flexion").getValue(state)) - float(row["fe_deg"]))
            forces = [opensim.CoordinateActuator.safeDownCast(knee.getForceSet().get(f"load_{n}")).getActuation(state) for n in NAMES]
            assert np.allclose(forces, [float(row[c]) for c in LOADS], atol=1e-4), (name, row, forces)
        # flexion counts from the CT pose there
        assert np.ptp([*turn, -frames["gs_ct_pose"]["fe_deg"]]) < 1e-3, (name, turn)
    print(f"opensim: {len(files)} protocols hold the flexions and loads of steps.csv")
    ours = {row["trial"]: row for row in csv.DictReader(open(results))}
    asked = {name: ours[rows[-1]["trial"]] for name, rows in files.items() if rows[-1]["trial"] in ours}
    assert asked, "no file is of a trial of the results"
    subprocess.run([sys.executable, "follow.py", *asked], check=True)
    knee, worst = Knee(folder, frames), 0.0
    for name, row in asked.items():
        *_, last = csv.DictReader(open(name.replace(".osim", "_poses.csv")))
        q = [float(last[c]) for c in ("flexion_deg", "valgus_deg", "external_deg", "lateral_mm", "anterior_mm", "superior_mm")]
        pose = knee.pose(np.array([*np.radians(q[:3]), *(1e-3 * np.array(q[3:]))]))
        off = np.abs(pose - [float(row[c]) for c in POSE])
        assert float(last["unbalanced"]) < 1e-5 and (off < LIMIT).all(), (name, pose, off)
        worst = max(worst, off.max())
    print(f"opensim: {len(asked)} trials taken to rest from the CT pose, within {worst:.3f} deg or mm of ours")


if __name__ == "__main__":
    main()
