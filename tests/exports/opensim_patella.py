"""Loads an exported OpenSim model with a patella, pulls on it, and compares where it rests and what its tendon carries with ours.

usage: opensim_patella.py EXPORT_FOLDER MODEL.json RESULTS.csv
RESULTS.csv is what `simulate --trials` wrote, with load_quadriceps_n. Needs `pip install opensim==4.6`. As it was exported the patella is locked and its
forces are switched off. Here they are switched on, and at each of our poses of the knee the patella is let go to its rest. Ends with status 1 where the forces differ by more than 3 % of themselves and 1 N, or the rest by more than 0.3 mm or 0.5 deg.
"""

import csv
import json
import os
import sys

import numpy as np

try:
    import opensim
except ImportError:
    print("opensim is not installed")
    sys.exit(77)

sys.dont_write_bytecode = True
from opensim_statics import NAMES, POSE, grood_suntay

PATELLA = [f"patella_{kind}_{axis}" for kind in ("rotation", "translation") for axis in "xyz"]
REST = ["patella_flexion_deg", "patella_spin_deg", "patella_tilt_deg", "patella_ml_mm", "patella_ap_mm", "patella_si_mm"]
LIMIT = np.array([0.5] * 3 + [0.3] * 3)


def transform(body, state):
    x = body.getTransformInGround(state)
    return np.array([[x.R().get(i, j) for j in range(3)] for i in range(3)]), 1e3 * np.array([x.p()[i] for i in range(3)])


class Knee:
    """The model as a function of the knee's six coordinates and the patella's (rad, m)."""

    def __init__(self, spec):
        self.frames = spec["frames"]
        self.seen = {"femur": self.frames["femur"], "tibia": spec["patella"]["frame"]}
        self.model = opensim.Model("model.osim")
        forces = [self.model.getForceSet().get(i) for i in range(self.model.getForceSet().getSize())]
        self.off = [f.getName() for f in forces if not f.get_appliesForce()]
        for f in forces:
            f.set_appliesForce(True)
        for name in PATELLA:
            coordinate = self.model.getCoordinateSet().get(name)
            assert coordinate.get_locked(), f"{name} is not locked"
            coordinate.set_locked(False)
        self.state = self.model.initSystem()
        self.statics = opensim.InverseDynamicsSolver(self.model)
        # from the ground up, as the solver counts
        order = [self.model.getCoordinateSet().get(i).getName() for i in range(12)]
        self.place = [order.index(n) for n in NAMES + PATELLA]
        self.coordinates = [self.model.getCoordinateSet().get(n) for n in NAMES + PATELLA]
        self.bodies = [self.model.getBodySet().get(n) for n in ("femur", "patella")]
        forces = [self.model.getForceSet().get(i) for i in range(self.model.getForceSet().getSize())]
        self.ligaments = [x for x in map(opensim.Blankevoort1991Ligament.safeDownCast, forces) if x is not None]
        self.heads = [x for x in map(opensim.PathActuator.safeDownCast, forces) if x is not None]

    def pull(self, tension):
        for head in self.heads:
            head.overrideActuation(self.state, True)
            head.setOverrideActuation(self.state, tension * head.getOptimalForce())

    def set(self, q):
        for c, x in zip(self.coordinates, q):
            c.setValue(self.state, float(x), False)
            c.setSpeedValue(self.state, 0.0)

    def needed(self, q):
        self.set(q)
        self.model.realizeAcceleration(self.state)
        found = self.statics.solve(self.state, opensim.Vector(12, 0.0))
        return np.array([found[i] for i in self.place])

    def poses(self, q):
        """Grood-Suntay coordinates of the knee, and of femur against patella; deg, mm."""
        self.set(q)
        self.model.realizePosition(self.state)
        (rf, pf), (rp, pp) = (transform(b, self.state) for b in self.bodies)
        return np.concatenate([grood_suntay(rf, pf, self.frames), grood_suntay(rp.T @ rf, rp.T @ (pf - pp), self.seen)])

    def from_poses(self, wanted):
        scale = np.tile([np.radians(1)] * 3 + [1e-3] * 3, 2)
        q = np.zeros(12)
        for _ in range(40):
            miss = wanted - self.poses(q)
            if np.abs(miss).max() < 1e-9:
                break
            slope = np.column_stack([(self.poses(q + scale * e) - self.poses(q - scale * e)) / 2 for e in np.eye(12)])
            q = q + scale * np.linalg.solve(slope, miss)
        return q

    def rest(self, q):
        """The patella let go from q, the knee held; what is left out of balance (N, moments at 20 mm)."""
        step = np.array([2e-4] * 3 + [4e-6] * 3)
        size = np.array([0.02] * 3 + [1.0] * 3)
        for _ in range(60):
            miss = self.needed(q)[6:]
            if np.abs(miss / size).max() < 1e-4:
                break
            slope = np.empty((6, 6))
            for k in range(6):
                e = np.zeros(12)
                e[6 + k] = step[k]
                slope[:, k] = (self.needed(q + e)[6:] - self.needed(q - e)[6:]) / (2 * step[k])
            move = -np.linalg.lstsq(slope, miss, rcond=None)[0]
            q = q.copy()
            q[6:] += move * min(1.0, 1.0 / np.abs(move / np.array([0.02] * 3 + [4e-4] * 3)).max())
        return q, np.abs(self.needed(q)[6:] / size).max()

    def tension(self, band):
        self.model.realizeDynamics(self.state)
        return sum(x.getTotalForce(self.state) for x in self.ligaments if x.getName().rsplit("_", 1)[0] == band)


def main():
    folder, model, results = (os.path.abspath(p) for p in sys.argv[1:4])
    opensim.Logger.setLevelString("Error")
    spec = json.load(open(model))
    rows = [r for r in csv.DictReader(open(results)) if float(r.get("load_quadriceps_n") or 0) > 0 and not r.get("flags")]
    if not rows:
        sys.exit(f"no trial of {results} has a pull of the quadriceps and no flag")
    os.chdir(folder)
    knee = Knee(spec)
    own = [spec["patella"]["tendon"], *spec["patella"]["retinacula"]]
    # the fibres of its bands, the heads, and its contact: no other force is switched off
    expected = sum(len(b["fibres"]) for b in own) + len(spec["patella"]["quadriceps"]["heads"]) + 1
    assert len(knee.off) == expected, knee.off
    bad = 0
    for row in rows:
        ours = np.array([float(row[p]) for p in POSE + REST])
        knee.pull(float(row["load_quadriceps_n"]))
        q, left = knee.rest(knee.from_poses(ours))
        off = np.abs(knee.poses(q) - ours)[6:]
        knee.needed(q)
        told = {b["name"]: (knee.tension(b["name"]), float(row["patellar_tendon_n" if k == 0 else f"patella_{b['name']}_n"])) for k, b in enumerate(own)}
        alike = all(abs(a - b) <= max(1.0, 0.03 * b) for a, b in told.values())
        good = left < 1e-2 and alike and (off <= LIMIT).all()
        bad += not good
        forces = ", ".join(f"{name} {a:.2f} N ({b:.2f} ours)" for name, (a, b) in told.items())
        print(f"{row['trial']:>12}: rests", " ".join(f"{x:.3f}" for x in off), f"deg mm off; {forces}; unbalanced {left:.1e}{'' if good else '  <-'}")
    print(f"{len(rows)} trials, {len(knee.off)} forces switched off as exported; {bad} beyond the limits")
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
