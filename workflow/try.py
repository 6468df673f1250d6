"""Tries the workflow on phantoms: kills it on the way, runs it again, edits what it left, and compares with single builds.

One knee is broken on purpose (a row of its landmarks is cut). Ends with status 1 and a line for each fault.
Needs nothing beyond Python's own library.
"""

import argparse
import hashlib
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time

HERE = pathlib.Path(__file__).resolve().parent


def digests(folder):
    """Of what a build leaves, without what tells times."""
    files = (p for p in sorted(folder.rglob("*")) if p.is_file() and p.name not in ("log.jsonl", ".lock"))
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


def main():
    parse = argparse.ArgumentParser(description=__doc__)
    parse.add_argument("--command", default="build-model")
    parse.add_argument("--snakemake", default="snakemake")
    parse.add_argument("--folder", type=pathlib.Path, required=True)
    parse.add_argument("--ids", nargs="+", required=True)
    parse.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3, 4])
    parse.add_argument("--to", default="")
    parse.add_argument("--cores", default="2")
    parse.add_argument("--kill-after", type=float, default=60, help="seconds")
    parse.add_argument("--compare", type=int, default=1, help="how many knees are built alone to compare")
    a = parse.parse_args()
    shutil.rmtree(a.folder, ignore_errors=True)
    (a.folder / "specimens").mkdir(parents=True)

    def run(*words, **more):
        return subprocess.run([a.command, *map(str, words)], check=True, capture_output=True, text=True, **more).stdout

    knees = [f"{i}-{seed}" for i in a.ids for seed in a.seeds]
    for knee in knees:
        i, seed = knee.rsplit("-", 1)
        run("phantom", i, a.folder / "specimens" / knee, "--seed", seed)
    broken = knees[1]
    (a.folder / "specimens" / broken / "landmarks.csv").write_text("name,frame,x_mm,y_mm,z_mm\nepicondyle_medial,ct,1,2\n")
    rows = "".join(f"{k},{a.folder.resolve() / 'specimens' / k}\n" for k in knees)
    (a.folder / "specimens.csv").write_text("knee,specimen\n" + rows)

    words = [a.snakemake, "-s", str(HERE / "Snakefile"), "--profile", str(HERE / "profiles" / "laptop"), "--cores", a.cores]
    words += ["--config", "table=specimens.csv", "results=results", f"command={shutil.which(a.command)}", "threads=1"]
    words += [f"to={a.to}"] if a.to else []
    log = open(a.folder / "snakemake.log", "w")
    begun = time.monotonic()
    first = subprocess.Popen(words, cwd=a.folder, stdout=log, stderr=log, start_new_session=True)
    try:
        first.wait(a.kill_after)
    except subprocess.TimeoutExpired:
        os.killpg(first.pid, signal.SIGKILL)
        first.wait()
    builds = a.folder / "results" / "builds"
    done = {p.relative_to(builds): p.stat().st_mtime_ns for p in builds.glob("*/*/stage.json")}
    finished = len(list((a.folder / "results" / "status").glob("*.txt")))
    print(f"killed after {time.monotonic() - begun:.0f} s: {finished} of {len(knees)} knees and {len(done)} stages done")
    subprocess.run([*words, "--unlock"], cwd=a.folder, stdout=log, stderr=log, check=True)
    begun = time.monotonic()
    second = subprocess.run(words, cwd=a.folder, stdout=log, stderr=log)
    print(f"second run: {time.monotonic() - begun:.0f} s, status {second.returncode}")

    faults = []

    def expect(holds, words):
        if not holds:
            faults.append(words)

    expect(second.returncode == 0, f"snakemake ended with status {second.returncode}; see {a.folder / 'snakemake.log'}")
    again = [str(p) for p, at in done.items() if (builds / p).stat().st_mtime_ns != at]
    expect(not again, f"built twice: {again}")
    cohort = a.folder / "results" / "cohort"
    told = json.loads(run("cohort", *[builds / k for k in knees], "--out", cohort, "--json"))
    failed = [k["knee"] for k in told["knees"] if k["status"] == "failed"]
    expect(failed == [broken], f"failed: {failed}, expected {[broken]}")
    page = (cohort / "cohort.html").read_text(encoding="utf-8")
    expect("landmarks.csv" in page and broken in page, "the page does not tell why the broken knee failed")
    reports = [k for k in knees if (builds / k / "report.html").is_file() and k != broken]
    expect(len(reports) == len(knees) - 1, f"{len(reports)} reports of knees that were built")
    third = subprocess.run([*words, "--dry-run", "--quiet"], cwd=a.folder, capture_output=True, text=True)
    expect("Nothing to be done" in third.stdout + third.stderr, f"a third run would build again: {third.stdout}")
    # what somebody edited stays, the page and a table alike, until it may be written over
    for edited in (cohort / "cohort.html", cohort / "knees.csv"):
        edited.write_text("by hand", encoding="utf-8")
        refused = subprocess.run([*words, "--forcerun", "cohort"], cwd=a.folder, capture_output=True, text=True)
        told = refused.stdout + refused.stderr
        is_told = f"{edited.name} was changed since it was written" in told
        expect(refused.returncode != 0 and is_told, f"an edit of {edited.name} is not told: {told[-500:]}")
        expect(edited.is_file() and edited.read_bytes() == b"by hand", f"an edit of {edited.name} was lost")
        forced = subprocess.run([*words, "force=true", "--forcerun", "cohort"], cwd=a.folder, capture_output=True, text=True)
        expect(forced.returncode == 0 and edited.read_bytes() != b"by hand", f"{edited.name} is not written over by force: {forced.stderr[-500:]}")
    for knee in [k for k in knees if k != broken][-a.compare :]:
        alone = a.folder / "alone" / knee
        run(a.folder / "specimens" / knee, "--out", alone, "--quiet", *(["--to", a.to] if a.to else []))
        expect(digests(alone) == digests(builds / knee), f"{knee}: other bytes than a single build")
    print(f"{len(reports)} reports, failed: {', '.join(failed)}; {len(faults)} faults")
    for fault in faults:
        print(f"fault: {fault}", file=sys.stderr)
    sys.exit(bool(faults))


main()
