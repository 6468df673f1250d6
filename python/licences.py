"""Holds the licences and the sources of all crates to deny.toml, where cargo deny is not at hand.

    python3 python/licences.py

Ends with status 1 and a line for each crate that deny.toml does not allow. Crates of two versions are told, and are no fault.
Python before 3.11 has no reader of TOML: then nothing is checked, and a line says so.
"""

from __future__ import annotations

import json
import pathlib
import re
import subprocess
import sys
from typing import Any

ROOT = pathlib.Path(__file__).resolve().parent.parent


def allowed(expression: str, licences: set[str]) -> bool:
    """Whether an SPDX expression can be met by the licences; `/` is OR, as crates once wrote."""
    words = re.findall(r"[()]|[^\s()]+", expression.replace("/", " OR "))
    place = 0

    def one() -> bool:
        nonlocal place
        word = words[place]
        place += 1
        if word == "(":
            inside = either()
            place += 1
            return inside
        if words[place : place + 1] == ["WITH"]:
            word = f"{word} WITH {words[place + 1]}"
            place += 2
        return word in licences

    def both() -> bool:
        nonlocal place
        found = one()
        while words[place : place + 1] == ["AND"]:
            place += 1
            found = one() and found
        return found

    def either() -> bool:
        nonlocal place
        found = both()
        while words[place : place + 1] == ["OR"]:
            place += 1
            found = both() or found
        return found

    return either()


def faults(packages: list[dict[str, Any]], licences: set[str], registries: set[str]) -> list[str]:
    found = []
    for crate in packages:
        name = f"{crate['name']} {crate['version']}"
        if not crate["license"]:
            found.append(f"{name}: no licence in its manifest")
        elif not allowed(crate["license"], licences):
            found.append(f"{name}: {crate['license']} is not allowed")
        source = crate["source"]
        if source is not None and source.removeprefix("registry+") not in registries:
            found.append(f"{name}: comes from {source}")
    return found


def main() -> None:
    try:
        import tomllib
    except ImportError:
        print("this Python has no tomllib: licences are not checked")
        return
    rules = tomllib.loads((ROOT / "deny.toml").read_text(encoding="utf-8"))
    words = ["cargo", "metadata", "--format-version", "1", "--locked", "--all-features", "--manifest-path", str(ROOT / "Cargo.toml")]
    packages = json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)["packages"]
    found = faults(packages, set(rules["licenses"]["allow"]), set(rules["sources"]["allow-registry"]))
    versions: dict[str, list[str]] = {}
    for crate in packages:
        versions.setdefault(crate["name"], []).append(crate["version"])
    twice = sorted(name for name, own in versions.items() if len(own) > 1)
    print(f"{len(packages)} crates, {len(found)} not allowed; of more than one version: {', '.join(twice) or 'none'}")
    for fault in found:
        print(f"fault: {fault}", file=sys.stderr)
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
