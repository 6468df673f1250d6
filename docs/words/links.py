#!/usr/bin/env python3
"""Checks that every link and every command shown in the pages holds.

    python3 docs/words/links.py BUILD-MODEL

A link to a file or to a heading must lead there. A command `build-model VERB --option` must be one that the program knows, in pages and in recipes of
containers.
"""
import pathlib
import re
import shlex
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from words import ROOT, pages  # noqa: E402


def anchor(heading):
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
    return re.sub(r"[^\w\- ]", "", text).replace(" ", "-")


def headings(page):
    text = re.sub(r"```.*?```", "", page.read_text(), flags=re.S)
    return {anchor(h) for h in re.findall(r"^#+\s+(.*)$", text, flags=re.M)}


def links(page):
    text = re.sub(r"```.*?```", "", page.read_text(), flags=re.S)
    text = re.sub(r"`[^`\n]*`", "", text)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, part = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        if not file.exists():
            yield f"{page.relative_to(ROOT)}: no file {target}"
        elif part and file.suffix == ".md" and part not in headings(file):
            yield f"{page.relative_to(ROOT)}: no heading {target}"


RECIPES = [ROOT / name for name in ("Dockerfile", "genu.def")]


def commands(page):
    text = page.read_text()
    if page in RECIPES:
        for line in text.splitlines():
            said = re.search(r"(build-model .*)$", line)
            if said and not line.lstrip().startswith("exec"):
                yield said.group(1).split("&&")[0].strip()
        return
    shown = [line for block in re.findall(r"```(?:sh|bash)?\n(.*?)```", text, flags=re.S) for line in block.splitlines()]
    shown += re.findall(r"`(build-model [^`\n]+)`", text)
    for line in shown:
        line = line.split("#")[0].strip()
        line = re.sub(r"^cargo run --release -- ", "build-model ", line)
        if line.startswith("build-model "):
            yield line


def known(program):
    """Options of every verb, by the program's own help."""
    found = {}
    listed = subprocess.run([program, "--help"], capture_output=True, text=True, check=True).stdout
    verbs = re.findall(r"^  ([a-z][a-z-]+)  ", listed.split("Commands:")[1].split("Arguments:")[0], flags=re.M)
    for verb in [[], *[[v] for v in verbs], ["blind", "make"], ["blind", "answer"], ["blind", "score"]]:
        if verb == ["help"]:
            continue
        text = subprocess.run([program, *verb, "--help"], capture_output=True, text=True, check=True).stdout
        found[" ".join(verb)] = set(re.findall(r"(--[a-z][a-z-]*)", text))
    return found


def fault(line, verbs):
    try:
        parts = shlex.split(line.replace("...", ""))[1:]
    except ValueError:
        return "cannot be read as a command"
    name = ""
    if parts and parts[0] in verbs:
        name = parts[0]
        if f"{name} {parts[1] if len(parts) > 1 else ''}" in verbs:
            name = f"{name} {parts[1]}"
    elif parts and re.fullmatch(r"[a-z]+(-[a-z]+)*", parts[0]) and len(parts) > 1 and not parts[1].startswith("-"):
        return f"no command {parts[0]}"
    for part in parts:
        option = part.strip("[]").split("=")[0]
        if option.startswith("--") and option not in verbs[name]:
            return f"{name or 'build'} has no option {option}"
    return None


def main():
    faults = [f for page in pages() for f in links(page)]
    count = 0
    if len(sys.argv) > 1:
        verbs = known(sys.argv[1])
        for page in [*pages(), *RECIPES]:
            for line in commands(page):
                count += 1
                wrong = fault(line, verbs)
                if wrong:
                    faults.append(f"{page.relative_to(ROOT)}: {line}: {wrong}")
    print(f"{len(pages())} pages, {count} commands, {len(faults)} faults")
    for f in faults:
        print("fault:", f)
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    main()
