"""Tries how the workflow takes the ways in which a build may end, with a command that only pretends: no knee is built.

One knee is built, one has data at fault (exit status 1), one meets a fault of the program (4), one is short of memory at first (3). Then one
never gets it, and one has no folder. Ends with status 1 and a line for each fault. Needs nothing beyond Python's own library.
"""

import argparse
import csv
import pathlib
import shutil
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent

# build: counts its calls in the specimen's folder, and ends as the file `status` there says; `once` is the status of the first call alone
COMMAND = """#!/bin/sh
if [ "$1" = cohort ]; then
    while [ "$1" != --out ]; do shift; done
    mkdir -p "$2" && echo page > "$2/cohort.html"
    exit
fi
echo call >> "$1/.calls"
if [ -f "$1/.once" ] && [ "$(wc -l < "$1/.calls")" -eq 1 ]; then exit "$(cat "$1/.once")"; fi
exit "$(cat "$1/status")"
"""


def main():
    parse = argparse.ArgumentParser(description=__doc__)
    parse.add_argument("--snakemake", default="snakemake")
    parse.add_argument("--folder", type=pathlib.Path, required=True)
    a = parse.parse_args()
    shutil.rmtree(a.folder, ignore_errors=True)
    a.folder.mkdir(parents=True)
    top = a.folder.resolve()
    command = top / "command"
    command.write_text(COMMAND)
    command.chmod(0o755)
    faults = []

    def expect(holds, words):
        if not holds:
            faults.append(words)

    def run(name, knees, gone=()):
        place = top / name
        for knee, status in knees.items():
            own = place / "specimens" / knee
            own.mkdir(parents=True)
            (own / "status").write_text(status.rpartition(" ")[2])
            if " " in status:
                (own / ".once").write_text(status.partition(" ")[0])
        rows = "".join(f"{k},{place / 'specimens' / k}\n" for k in [*knees, *gone])
        (place / "specimens.csv").write_text("knee,specimen\n" + rows)
        words = [a.snakemake, "-s", str(HERE / "Snakefile"), "--profile", str(HERE / "profiles" / "laptop"), "--cores", "2", "--config"]
        words += ["table=specimens.csv", "results=results", f"command={command}", "threads=1", "retries=1"]
        ended = subprocess.run(words, cwd=place, capture_output=True, text=True)
        logs = "".join(p.read_text() for p in (place / ".snakemake" / "log").glob("*.log"))
        return ended, ended.stdout + ended.stderr, logs, place

    def table(path):
        with open(path, newline="", encoding="utf-8") as file:
            return {row["knee"]: (row["status"], row["meaning"]) for row in csv.DictReader(file)}

    def calls(place, knee):
        return len((place / "specimens" / knee / ".calls").read_text().split())

    ended, told, logs, place = run("whole", {"built": "0", "data": "1", "program": "4", "memory": "3 0"})
    expect(ended.returncode == 0, f"status {ended.returncode}: {told[-2000:]}")
    if ended.returncode == 0:
        found = table(place / "results" / "cohort" / "statuses.csv")
        wanted = {"built": ("0", "built"), "data": ("1", "data at fault"), "program": ("4", "program at fault"), "memory": ("0", "built")}
        expect(found == wanted, f"statuses.csv has {found}")
        expect("program at fault (please report it, with the knee's log): program" in logs, "Snakemake's log does not tell of the program's fault")
        expect("data at fault (see the cohort's page): data" in logs, "Snakemake's log does not tell of the data at fault")
        counted = {knee: calls(place, knee) for knee in wanted}
        expect(counted == {"built": 1, "data": 1, "program": 1, "memory": 2}, f"builds were called {counted}")

    ended, told, logs, place = run("lost", {"built": "0", "lost": "3"})
    expect(ended.returncode != 0, "a knee that the machine never built is no failure")
    so_far = place / "results" / "cohort-so-far" / "statuses.csv"
    expect(so_far.is_file() and table(so_far) == {"built": ("0", "built"), "lost": ("", "no result")}, "statuses so far")
    expect("no result (see its log, then run the same command again): lost" in logs, "Snakemake's log does not tell of the knee that was lost")
    expect(calls(place, "lost") == 2, "status 3 was not tried again")

    ended, told, _, place = run("gone", {"built": "0"}, gone=["nowhere"])
    expect(ended.returncode != 0 and "knee nowhere: there is no folder" in told, f"a folder that is not there: {told[-2000:]}")
    expect(not (place / "results" / "status" / "nowhere.txt").exists(), "a folder that is not there counts as a result")

    print(f"ways in which a build may end: {len(faults)} faults")
    for fault in faults:
        print(f"fault: {fault}", file=sys.stderr)
    sys.exit(bool(faults))


main()
