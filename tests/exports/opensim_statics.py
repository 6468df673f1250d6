"""Loads an exported OpenSim model, finds its equilibrium under given loads, and compares it with the poses and ligament forces of ours.

usage: opensim_statics.py EXPORT_FOLDER MODEL.json RESULTS.csv [LEAST_TRIALS]
RESULTS.csv is what `simulate --trials` wrote. Needs `pip install opensim==4.6`. Ends with status 1 where a pose differs by more than 0.2 mm or 0.2 deg,
or a bundle's force by more than 3 % of itself and 1 N, or where fewer trials than LEAST_TRIALS have a pose and no flag.
"""

import csv
import json
import os
import sys

import numpy as np
import opensim

NAMES = ["flexion", "valgus", "external", "lateral", "anterior", "superior"]
POSE = ["fe_deg", "vv_deg", "ie_deg", "ml_mm", "ap_mm", "si_mm"]
LOADS = ["load_vv_nm", "load_ie_nm", "load_ml_n", "load_ap_n", "load_si_n"]
LIMIT = np.array([0.2] * 5)


def grood_suntay(r, p, frames):
    """Grood-Suntay coordinates of a femur moved by x -> r x + p (mm) from the CT pose, clinical signs; deg, mm [grood1983]."""
    axes = lambda f: np.column_stack([f["medial"], f["anterior"], f["superior"]])
    f = r @ axes(frames["femur"])
    origin = r @ np.array(frames["femur"]["origin"]) + p
    m = f.T @ axes(frames["tibia"])
    t = f.T @ (np.array(frames["tibia"]["origin"]) - origin)
    fe = np.arctan2(m[1, 2], m[2, 2])
    vv = np.arcsin(np.clip(m[0, 2], -1, 1))
    ie = np.arctan2(-m[0, 1], m[0, 0])
    return np.array([*np.degrees([fe, vv, ie]), -t[0], t[1] * np.cos(fe) - t[2] * np.sin(fe), m[:, 2] @ t])


class Knee:
    """The OpenSim model as a function of its six coordinates (rad, m)."""

    def __init__(self, folder, frames):
        os.chdir(folder)
        self.model = opensim.Model("model.osim")
        self.state = self.model.initSystem()
        self.frames = frames
        self.coordinates = [self.model.getCoordinateSet().get(n) for n in NAMES]
        self.statics = opensim.InverseDynamicsSolver(self.model)
        # from the ground up, as the solver counts
        order = [self.model.getCoordinateSet().get(i).getName() for i in range(6)]
        self.place = [order.index(n) for n in NAMES]
        forces = self.model.getForceSet()
        self.ligaments = [opensim.Blankevoort1991Ligament.safeDownCast(forces.get(i)) for i in range(forces.getSize())]
        self.ligaments = [l for l in self.ligaments if l is not None]

    def set(self, q):
        for c, x in zip(self.coordinates, q):
            c.setValue(self.state, float(x), False)
            c.setSpeedValue(self.state, 0.0)

    def needed(self, q):
        """Generalised forces that hold the knee still at q, in the order of NAMES (N m, N)."""
        self.set(q)
        self.model.realizeAcceleration(self.state)
        found = self.statics.solve(self.state, opensim.Vector(6, 0.0))
        return np.array([found[i] for i in self.place])

    def pose(self, q):
        self.set(q)
        self.model.realizePosition(self.state)
        x = self.model.getBodySet().get("femur").getTransformInGround(self.state)
        r = np.array([[x.R().get(i, j) for j in range(3)] for i in range(3)])
        return grood_suntay(r, 1e3 * np.array([x.p()[i] for i in range(3)]), self.frames)

    def from_pose(self, wanted, q):
        """Coordinates at a Grood-Suntay pose, by Newton's method."""
        scale = np.array([np.radians(1)] * 3 + [1e-3] * 3)
        for _ in range(20):
            miss = wanted - self.pose(q)
            if np.abs(miss).max() < 1e-9:
                break
            slope = np.column_stack([(self.pose(q + scale * e) - self.pose(q - scale * e)) / 2 for e in np.eye(6)])
            q = q + scale * np.linalg.solve(slope, miss)
        return q

    def equilibrium(self, q, load):
        """From q, with flexion held: where the five others need just the load (N m, N)."""
        free = [1, 2, 3, 4, 5]
        step = np.array([2e-4, 2e-4, 5e-6, 5e-6, 5e-6])
        size = np.array([1.0, 1.0, 50.0, 50.0, 50.0])
        miss = self.needed(q)[free] - load
        slope = np.empty((5, 5))
        for turn in range(96):
            if np.abs(miss / size).max() < 1e-6:
                break
            # the slope is taken anew now and then, and learns from each step between (Broyden's method)
            if turn % 8 == 0:
                for k, f in enumerate(free):
                    e = np.zeros(6)
                    e[f] = step[k]
                    slope[:, k] = (self.needed(q + e)[free] - self.needed(q)[free]) / step[k]
            move = -np.linalg.lstsq(slope, miss, rcond=None)[0]
            move *= min(1.0, 1.0 / np.abs(move / np.array([0.02, 0.02, 5e-4, 5e-4, 5e-4])).max())
            q = q.copy()
            q[free] += move
            then = self.needed(q)[free] - load
            slope += np.outer(then - miss - slope @ move, move) / (move @ move)
            miss = then
        return q, np.abs(miss / size).max()

    def forces(self, q):
        """Force of each bundle (N)."""
        self.set(q)
        self.model.realizeDynamics(self.state)
        out = {}
        for l in self.ligaments:
            bundle = l.getName().rsplit("_", 1)[0]
            out[bundle] = out.get(bundle, 0.0) + l.getTotalForce(self.state)
        return out


def main():
    folder, model, results = (os.path.abspath(p) for p in sys.argv[1:4])
    least = int(sys.argv[4]) if len(sys.argv) > 4 else 1
    opensim.Logger.setLevelString("Error")
    frames = json.load(open(model))["frames"]
    # a knee off its plateau has several equilibria; a ligament beyond its failure load has not
    off = ("dislocated", "subluxed", "rotated", "the plateau")
    whole = lambda r: all(r[p] for p in POSE) and not any(word in (r.get("flags") or "") for word in off)
    rows = [r for r in csv.DictReader(open(results)) if whole(r)]
    if len(rows) < least:
        sys.exit(f"{len(rows)} trials of {results} have a pose on the plateau, expected {least} or more")
    knee = Knee(folder, frames)
    bundles = [c[6:-2] for c in rows[0] if c.startswith("force_")]
    worst, worst_force, worst_held, bad = np.zeros(5), 0.0, 0.0, 0
    for row in rows:
        ours = np.array([float(row[p]) for p in POSE])
        load = np.array([float(row[l] or 0) for l in LOADS])
        q = knee.from_pose(ours, np.zeros(6))
        held = knee.forces(q)
        for b in bundles:
            force = float(row[f"force_{b}_n"])
            worst_held = max(worst_held, abs(held.get(b, 0.0) - force) / max(force, 100 / 3))
        q, left = knee.equilibrium(q, load)
        off = np.abs(knee.pose(q) - ours)[1:]
        forces = knee.forces(q)
        share = max(max(0.0, abs(forces.get(b, 0.0) - float(row[f"force_{b}_n"])) - 1.0) / max(float(row[f"force_{b}_n"]), 1e-9) if abs(forces.get(b, 0.0) - float(row[f"force_{b}_n"])) > 1.0 else 0.0 for b in bundles)
        good = left < 1e-5 and (off <= LIMIT).all() and share <= 0.03
        bad += not good
        worst, worst_force = np.maximum(worst, off), max(worst_force, share)
        print(f"{(row.get('trial') or row.get('step') or ''):>24}: off by", " ".join(f"{x:.3f}" for x in off), f"deg deg mm mm mm, forces {100 * share:.1f} %, unbalanced {left:.1e}{'' if good else '  <-'}")
    print(f"{len(rows)} trials: worst {worst[:2].max():.3f} deg, {worst[2:].max():.3f} mm, forces {100 * worst_force:.1f} %; ligaments at our poses within {100 * worst_held:.2f} %; {bad} beyond 0.2 mm, 0.2 deg, 3 %")
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
