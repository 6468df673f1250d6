#!/usr/bin/env bash
# Holds licences to deny.toml, builds the wheel, installs it into a clean environment and tests it there: pytest, the notebook, the example
# (`wheel`); the workflow (`cohort`). Both without an argument. `portable` builds the wheel for older systems, `portable aarch64` for that machine.
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

# A wheel has a size that is still quick to get, and the licences of what is in it.
held() {
  local size listed
  size=$(stat -c %s "$1")
  echo "wheel: $((size / 1024)) KiB, $(basename "$1")"
  [ "$size" -le $((25 * 1024 * 1024)) ] || { echo "the wheel is larger than 25 MiB"; exit 1; }
  # the list is read to its end: a reader that leaves early would break the pipe
  listed=$(python3 -m zipfile -l "$1")
  for text in LICENSE-APACHE LICENSE-MIT THIRD-PARTY-NOTICES.txt; do
    [[ $listed == *licenses/$text* ]] || { echo "the wheel has no $text"; exit 1; }
  done
}

wheel() {
  licences
  rm -rf "$work/wheels" "$work/venv"
  [ -x "$work/maturin/bin/maturin" ] || { python3 -m venv "$work/maturin" && "$work/maturin/bin/pip" install -q "maturin>=1.9,<2"; }
  python3 python/third_party.py
  "$work/maturin/bin/maturin" build --release --locked -m python/Cargo.toml -o "$work/wheels"

  python3 -m venv "$work/venv"
  "$work/venv/bin/pip" install -q "$(ls "$work"/wheels/*.whl)[test]" tqdm pyarrow
  # what test_types.py asks beside mypy
  if ! { "$work/venv/bin/pip" install -q pyright && "$work/venv/bin/pyright" --version; } >/dev/null 2>&1; then
    echo "pyright is not available: types are held by mypy alone"
    "$work/venv/bin/pip" uninstall -q -y pyright >/dev/null 2>&1 || true
  fi
  # without them the cells of the notebook run as plain Python alone
  "$work/venv/bin/pip" install -q nbclient ipykernel >/dev/null 2>&1 || echo "nbclient is not available: the notebook runs as plain Python"
  held "$work"/wheels/*.whl

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

# The wheel for systems with glibc 2.17 or later (manylinux2014), linked by zig. maturin refuses a wheel that needs a newer one. It is compiled
# apart from the program, since C code is compiled by zig, too. On this machine it is installed into a clean environment and asked for a knee.
portable() {
  local machine=${1:-x86_64} out=$work/portable
  [ "$(uname -s)" = Linux ] || { echo "a wheel for older Linux is built on Linux"; return 0; }
  rustup target add "$machine-unknown-linux-gnu" >/dev/null 2>&1 || { echo "Rust for $machine is not available: its wheel is left out"; return 0; }
  [ -x "$work/maturin/bin/maturin" ] || { python3 -m venv "$work/maturin" && "$work/maturin/bin/pip" install -q "maturin>=1.9,<2"; }
  "$work/maturin/bin/pip" install -q ziglang >/dev/null 2>&1 || { echo "ziglang is not available: the wheel for older systems is left out"; return 0; }
  python3 python/third_party.py
  mkdir -p "$out" && rm -f "$out"/*"$machine".whl
  # maturin asks python3 of the path for zig
  PATH=$work/maturin/bin:$PATH maturin build --release --locked --zig --compatibility manylinux2014 \
    --target "$machine-unknown-linux-gnu" -m python/Cargo.toml -o "$out"
  held "$out"/*"$machine".whl
  [ "$machine" = "$(uname -m)" ] || { echo "the wheel for $machine is built; it cannot be tried on this machine"; return 0; }
  rm -rf "$work/portable-venv" && python3 -m venv "$work/portable-venv"
  "$work/portable-venv/bin/pip" install -q "$(ls "$out"/*"$machine".whl)"
  cd "$work" && rm -rf portable-knee && "$work/portable-venv/bin/build-model" phantom S193761-phantom portable-knee --build -q
  test -s portable-knee/build/09-assemble/model.json
}

case ${1:-all} in
  wheel) wheel ;;
  portable) portable "${2:-}" ;;
  cohort) cohort ;;
  all) bash python/ci.sh wheel && bash python/ci.sh cohort ;;
  *) echo "wheel, portable [MACHINE], cohort, or nothing for wheel and cohort"; exit 2 ;;
esac
