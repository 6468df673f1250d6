"""What laxity of a cut knee adds: made knees calibrated to the whole knee alone, and to the whole and the cut one.

usage: cut_knees.py ASSEMBLED.json PLAN.csv KNEE...
  ASSEMBLED.json: the model before its calibration; PLAN.csv: trials of the cut knee, with the columns without and sd_..., poses empty.
  KNEE: a folder with true.json and laxity.csv, as `plan_scores --make` writes them. `build-model` is on the PATH.

Each true knee answers PLAN.csv with noise. Trials in which it leaves its plateau are left out. The drawer of 90 N without the ligaments of PLAN.csv, at
0 to 90 deg, is set beside the true one: all flexions, and those at which the true knee stays on its plateau.
"""
import csv, random, statistics, subprocess, sys
from pathlib import Path

POSES = ["vv_deg", "ie_deg", "ml_mm", "ap_mm", "si_mm"]
FLEXIONS = range(0, 91, 15)
DRAWER_N = 90.0
SEED = 5


def run(*args):
    subprocess.run(["build-model", *map(str, args), "--quiet"], check=True)


def rows(path):
    return list(csv.DictReader(open(path, newline="")))


def answers(model, trials, out):
    run("simulate", model, "--trials", trials, "--samples", 0, "--force", "--out", out)
    return {r["trial"]: r for r in rows(out)}


def leaves(row):
    return "subluxed" in row["flags"] or "dislocated" in row["flags"]


def measured(knee, plan, out, noise):
    """What the true knee reads under the plan, with noise."""
    told, table = answers(knee / "true.json", plan, knee / "answers.csv"), rows(plan)
    with open(out, "w", newline="") as file:
        table_of = csv.DictWriter(file, list(table[0]), lineterminator="\n")
        table_of.writeheader()
        for row in table:
            here = told[row["trial"]]
            read = {c: f"{float(here[c]) + noise.gauss(0, float(row[f'sd_{c}'])):.4f}" for c in POSES if here[c]}
            if not leaves(here) and read:
                table_of.writerow(row | read)


def drawers(model, without, work):
    """How far the tibia comes forward at each flexion [mm], and whether the knee stays on its plateau."""
    table = work / "drawers.csv"
    head = "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm,without\n"
    line = "{0}_{1},{2},{0},0,0,0,{1},20,{0},,,,,,{3}\n"
    each = [line.format(f, n, test, without) for f in FLEXIONS for n, test in ((0, "neutral"), (DRAWER_N, "anterior"))]
    table.write_text(head + "".join(each))
    told = answers(model, table, work / "answers.csv")
    pairs = [(told[f"{f}_0"], told[f"{f}_{DRAWER_N}"]) for f in FLEXIONS]
    way = [float(b["ap_mm"] or "nan") - float(a["ap_mm"] or "nan") for a, b in pairs]
    return way, [not leaves(b) for _, b in pairs]


def rms(values):
    return (sum(x * x for x in values) / len(values)) ** 0.5 if values else float("nan")


def main():
    assembled, plan, knees = Path(sys.argv[1]), Path(sys.argv[2]), [Path(k) for k in sys.argv[3:]]
    without, noise, found = rows(plan)[0]["without"], random.Random(SEED), []
    for knee in knees:
        measured(knee, plan, knee / "cut.csv", noise)
        whole = ["--targets", f"whole={knee / 'laxity.csv'}"]
        errors = []
        for name, targets in (("whole", whole), ("both", whole + ["--targets", f"cut={knee / 'cut.csv'}"])):
            run("calibrate", assembled, *targets, "--out", knee / name)
            of_state = []
            for state in (without, ""):
                true, stays = drawers(knee / "true.json", state, knee)
                way, _ = drawers(knee / name / "model.json", state, knee)
                off = [a - b for a, b in zip(way, true)]
                of_state += [rms(off), rms([x for x, here in zip(off, stays) if here])]
            errors.append(of_state[:3])
        found.append(errors)
        print(knee.name, *("%.2f %.2f %.2f" % tuple(e) for e in errors), sep="  ", flush=True)
    for k, what in enumerate([f"without {without}", "of these on the plateau", "intact"]):
        pairs = [(a[k], b[k]) for a, b in found if a[k] == a[k] and b[k] == b[k]]
        before, after = (statistics.median(x) for x in zip(*pairs))
        nearer = sum(b < a for a, b in pairs)
        print(f"{what}: median error {before:.2f} mm by the whole knee, {after:.2f} by both; nearer in {nearer} of {len(pairs)}")


main()
