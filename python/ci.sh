#!/usr/bin/env bash
# Holds licences to deny.toml, builds the wheel, installs it into a clean environment and tests it there: pytest, the notebook, the example
# (`wheel`); the workflow (`cohort`). Both without an argument.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
work=$PWD/target/python
mkdir -p "$work"

# cargo deny knows more: faults that were found in crates since.
licences() {
  if cargo deny --version >/dev/null 2>&1; then
    cargo deny check bans licenses sources
    if cargo deny fetch db >/dev/null 2>&1; then cargo deny check advisories; else echo "the list of advisories cannot be had: it is not asked"; fi
  else
    echo "cargo deny is not available: licences and sources are checked without it, advisories are not asked"
    python3 python/licences.py
  fi
}

wheel() {
  licences
  rm -rf "$work/wheels" "$work/venv"
  [ -x "$work/maturin/bin/maturin" ] || { python3 -m venv "$work/maturin" && "$work/maturin/bin/pip" install -q "maturin>=1.9,<2"; }
  python3 python/third_party.py
  "$work/maturin/bin/maturin" build --release --locked -m python/Cargo.toml -o "$work/wheels"

  python3 -m venv "$work/venv"
  "$work/venv/bin/pip" install -q "$(ls "$work"/wheels/*.whl)[test]" tqdm pyarrow
  # without them the cells of the notebook run as plain Python alone
  "$work/venv/bin/pip" install -q nbclient ipykernel >/dev/null 2>&1 || echo "nbclient is not available: the notebook runs as plain Python"
  size=$(stat -c %s "$work"/wheels/*.whl)
  echo "wheel: $((size / 1024)) KiB"
  [ "$size" -le $((25 * 1024 * 1024)) ] || { echo "the wheel is larger than 25 MiB"; exit 1; }

  # the list is read to its end: a reader that leaves early would break the pipe
  listed=$(python3 -m zipfile -l "$(ls "$work"/wheels/*.whl)")
  [[ $listed == *licenses/THIRD-PARTY-NOTICES.txt* ]] || { echo "the wheel has no notices of third parties"; exit 1; }

  # Outside the sources: what is installed is what is tried.
  cd "$work"
  "$work/venv/bin/python" -m pytest -q -p no:cacheprovider ../../python/tests
  rm -rf first-knee && "$work/venv/bin/python" ../../examples/python/first_knee.py first-knee >/dev/null
  test -s first-knee/thickness.png && test -s first-knee/drawer.png && test -s first-knee/laxity.png
}

# Each way in which a build may end, by a command that pretends. Three knees, one of them broken, by Snakemake: killed on the way, run again.
# Then two on a full disk.
cohort() {
  cd "$work"
  [ -x "$work/snakemake/bin/snakemake" ] || { python3 -m venv "$work/snakemake" && "$work/snakemake/bin/pip" install -q "snakemake>=9,<10"; }
  "$work/venv/bin/python" ../../workflow/try_statuses.py --snakemake "$work/snakemake/bin/snakemake" --folder "$work/statuses"
  "$work/venv/bin/python" ../../workflow/try.py --command "$work/venv/bin/build-model" --snakemake "$work/snakemake/bin/snakemake" \
    --folder "$work/cohort" --ids S192803-phantom --seeds 1 2 3 --to cartilage --kill-after 6
  "$work/venv/bin/python" ../../workflow/try_full.py --command "$work/venv/bin/build-model" --snakemake "$work/snakemake/bin/snakemake" \
    --folder "$work/full"
}

case ${1:-all} in
  wheel) wheel ;;
  cohort) cohort ;;
  all) bash python/ci.sh wheel && bash python/ci.sh cohort ;;
  *) echo "wheel, cohort, or nothing for both"; exit 2 ;;
esac
