"""Takes each protocol of this folder through OpenSim, one pose of rest after another: `python follow.py [FILE.osim ...]`.

Needs `pip install opensim==4.6`. A file holds flexion and puts loads on over time. At each time this script finds the pose in which the knee is at rest
under them, by inverse dynamics at rest, and starts at the pose before. It writes FILE_poses.csv: coordinates in deg and mm, counted from the CT pose, and
what is left unbalanced, in N m and in parts of 50 N. Integrating in time with `opensim.Manager` takes far longer, since contact is stiff.
"""

import csv
import pathlib
import sys

import numpy as np
import opensim

FREE = ["valgus", "external", "lateral", "anterior", "superior"]
# steps of a slope [rad, m], longest steps of a search, and loads [N m, N] that count as much as one another
STEP = np.array([2e-4, 2e-4, 5e-6, 5e-6, 5e-6])
LONGEST = np.array([0.02, 0.02, 5e-4, 5e-4, 5e-4])
SIZE = np.array([1.0, 1.0, 50.0, 50.0, 50.0])
# of the points of a protocol every so many-th, and the last
EVERY = 4


class Knee:
    def __init__(self, path):
        self.model = opensim.Model(str(path))
        self.state = self.model.initSystem()
        coordinates = self.model.getCoordinateSet()
        self.flexion = coordinates.get("flexion")
        self.course = self.flexion.getPrescribedFunction()
        self.flexion.setIsPrescribed(self.state, False)
        self.free = [coordinates.get(name) for name in FREE]
        self.statics = opensim.InverseDynamicsSolver(self.model)
        order = [coordinates.get(i).getName() for i in range(coordinates.getSize())]
        self.place = [order.index(name) for name in FREE]

    def times(self):
        spline = opensim.SimmSpline.safeDownCast(self.course)
        every = [spline.getX(i) for i in range(spline.getNumberOfPoints())]
        return every[:-1][::EVERY] + every[-1:]

    def at(self, time):
        self.state.setTime(time)
        self.turn = self.course.calcValue(opensim.Vector(1, time))

    def unbalanced(self, q):
        """Generalised forces that would hold the knee still at q [N m, N]."""
        self.flexion.setValue(self.state, float(self.turn), False)
        for coordinate, value in zip(self.free, q):
            coordinate.setValue(self.state, float(value), False)
        self.state.updU().setToZero()
        self.model.realizeAcceleration(self.state)
        found = self.statics.solve(self.state, opensim.Vector(self.state.getNU(), 0.0))
        return np.array([found[i] for i in self.place])

    def rest(self, q):
        """From q on: where nothing is left unbalanced."""
        miss, slope = self.unbalanced(q), np.empty((5, 5))
        for turn in range(96):
            if np.abs(miss / SIZE).max() < 1e-6:
                break
            # the slope is taken anew now and then, and learns from each step between (Broyden's method)
            if turn % 8 == 0:
                for k in range(5):
                    slope[:, k] = (self.unbalanced(q + STEP * np.eye(5)[k]) - miss) / STEP[k]
            move = -np.linalg.lstsq(slope, miss, rcond=None)[0]
            move *= min(1.0, 1.0 / np.abs(move / LONGEST).max())
            q, then = q + move, self.unbalanced(q + move)
            slope += np.outer(then - miss - slope @ move, move) / (move @ move)
            miss = then
        return q, np.abs(miss / SIZE).max()


def main():
    here = pathlib.Path(__file__).resolve().parent
    files = [pathlib.Path(p) for p in sys.argv[1:]] or sorted(p for p in here.glob("*.osim") if p.name != "model.osim")
    opensim.Logger.setLevelString("Error")
    for path in files:
        knee, q, rows = Knee(path), np.zeros(5), []
        for time in knee.times():
            knee.at(time)
            q, left = knee.rest(q)
            rows.append([time, np.degrees(knee.turn), *np.degrees(q[:2]), *(1e3 * q[2:]), left])
        out = path.with_name(path.stem + "_poses.csv")
        with open(out, "w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["time_s", "flexion_deg", "valgus_deg", "external_deg", "lateral_mm", "anterior_mm", "superior_mm", "unbalanced"])
            writer.writerows([[f"{x:.6g}" for x in row] for row in rows])
        print(f"{out.name}: {len(rows)} poses, at most {max(r[-1] for r in rows):.1e} unbalanced")


if __name__ == "__main__":
    main()
