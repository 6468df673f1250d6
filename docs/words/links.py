#!/usr/bin/env python3
"""Checks that every link and every command shown in the pages holds.

    python3 docs/words/links.py BUILD-MODEL
    python3 docs/words/links.py PAGE.md         what this page names alone

A link to a file or to a heading must lead there. A command `build-model VERB --option` must be one that the program knows, in pages and in recipes of
containers. A command of cargo must name packages, tests, examples and benches that there are, and a file of the repository in backticks must be there.
"""
import os
import pathlib
import re
import shlex
import subprocess
import sys
import tomllib

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


# What the machine that builds leaves beside the sources.
NOT_SOURCES = {"target", ".git", "node_modules", "__pycache__"}


def sources():
    """Every file of the repository by its path from the root."""
    found = set()
    for folder, folders, names in os.walk(ROOT):
        folders[:] = [f for f in folders if f not in NOT_SOURCES]
        found |= {(pathlib.Path(folder) / name).relative_to(ROOT).as_posix() for name in [*folders, *names]}
    return found


def targets(files):
    """What cargo may be asked for: packages, and targets by kind."""
    found = {"-p": set(), "--test": set(), "--example": set(), "--bench": set()}
    for file in files:
        if file.split("/")[-1] == "Cargo.toml":
            manifest = tomllib.loads((ROOT / file).read_text())
            found["-p"] |= {manifest["package"]["name"]} if "package" in manifest else set()
            for kind in ("test", "example", "bench"):
                found[f"--{kind}"] |= {target["name"] for target in manifest.get(kind, [])}
        for kind, folder in (("--test", "tests"), ("--example", "examples"), ("--bench", "benches")):
            here = re.fullmatch(rf"(?:[\w-]+/)?{folder}/([\w-]+)(?:\.rs|/main\.rs)", file)
            found[kind] |= {here.group(1)} if here else set()
        # a folder of tests whose main.rs is its program has no other
        main = re.fullmatch(r"((?:[\w-]+/)?)tests/main\.rs", file)
        found["--test"] |= {"main"} if main else set()
    found["--package"] = found["-p"]
    return found


def asked_of_cargo(line, known):
    """What a command of cargo names and is not there."""
    words = shlex.split(line.split("#")[0], posix=True)
    for option, name in zip(words, words[1:]):
        if option == "--":
            return
        if option in known and not re.search(r"[A-Z]", name) and name not in known[option]:
            yield f"{line}: nothing is called {name} ({option})"


def code(page):
    """Commands in blocks, and whatever stands in backticks."""
    text = page.read_text()
    for block in re.findall(r"```\w*\n(.*?)```", text, flags=re.S):
        yield from (line.strip() for line in block.splitlines())
    yield from re.findall(r"`([^`\n]+)`", re.sub(r"```.*?```", "", text, flags=re.S))


def named(page, files, known):
    """Commands of cargo and files in backticks that are not there."""
    folders = {f.split("/")[0] for f in files if "/" in f}
    basenames = {f.split("/")[-1] for f in files}
    for said in code(page):
        if said.startswith(("cargo ", "-p ")):
            yield from (f"{page.name}: {wrong}" for wrong in asked_of_cargo(said, known))
        # a file of ours begins with a folder of ours, or is a source without a folder
        path = said.rstrip("/")
        if re.fullmatch(r"[\w.-]+(/[\w.-]+)+", path) and path.split("/")[0] in folders:
            beside = (page.parent / path).exists()
            if path not in files and not beside:
                yield f"{page.name}: no file {said}"
        elif re.fullmatch(r"[\w-]+\.(rs|py)", said) and said not in basenames:
            yield f"{page.name}: no file {said}"


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
    files = sources()
    if len(sys.argv) > 1 and sys.argv[1].endswith(".md"):
        faults = list(named(pathlib.Path(sys.argv[1]), files, targets(files)))
        print("\n".join(faults))
        sys.exit(1 if faults else 0)
    faults = [f for page in pages() for f in links(page)]
    known_to_cargo = targets(files)
    faults += [f for page in pages() for f in named(page, files, known_to_cargo)]
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
