"""Writes THIRD-PARTY-NOTICES.txt: the licence texts of every crate that the module is made of.

    python3 python/third_party.py [FILE]

Run before the wheel is packed. Cargo says which crates there are and where their sources lie; the texts are those of the sources. One
text that several crates share stands once.
"""

from __future__ import annotations

import json
import pathlib
import re
import subprocess
import sys
from typing import Any

HERE = pathlib.Path(__file__).resolve().parent
PACKAGE = "genu-python"
TEXTS = re.compile(r"^(licen[cs]e|copying|notice|unlicense|copyright)", re.IGNORECASE)
# a text of more is no licence [bytes]
LARGEST = 200_000


def metadata() -> dict[str, Any]:
    words = ["cargo", "metadata", "--format-version", "1", "--locked", "--manifest-path", str(HERE / "Cargo.toml")]
    return json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)


def linked(told: dict[str, Any]) -> set[str]:
    """Ids of the crates that PACKAGE links, on any platform: what builds or tests them is left out."""
    nodes = {node["id"]: node for node in told["resolve"]["nodes"]}
    open_ids = [p["id"] for p in told["packages"] if p["name"] == PACKAGE]
    found: set[str] = set()
    while open_ids:
        one = open_ids.pop()
        if one not in found:
            found.add(one)
            open_ids += [d["pkg"] for d in nodes[one]["deps"] if any(k["kind"] is None for k in d["dep_kinds"])]
    return found


def texts(folder: pathlib.Path) -> list[str]:
    """The licence texts beside a manifest, or in a folder of licences."""
    places = [folder, *(p for p in folder.iterdir() if p.is_dir() and p.name.lower() in ("licenses", "licences", "license"))]
    files = sorted(p for place in places for p in place.iterdir() if p.is_file() and (place is not folder or TEXTS.match(p.name)))
    small = [p for p in files if p.stat().st_size <= LARGEST and p.suffix not in (".rs", ".toml")]
    return [p.read_text(encoding="utf-8", errors="replace").replace("\r\n", "\n").strip() for p in small]


def notices(told: dict[str, Any]) -> tuple[str, int]:
    """The page, and how many crates have no text of their own."""
    ours = linked(told)
    crates = sorted((p for p in told["packages"] if p["id"] in ours and p["source"]), key=lambda p: (p["name"], p["version"]))
    users: dict[str, list[str]] = {}
    lines = ["The module holds these crates, each under the terms that stand below.", ""]
    without = 0
    for crate in crates:
        name = f"{crate['name']} {crate['version']}"
        found = texts(pathlib.Path(crate["manifest_path"]).parent)
        without += not found
        by = ", ".join(re.sub(r" *<.*?>", "", a) for a in crate["authors"])
        own = "" if found else f"; its package has no text of its own{'; by ' + by if by else ''}"
        lines.append(f"{name}: {crate['license'] or 'see its text'}{own}; {crate['repository'] or 'no address'}")
        for text in found:
            users.setdefault(text, []).append(name)
    for text, names in users.items():
        lines += ["", "=" * 80, ", ".join(names), "=" * 80, "", text]
    return "\n".join(lines) + "\n", without


def main() -> None:
    place = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "THIRD-PARTY-NOTICES.txt"
    told = metadata()
    page, without = notices(told)
    place.write_text(page, encoding="utf-8")
    print(f"{place}: {len(page) // 1024} KiB, {without} crates without a text of their own")


if __name__ == "__main__":
    main()
