"""Measures the live view, and asserts no speed: the page's load with and without it, a trial in the browser against the same in the library, a frame of a drag.

usage: speed.py REPORT.html [BUILD_MODEL MODEL TRIALS.csv]
The last three are the program, the knee of the report (its folder or model.json) and a file of trials; without them nothing is compared. Best on an idle
machine: the load average is printed with the figures. Times by the clock are medians [ms]. Ends with status 77 where chromium cannot be started.
"""

import csv
import os
import pathlib
import re
import resource
import statistics
import subprocess
import sys
import tempfile

import live
from report import Browser, NoBrowser

LOADS = 7  # times that each page is loaded, in turns
COPIES = 8  # times that a file of trials is repeated: what is more than one copy takes is the trials' own
# scripts and section of the live view
LIVE = [re.compile(r'<section id="live".*?</section>', re.S), re.compile(r'<script type="[^"]*" id="live-(?:module|knee|worker)">.*?</script>', re.S),
        re.compile(r'<script>// [^\n]*\n"use strict";\n(?:const live\w+ = )?\(\(\) => \{\n  const section = document.getElementById\("live"\);.*?</script>', re.S)]
LOADED = "const done = arguments[0], look = () => { const end = performance.getEntriesByType('navigation')[0].loadEventEnd; if (end) done(end); else setTimeout(look, 50); }; look()"
# a worker of its own, with the knee open and the code warm
OPEN = """const [first, done] = arguments, bytes = (id) => Uint8Array.from(atob(document.getElementById(id).textContent), (c) => c.charCodeAt(0));
  const worker = new Worker(URL.createObjectURL(new Blob([document.getElementById('live-worker').textContent], { type: 'text/javascript' })));
  const ask = (message) => new Promise((given) => { worker.onmessage = ({ data }) => given(data); worker.postMessage(message); });
  window.trials = async (loads) => { const out = []; for (const [flexion_deg, load] of loads) out.push((await ask({ id: 1, request: { trial: { flexion_deg, load } } })).ms); return out; };
  ask({ id: 0, open: { module: bytes('live-module'), knee: bytes('live-knee') } }).then(() => window.trials(first)).then(() => done())"""
# one trial after the other; gives the time of each [ms]
ASK = "const [loads, done] = arguments; window.trials(loads).then(done)"


def told(words, times):
    print(f"{words}: median {statistics.median(times):.1f}, least {min(times):.1f}, most {max(times):.1f} ms of {len(times)}")
    return statistics.median(times)


def loads(browser, page):
    """The load of the page with and without the live view, in turns, so that both meet the same machine."""
    text = page.read_text()
    for part in LIVE:
        text = part.sub("", text)
    with tempfile.TemporaryDirectory() as folder:
        without = pathlib.Path(folder) / "without.html"
        without.write_text(text)
        times = {page: [], without: []}
        for _ in range(LOADS):
            for one, of in times.items():
                browser.ask("/url", {"url": "about:blank"})
                browser.ask("/url", {"url": one.as_uri()})
                of.append(browser.ask("/execute/async", {"script": LOADED, "args": []}))
        a, b = told("load with the live view", times[page]), told("load without", times[without])
    print(f"the live view adds {a - b:.0f} ms, {100 * (a / b - 1):.0f} %")


def asked(file):
    """Loads of a file of trials, in the order of the page."""
    with file.open() as rows:
        return [[float(r["fe_deg"] or r["nominal_flexion_deg"]), [float(r[f"load_{c}"] or 0) for c in ["vv_nm", "ie_nm", "ml_n", "ap_n", "si_n"]]] for r in csv.DictReader(rows)]


def native(program, model, file):
    """Processor time of a trial in the library [ms]: what further copies of a file take."""
    head, *rows = file.read_text().splitlines()
    spent = []
    with tempfile.TemporaryDirectory() as folder:
        for copies in [1, COPIES]:
            trials = pathlib.Path(folder) / f"{copies}.csv"
            trials.write_text("\n".join([head, *(f"c{n}{row}" for n in range(copies) for row in rows)]) + "\n")
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            command = [program, "simulate", model, "--trials", trials, "--samples", "0", "--out", pathlib.Path(folder) / "out.csv"]
            subprocess.run(command, check=True, capture_output=True, env={**os.environ, "RAYON_NUM_THREADS": "1"})
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return 1000 * (spent[1] - spent[0]) / ((COPIES - 1) * len(rows))


def main():
    page = pathlib.Path(sys.argv[1]).resolve()
    try:
        # without a graphics card desktop Chromium lays a page together by the processor, too
        browser = Browser(["--disable-gpu-compositing"])
    except NoBrowser as reason:
        print(f"chromium cannot be started: {reason}")
        sys.exit(77)
    print("load of the machine:", pathlib.Path("/proc/loadavg").read_text().split()[0])
    try:
        loads(browser, page)
        check = live.Live(browser, pathlib.Path(tempfile.gettempdir()))
        check.cdp("Page.addScriptToEvaluateOnNewDocument", live.CATCH)
        browser.ask("/url", {"url": page.as_uri()})
        browser.run("document.getElementById('live').scrollIntoView()")
        check.settled(240)
        print("the knee opened after", browser.run("return document.getElementById('live').dataset.opened"), "ms")
        if len(sys.argv) > 4:
            program, model, file = sys.argv[2], sys.argv[3], pathlib.Path(sys.argv[4])
            trials = asked(file)
            check.wait("return Number(document.getElementById('live').dataset.samples) > 8", seconds=240)
            browser.ask("/execute/async", {"script": OPEN, "args": [trials[:5]]})
            before = browser.spent()["solver"]
            times = browser.ask("/execute/async", {"script": ASK, "args": [trials * COPIES]})
            own = 1000 * (browser.spent()["solver"] - before) / len(times)
            told("a trial in the browser by the clock", times)
            library = native(program, model, file)
            print(f"processor time of a trial: {own:.1f} ms in the browser, {library:.1f} ms in the library, {own / library:.1f} times")
        check.wait("return document.querySelector('#live figure').dataset.ready === 'yes'")
        check.frames()
        for fault in check.faults:
            print("fault:", fault)
    finally:
        browser.close()
    print("load of the machine:", pathlib.Path("/proc/loadavg").read_text().split()[0])


if __name__ == "__main__":
    main()
