"""Tries the workflow on a full disk: no knee may be lost there, and with room each is built.

The results lie on a small file system of memory where it may be mounted (root), else no file may grow beyond a limit. Ends with status 1 and a
line for each fault. Needs nothing beyond Python's own library.
"""

import argparse
import pathlib
import resource
import shutil
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
# less than a knee's surfaces [bytes]
SMALL = 1 << 20
# room for all of them [MiB]
ROOM_MIB = 400


def main():
    parse = argparse.ArgumentParser(description=__doc__)
    parse.add_argument("--command", default="build-model")
    parse.add_argument("--snakemake", default="snakemake")
    parse.add_argument("--folder", type=pathlib.Path, required=True)
    parse.add_argument("--id", default="S193761-phantom")
    parse.add_argument("--knees", type=int, default=2)
    parse.add_argument("--to", default="ingest")
    a = parse.parse_args()
    command = shutil.which(a.command)
    results = a.folder / "results"
    subprocess.run(["umount", str(results)], capture_output=True)
    shutil.rmtree(a.folder, ignore_errors=True)
    results.mkdir(parents=True)

    knees = [f"knee{k}" for k in range(a.knees)]
    made = a.folder / "specimen"
    subprocess.run([command, "phantom", a.id, str(made)], check=True, capture_output=True)
    rows = "".join(f"{k},{made.resolve()}\n" for k in knees)
    (a.folder / "specimens.csv").write_text("knee,specimen\n" + rows)

    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={SMALL}", "genu", str(results)], capture_output=True).returncode == 0

    def limited():
        resource.setrlimit(resource.RLIMIT_FSIZE, (SMALL, SMALL))

    words = [a.snakemake, "-s", str(HERE / "Snakefile"), "--cores", "1", "--keep-going", "--config", "table=specimens.csv", "results=results"]
    words += [f"command={command}", "threads=1", "retries=1", f"to={a.to}"]

    def run(full):
        return subprocess.run(words, cwd=a.folder, capture_output=True, text=True, preexec_fn=limited if full and not mounted else None)

    def done():
        return sorted(p.stem for p in (results / "status").glob("*.txt") if p.read_text().strip() == "0")

    faults = []
    try:
        full = run(True)
        lost = sorted(p.name for p in (results / "status").glob("*.txt"))
        if full.returncode == 0:
            faults.append(f"snakemake ended with 0 on a full disk: {full.stderr[-500:]}")
        if lost:
            faults.append(f"on a full disk these knees were marked as done: {lost}")
        if mounted:
            subprocess.run(["mount", "-o", f"remount,size={ROOM_MIB}M", str(results)], check=True, capture_output=True)
        room = run(False)
        if room.returncode != 0 or done() != knees:
            faults.append(f"with room: status {room.returncode}, built {done()} of {knees}: {room.stderr[-500:]}")
    finally:
        if mounted:
            subprocess.run(["umount", str(results)], check=False)
    print(f"{'a full disk' if mounted else 'files limited'}: none of {len(knees)} knees lost; with room each built" if not faults else "")
    for fault in faults:
        print(f"fault: {fault}", file=sys.stderr)
    sys.exit(bool(faults))


main()
