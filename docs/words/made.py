#!/usr/bin/env python3
"""Says which pages have figures that an older program made.

    python3 docs/words/made.py --check                 names pages whose crates or makers changed since; ends with 0: figures may still hold.
                                                       Ends with 1 where a page that a program writes whole (`whole`) was changed by hand,
                                                       or a number in a table of another page
    python3 docs/words/made.py --made PAGE...          the page was made anew: keeps the digests of its crates as they are now
    python3 docs/words/made.py --made PAGE... --at C   the same as they were at the commit C
    python3 docs/words/made.py --typed PAGE...         numbers in its tables were typed on purpose, and the commit says where from: keeps them

docs/made.toml has a page's crates and their digests. A digest is of the code and data of a crate, without what makes no figure: blank lines,
lines that are comments, and the crate's own tests. Where it is not plain that a line is one of these, it counts: a page is rather called stale.
Asked for is whether a figure was made by today's code, not whether it would be another: only making it anew tells that.
"""
import argparse
import hashlib
import io
import pathlib
import re
import subprocess
import sys
import tarfile
import tomllib

HERE = pathlib.Path(__file__).resolve().parent.parent.parent
DIGITS = 16  # hexadecimal digits of a digest that are kept


def of_tests(path, text):
    """Where the modules lie that a source declares for its crate's tests alone: without the ending of a file."""
    place = path.removesuffix(".rs")
    if place.split("/")[-1] in ("lib", "main", "mod"):
        place = place.rpartition("/")[0]
    return {f"{place}/{name}" for name in re.findall(r"^#\[cfg\(test\)\]\n(?:pub(?:\([a-z]+\))? )?mod (\w+);$", text, re.MULTILINE)}


def indent(line):
    """How many blanks a line begins with."""
    return len(line) - len(line.lstrip())


def behind(lines, begin):
    """The place behind an item that begins there, as rustfmt leaves it: its last line closes it, and begins as far in as its first."""
    if lines[begin].rstrip().endswith((";", ",", "}")):
        return begin + 1
    own = indent(lines[begin])
    for k in range(begin + 1, len(lines)):
        line = lines[k].strip()
        if not line or indent(lines[k]) > own:
            continue
        if indent(lines[k]) == own and line[0] in "})]" and not line.endswith("{"):
            return k + 1
        # a head of several lines goes on so; all else is of another item
        if not (indent(lines[k]) == own and (line[0] in ")]{" or line.startswith("where"))):
            return k
    return len(lines)


def without_tests(lines):
    """The lines of a Rust source without the items that are for its tests alone."""
    kept, k = [], 0
    while k < len(lines):
        if lines[k].strip() != "#[cfg(test)]":
            kept.append(lines[k])
            k += 1
            continue
        k += 1
        while k < len(lines) and lines[k].strip().startswith(("#[", "//")):
            k += 1
        k = behind(lines, k) if k < len(lines) else k
    return kept


def code(path, text):
    """The lines of a file that can change a figure."""
    lines, remark = text.splitlines(), "//"
    if path.endswith(".rs"):
        lines = without_tests(lines)
    elif '"""' not in text and "'''" not in text:
        # in a string of several lines it would be data
        remark = "#"
    return [line.strip() for line in lines if line.strip() and not line.strip().startswith(remark)]


def of_files(files):
    """The digest of files by path."""
    whole, texts = hashlib.sha256(), {path: files[path].decode("utf-8", "replace") for path in sorted(files)}
    tests = {place for path, text in texts.items() if path.endswith(".rs") for place in of_tests(path, text)}
    for path, text in texts.items():
        if not any(path == f"{place}.rs" or path.startswith(f"{place}/") for place in tests):
            whole.update("\n".join([path, *code(path, text)]).encode())
    return whole.hexdigest()[:DIGITS]


def now(root, crate):
    """A crate's files as they are."""
    found = {}
    for part in ("src", "data"):
        for path in sorted((root / crate / part).rglob("*")):
            if path.suffix in (".rs", ".toml"):
                found[path.relative_to(root).as_posix()] = path.read_bytes()
    return found


def makers(root, page):
    """The files that make a page of what the crates give: programs and tests, by path or pattern."""
    found = {}
    for pattern in page.get("makers", []):
        paths = [p for p in sorted(root.glob(pattern)) if p.is_file()]
        if not paths:
            sys.exit(f"docs/made.toml: {page['name']}: no file is {pattern}")
        found |= {p.relative_to(root).as_posix(): p.read_bytes() for p in paths}
    return found


def as_made(root, page):
    """The digest of a page itself."""
    return hashlib.sha256((root / page["name"]).read_bytes()).hexdigest()[:DIGITS]


def figures(root, page):
    """The digest of the numbers in a page's tables, in order."""
    rows = [line for line in (root / page["name"]).read_text().splitlines() if line.lstrip().startswith("|")]
    numbers = [number for row in rows for number in re.findall(r"\d+(?:\.\d+)?(?:e-?\d+)?", row)]
    return hashlib.sha256(" ".join(numbers).encode()).hexdigest()[:DIGITS]


def own(root, page):
    """What is kept of a page itself: by which name, and its digest."""
    return ("page", as_made(root, page)) if page.get("whole") else ("figures", figures(root, page))


def at(root, crate, commit):
    """A crate's files at a commit; none where it was not there."""
    run = subprocess.run(["git", "archive", commit, crate], cwd=root, capture_output=True, check=False)
    if run.returncode != 0:
        return {}
    found = {}
    with tarfile.open(fileobj=io.BytesIO(run.stdout)) as archive:
        for entry in archive:
            inner = entry.name.split("/")
            if entry.isfile() and inner[1] in ("src", "data") and entry.name.endswith((".rs", ".toml")):
                found[entry.name] = archive.extractfile(entry).read()
    return found


def read(root):
    """The table: pages in order."""
    with open(root / "docs/made.toml", "rb") as file:
        return tomllib.load(file)["page"]


def check(root):
    """Tells of every page; gives how many are stale, and which were changed by hand."""
    stale, typed = 0, []
    for page in read(root):
        changed = [c for c in page["crates"] if page["digests"].get(c) != of_files(now(root, c))]
        missing = [c for c in page["crates"] if not now(root, c)]
        if missing or not (root / page["name"]).exists():
            sys.exit(f"docs/made.toml: {page['name']} or a crate of it is not there: {', '.join(missing)}")
        if page.get("makers") and page["digests"].get("makers") != of_files(makers(root, page)):
            changed.append("what makes it")
        stale += bool(changed)
        name, digest = own(root, page)
        # a page that was never made has no digest yet
        if page["digests"] and page["digests"].get(name) != digest:
            typed.append(page["name"])
        state = f"stale: {', '.join(changed)} changed since; {page['by']}" if changed else "as its crates are"
        print(f"{page['name']}: {state}")
    return stale, typed


def made(root, names, commit):
    """Keeps the digests of pages that were made anew."""
    file = root / "docs/made.toml"
    text = file.read_text()
    known = {page["name"]: page for page in read(root)}
    for name in names:
        if name not in known:
            sys.exit(f"{name}: not in docs/made.toml, which has {', '.join(known)}")
        crates = known[name]["crates"]
        files = {c: at(root, c, commit) if commit else now(root, c) for c in crates}
        empty = [c for c in crates if not files[c]]
        if empty:
            sys.exit(f"{name}: no sources of {', '.join(empty)}" + (f" at {commit}: is it a commit?" if commit else ""))
        if known[name].get("makers"):
            files["makers"] = makers(root, known[name])
        digests = {c: of_files(files[c]) for c in files}
        digests |= dict([own(root, known[name])])
        text = with_digests(text, name, digests)
    file.write_text(text)


def with_digests(text, name, digests):
    """The table's text with a page's digests."""
    line = ", ".join(f'{c} = "{digest}"' for c, digest in digests.items())
    begin = text.index(f'name = "{name}"')
    return text[:begin] + re.sub(r"digests = \{.*\}", f"digests = {{ {line} }}", text[begin:], count=1)


def typed_on_purpose(root, names):
    """Keeps the numbers of pages that no program writes whole; what made the rest stays as it is known."""
    file = root / "docs/made.toml"
    text = file.read_text()
    known = {page["name"]: page for page in read(root)}
    for name in names:
        if name not in known or known[name].get("whole"):
            sys.exit(f"{name}: no page of docs/made.toml whose numbers are typed")
        text = with_digests(text, name, known[name]["digests"] | dict([own(root, known[name])]))
    file.write_text(text)


def main():
    """The command line."""
    asked = argparse.ArgumentParser()
    asked.add_argument("--check", action="store_true")
    asked.add_argument("--made", nargs="+", metavar="PAGE")
    asked.add_argument("--at", metavar="COMMIT")
    asked.add_argument("--typed", nargs="+", metavar="PAGE")
    asked.add_argument("--root", type=pathlib.Path, default=HERE)
    given = asked.parse_args()
    if given.made:
        made(given.root, given.made, given.at)
    if given.typed:
        typed_on_purpose(given.root, given.typed)
    stale, typed = check(given.root)
    print(f"{stale} of {len(read(given.root))} pages have figures of an older program")
    if typed:
        sys.exit(
            f"changed by hand: {', '.join(typed)}. Make the page anew by what docs/made.toml names, then --made; "
            "numbers typed on purpose, with their source in the commit, are kept by --typed"
        )


if __name__ == "__main__":
    main()
