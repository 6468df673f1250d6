#!/usr/bin/env python3
"""Measures the pages: words a sentence, passive voice, words that are neither plain nor in the glossary.

    python3 docs/words/words.py            the table, and every fault; exit status 1 where there is one
    python3 docs/words/words.py --long     also every sentence over the limit of its page
    python3 docs/words/words.py PAGE...    these pages alone

A sentence ends at . ! ? : or ; before a space. A cell of a table and an item of a list end one too. Code is left out.
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
HERE = ROOT / "docs/words"
P90 = 20  # words a sentence, nine of ten
LONGEST = 30  # words between . ! and ?
# Pages that are written by a program or hold a history: they are measured, and held to nothing.
FREE = {"docs/accuracy.md", "docs/results.md", "docs/discrepancy-rounds.md", "docs/paper.md", "docs/convergence.md"}
# Phrases that say nothing, or say it in a private way.
REFUSED = ["right when", "nothing missing", "as you like", "as one likes", "is told", "are told", "and their kin"]
IRREGULAR = "built|done|drawn|found|given|held|known|laid|left|lost|made|met|put|read|run|said|seen|sent|set|shown|taken|told|written|cut|kept|chosen|worn|driven"
PASSIVE = re.compile(rf"\b(?:is|are|was|were|be|been|being)\s+(?:\w+ly\s+|not\s+|also\s+|then\s+)?(?:\w+ed|{IRREGULAR})\b", re.I)


def pages():
    found = [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    found += sorted(p for p in (ROOT / "docs").rglob("*.md") if not {"decisions", "words"} & set(p.relative_to(ROOT).parts))
    return [p for p in found if p.exists()]


def prose(text):
    """Blocks of prose: paragraphs, items and cells, without code, links' targets and markup."""
    text = re.sub(r"```.*?```", "\n\n", text, flags=re.S)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.S)
    text = re.sub(r"\$\$.*?\$\$", " ", text, flags=re.S)
    text = re.sub(r"\$[^$\n]+\$", "N", text)
    text = re.sub(r"!\[([^\]]*)\]\([^)]*\)", r"\n\n\1\n\n", text)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"\\\[.*?\\\]", " ", text, flags=re.S)
    text = re.sub(r"`[^`\n]*`", "CODE", text)
    block = []
    for line in text.splitlines() + [""]:
        line = line.strip()
        item = re.match(r"(?:[-*+]|\d+\.)\s+(.*)", line)
        if line.startswith("|"):
            cells = [c.strip() for c in line.strip("|").split("|")]
            if block:
                yield " ".join(block)
                block = []
            if not all(re.fullmatch(r":?-+:?", c) for c in cells):
                yield from (c for c in cells if len(c.split()) > 3)
        elif item or not line or line.startswith(("#", ">", "<")):
            if block:
                yield " ".join(block)
            block = [item.group(1)] if item else []
            if line.startswith(">"):
                block = [line.lstrip("> ")]
        else:
            block.append(line)


def words(text):
    return re.findall(r"[^\W_][\w'’.,/%°+-]*", text)


def sentences(text, ends=".!?:;"):
    for block in prose(text):
        clean = re.sub(r"[*_]{1,2}(?=\S)|(?<=\S)[*_]{1,2}", "", block)
        for part in re.split(rf"(?<=[{re.escape(ends)}])[)\"”]*\s+(?=\S)", clean):
            if len(words(part)) > 1:
                yield part.strip()


def glossary():
    text = (ROOT / "docs/glossary.md").read_text()
    terms = re.findall(r"^\|\s*([^|]+?)\s*\|", text, flags=re.M)
    return {part.lower() for t in terms for w in re.findall(r"[A-Za-z][\w-]+", t) for part in {w, *w.split("-")}}


def stems(word):
    yield word
    for end, put in [("s", ""), ("es", ""), ("ies", "y"), ("ed", ""), ("ed", "e"), ("d", ""), ("ing", ""), ("ing", "e"), ("ly", ""), ("er", ""), ("er", "e"), ("est", ""), ("'s", ""), ("’s", "")]:
        if word.endswith(end) and len(word) - len(end) > 1:
            stem = word[: -len(end)] + put
            yield stem
            if len(stem) > 2 and stem[-1] == stem[-2]:
                yield stem[:-1]


def unknown(text, known):
    found = set()
    for block in prose(text):
        for word in re.findall(r"(?<![\w/.@-])[A-Za-z][a-z’'-]{2,}(?![\w@])", block):
            for part in word.lower().strip("'’-").split("-"):
                if len(part) > 2 and not any(s in known for s in stems(part)):
                    found.add(part)
    return found


def quantile(values, q):
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(q * len(ordered)))] if ordered else 0


def main():
    chosen = [pathlib.Path(a).resolve() for a in sys.argv[1:] if not a.startswith("-")] or pages()
    plain = set((HERE / "plain.txt").read_text().split())
    known = plain | glossary()
    faults, everything, passives, all_unknown = [], [], 0, set()
    print(f"{'page':36} sentences  mean  p90  longest  passive  unknown")
    for page in chosen:
        name, text = str(page.relative_to(ROOT)), page.read_text()
        counts = [len(words(s)) for s in sentences(text)]
        full = [s for s in sentences(text, ".!?")]
        longest = max([len(words(s)) for s in full], default=0)
        passive = sum(bool(PASSIVE.search(s)) for s in full)
        new = unknown(text, known)
        p90 = quantile(counts, 0.9)
        print(f"{name:36} {len(counts):9} {sum(counts) / max(1, len(counts)):5.1f} {p90:4} {longest:8} {passive / max(1, len(full)):8.0%} {len(new):8}")
        if "--long" in sys.argv:
            for s in full:
                if len(words(s)) > LONGEST:
                    print(f"    {len(words(s))}: {s[:160]}")
        if name in FREE:
            continue
        everything += counts
        passives += passive
        all_unknown |= new
        if p90 > P90:
            faults.append(f"{name}: nine of ten sentences have up to {p90} words; expected {P90} at most")
        for s in full:
            if len(words(s)) > LONGEST:
                faults.append(f"{name}: {len(words(s))} words, expected {LONGEST} at most: {s[:90]}...")
        if new:
            faults.append(f"{name}: in neither the glossary nor docs/words/plain.txt: {', '.join(sorted(new))}")
        for phrase in REFUSED:
            if re.search(rf"\b{phrase}\b", " ".join(prose(text)).lower()):
                faults.append(f"{name}: \"{phrase}\" says nothing to a reader; write what is meant")
    print(f"all that is held: {len(everything)} sentences, p90 {quantile(everything, 0.9)} words, passive {passives / max(1, len(everything)):.0%}, {len(all_unknown)} unknown words")
    for fault in faults:
        print("fault:", fault)
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    main()
