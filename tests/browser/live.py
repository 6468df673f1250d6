"""Pulls at the knee of a report in headless Chromium without network, and holds what the page shows against what the library answers.

usage: live.py REPORT.html EXPECTED.json SCREENSHOTS_FOLDER
EXPECTED.json: {"about": ..., "lachman": reply, "cut": reply of the same with the ACL cut}. Ends as report.py does: 0, 1 with a line a fault, 77.
"""

import base64
import json
import pathlib
import sys
import time

from report import Browser, Check, NoBrowser

SHOWN = {"force": 0.051, "pose": 0.0051}  # half the last digit that the tables show, and rounding [N; deg, mm]
BACKSPACE, TAB, ENTER, RIGHT = "\ue003", "\ue004", "\ue007", "\ue014"


class Live(Check):
    """The section `live` of a page."""

    def settled(self, seconds=60):
        """True once the answer to the last change stands there."""
        time.sleep(0.05)
        return self.wait("const s=document.getElementById('live'); return s.dataset.ready === 'yes' && !s.dataset.busy", seconds=seconds)

    def cell(self, table, row, column):
        text = self.browser.run("return document.querySelector(`#${arguments[0]} [data-row='${arguments[1]}']`).cells[arguments[2]].textContent", table, row, column)
        return float(text) if text else None

    def press_button(self, selector):
        self.browser.run("document.querySelector(arguments[0]).click()", selector)
        self.expect(self.settled(), f"{selector}: no answer after 60 s")

    def says(self, told, about, words):
        """The tables hold the numbers of an answer."""
        for n, bundle in enumerate(about["bundles"]):
            shown = self.cell("live-ligaments", bundle["name"], 1)
            self.expect(abs(shown - told["forces_n"][n]) <= SHOWN["force"], f"{words}: {bundle['name']} {shown}, expected {told['forces_n'][n]}")
        for key in ["vv_deg", "ie_deg", "ml_mm", "ap_mm", "si_mm"]:
            shown = self.cell("live-pose", key, 1)
            self.expect(abs(shown - told["pose"][key]) <= SHOWN["pose"], f"{words}: {key} {shown}, expected {told['pose'][key]}")
        outputs = dict(told["outputs"])
        for side in ["medial", "lateral"]:
            shown = self.cell("live-contact", f"contact_{side}_force_n", 1)
            self.expect(abs(shown - outputs[f"contact_{side}_force_n"]) <= 0.51, f"{words}: contact {side} {shown}")

    def words(self):
        return self.browser.run("return document.querySelector('.live-words').textContent")

    def state(self):
        return self.browser.run("return document.getElementById('live-link').getAttribute('href')")

    def first_minute(self, expected):
        """Lachman, cut the ACL, read the difference; undo and reset."""
        about = expected["about"]
        self.press_button("[data-preset='Lachman']")
        self.says(expected["lachman"], about, "Lachman")
        self.press_button("[data-cut='ACL']")
        self.says(expected["cut"], about, "Lachman without ACL")
        more = expected["cut"]["pose"]["ap_mm"] - expected["lachman"]["pose"]["ap_mm"]
        self.expect(f"{more:.1f} mm anterior" in self.words(), f"the difference of {more:.2f} mm is not in: {self.words()}")
        self.expect("Cut: ACL_AM, ACL_PL" in self.words(), f"the cut is not in: {self.words()}")
        self.press_button("[data-act='undo']")
        self.says(expected["lachman"], about, "undone")
        self.press_button("[data-act='reset']")
        self.expect(self.state() == "#live&flexion=30", f"reset leaves {self.state()}")

    def intervals(self, about):
        """Bands come by themselves and enclose the means' side of the table; with changed ligaments there are none."""
        self.press_button("[data-preset='Lachman']")
        most = min(32, about["samples"])
        self.expect(self.wait(f"return Number(document.getElementById('live').dataset.samples) === {most}", seconds=120), "no intervals after 120 s")
        text = self.browser.run("return [...document.querySelectorAll('#live-ligaments tbody tr')].map(r => r.cells[3].textContent)")
        self.expect(all(" to " in t for t in text), f"intervals: {text}")
        ends = [[float(x) for x in t.split(" to ")] for t in text if " to " in t]
        self.expect(all(a <= b for a, b in ends) and any(b - a > 0.1 for a, b in ends), f"intervals: {ends}")
        move = "const r=document.querySelector(`#live-ligaments [data-row='${arguments[0]}'] details input`); r.value=0.03; r.dispatchEvent(new Event('input')); r.dispatchEvent(new Event('change'))"
        before = self.cell("live-ligaments", "ACL_AM", 1)
        self.browser.run(move, "ACL_AM")
        self.expect(self.settled(), "a changed strain: no answer")
        self.expect(self.cell("live-ligaments", "ACL_AM", 1) != before, "a changed strain changes no force")
        self.expect("there are none" in self.browser.run("return document.querySelector('.live-said').textContent"), "intervals beside changed ligaments")
        self.press_button("[data-act='undo']")
        self.expect(self.cell("live-ligaments", "ACL_AM", 1) == before, "undo does not bring the force back")

    def slider(self):
        """A drag on the slider: the last place rules, and the picture moves."""
        drag = "const r=document.getElementById('live-ap'); for (const v of arguments[0]) { r.value=v; r.dispatchEvent(new Event('input')); } r.dispatchEvent(new Event('change'))"
        self.browser.run(drag, [10, 40, 80, 100])
        self.expect(self.settled(), "a drag: no answer")
        a = self.cell("live-pose", "ap_mm", 1)
        self.expect("ap=100" in self.state(), f"the drag ends at {self.state()}")
        self.browser.run(drag, [-100])
        self.expect(self.settled(), "a drag: no answer")
        self.expect(self.cell("live-pose", "ap_mm", 1) < a, "pushed backwards the tibia does not go back")
        # one drag is one step of undo
        self.press_button("[data-act='undo']")
        self.expect(abs(self.cell("live-pose", "ap_mm", 1) - a) < 1e-9, "undo of a drag")

    def decimals(self):
        """A decimal comma is a point; words are refused without harm."""
        typed = "const t=document.querySelectorAll('.live-slider input[type=text]')[arguments[0]]; t.value=arguments[1]; t.dispatchEvent(new Event('change')); return t.value"
        self.browser.run(typed, 2, "2,5")
        self.expect(self.settled() and "ie=2.5" in self.state(), f"2,5 N m becomes {self.state()}")
        self.expect(self.browser.run(typed, 2, "much") == "2.5", "a word in a number's place stays")

    def link(self, page):
        """A link brings the state back, in a new page too."""
        self.press_button("[data-preset='Pivot shift']")
        self.press_button("[data-cut='ACL']")
        href, forces = self.state(), self.cell("live-ligaments", "LCL", 1)
        self.browser.ask("/url", {"url": "about:blank"})
        self.browser.ask("/url", {"url": page.as_uri() + href})
        self.expect(self.settled(), "a link: no answer")
        self.expect(self.state() == href, f"the link {href} gives {self.state()}")
        self.expect(self.cell("live-ligaments", "LCL", 1) == forces, "the link gives other forces")
        self.browser.run("location.hash = '#live&flexion=9999&cut=NOBODY,LCL&strain=ACL_AM:x'")
        self.expect(self.settled(), "a strange link: no answer")
        self.expect(self.state() == "#live&flexion=120&cut=LCL", f"a strange link gives {self.state()}")

    def file(self):
        self.press_button("[data-preset='Lachman']")
        self.browser.run("document.querySelector(\"[data-act='csv']\").click()")
        text = self.browser.run("return document.getElementById('live').dataset.csv")
        rows = {line.split(",")[0]: line.split(",") for line in text.splitlines()}
        self.expect(rows["name"][1:] == ["value", "mean", "lower", "upper", "as_calibrated", "at_rest"], f"{rows['name']}")
        self.expect(abs(float(rows["ap_mm"][1]) - self.cell("live-pose", "ap_mm", 1)) <= SHOWN["pose"], "the file has another pose")
        self.expect(float(rows["load_ap_n"][1]) == 133, "the file has another load")

    def keyboard(self):
        """Without a pointer: to the first test and the slider by Tab, chosen by Enter, moved by an arrow."""
        self.browser.run("document.querySelector('[data-preset]').focus()")
        self.browser.press(TAB)
        self.browser.press(ENTER)
        self.expect(self.settled() and "ap=133" in self.state(), f"Enter on the second test gives {self.state()}")
        self.browser.run("document.getElementById('live-ap').focus()")
        self.browser.press(RIGHT)
        self.expect(self.settled() and "ap=134" in self.state(), f"an arrow on the slider gives {self.state()}")
        unnamed = self.browser.run("return [...document.querySelectorAll('#live input, #live button, #live a, #live summary')].filter(e => !(e.textContent.trim() || e.getAttribute('aria-label') || (e.labels && e.labels.length))).length")
        self.expect(unnamed == 0, f"{unnamed} controls without a name")
        status = self.browser.run("return document.querySelector('#live [role=status]').textContent")
        self.expect("mm" in status, f"a screen reader is told: {status}")

    def frames(self):
        """Tells how long a change takes until the picture is drawn, and how long its trial takes [ms]. Without a graphics card drawing is slow."""
        drag = """const done = arguments[arguments.length - 1], s = document.getElementById('live'), r = document.getElementById('live-ap'), f = s.querySelector('figure'), out = [];
          const idle = () => new Promise(d => { const look = () => (!s.dataset.busy && !f.dataset.busy ? d() : setTimeout(look, 1)); look(); });
          (async () => { for (let n = 0; n < 12; n++) { const t = performance.now(); r.value = 10 * n; r.dispatchEvent(new Event('input')); await idle(); out.push([performance.now() - t, Number(s.dataset.ms)]); } r.dispatchEvent(new Event('change')); return out; })().then(done)"""
        self.browser.ask("/timeouts", {"script": 100000})
        times = self.browser.ask("/execute/async", {"script": drag, "args": []})
        for k, words in enumerate(["frame of a drag", "trial in the worker"]):
            sorted_ = sorted(t[k] for t in times)
            print(f"{words}: median {sorted_[6]:.0f} ms, most {sorted_[11]:.0f} ms of {len(sorted_)}")

    def broken(self):
        """A worker that breaks off in a trial is said, and the next question is answered by a new one. Intervals of an earlier state may still be asked."""
        self.browser.run("const p=Worker.prototype.postMessage; Worker.prototype.postMessage=function(m) { if (!m.request || !m.request.trial) return p.call(this, m); Worker.prototype.postMessage=p; this.onmessage({ data: { id: m.id, ms: 0, reply: { fault: 'out of memory', broken: true } } }); }")
        self.press_button("[data-preset='Dial test, 90 deg']")
        self.expect("No answer: out of memory" in self.words(), f"a broken worker is not said: {self.words()}")
        self.press_button("[data-preset='Dial test, 30 deg']")
        self.expect("external" in self.words(), f"after a broken worker: {self.words()}")

    def without(self, page):
        """Without WebAssembly the section says so and points to the stored motions."""
        self.browser.ask("/goog/cdp/execute", {"cmd": "Page.addScriptToEvaluateOnNewDocument", "params": {"source": "delete window.WebAssembly"}})
        self.browser.ask("/url", {"url": "about:blank"})
        self.browser.ask("/url", {"url": page.as_uri() + "#live"})
        said = self.browser.run("const n=document.querySelector('.live-note'); return [n.textContent, n.querySelector('a').getAttribute('href'), document.querySelectorAll('#live [data-preset]').length]")
        self.expect("no WebAssembly" in said[0] and said[1:] == ["#scene-a-knee", 0], f"without WebAssembly: {said}")
        self.expect(self.browser.run("return !!document.getElementById('scene-a-knee')"), "the stored motions are not there")

    def shot(self, name, width, scheme):
        cdp = lambda cmd, params: self.browser.ask("/goog/cdp/execute", {"cmd": cmd, "params": params})
        cdp("Emulation.setDeviceMetricsOverride", {"width": width, "height": 1000, "deviceScaleFactor": 1, "mobile": False})
        cdp("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": scheme}]})
        self.browser.run("document.getElementById('live').scrollIntoView()")
        self.settle()
        time.sleep(1)
        wide = self.browser.run("return document.documentElement.scrollWidth - innerWidth")
        self.expect(wide <= 0, f"{name}: {wide} px wider than the screen")
        clip = self.browser.run("const r=document.getElementById('live').getBoundingClientRect(); return {x: 0, y: r.y + scrollY, width: innerWidth, height: r.height, scale: 1}")
        data = cdp("Page.captureScreenshot", {"clip": clip, "captureBeyondViewport": True})["data"]
        (self.folder / f"{name}.png").write_bytes(base64.b64decode(data))


def use(check, page, expected):
    browser = check.browser
    browser.ask("/url", {"url": page.as_uri()})
    browser.run("document.getElementById('live').scrollIntoView()")
    check.expect(check.settled(120), "the knee is not open after 120 s: " + browser.run("return document.getElementById('live').textContent.slice(0, 400)"))
    if check.faults:
        return
    print("opened after", browser.run("return document.getElementById('live').dataset.opened"), "ms")
    check.wait("return document.querySelector('#live figure').dataset.ready === 'yes'")
    check.first_minute(expected)
    check.intervals(expected["about"])
    check.slider()
    check.decimals()
    check.file()
    check.keyboard()
    check.frames()
    check.broken()
    for width in [400, 820, 1400]:
        for scheme in ["light", "dark"]:
            check.shot(f"live-{width}-{scheme}", width, scheme)
    check.link(page)
    check.without(page)
    for entry in browser.log("browser"):
        check.expect(entry["level"] != "SEVERE", f"console: {entry['message']}")
    for entry in browser.log("performance"):
        message = json.loads(entry["message"])["message"]
        if message["method"] == "Network.requestWillBeSent":
            url = message["params"]["request"]["url"]
            check.expect(url.startswith(("file:", "data:", "blob:", "about:")), f"asks the network for {url}")


def main():
    page, folder = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[3])
    expected = json.loads(pathlib.Path(sys.argv[2]).read_text())
    folder.mkdir(parents=True, exist_ok=True)
    try:
        browser = Browser()
    except NoBrowser as reason:
        print(f"chromium cannot be started: {reason}")
        sys.exit(77)
    check = Live(browser, folder)
    try:
        use(check, page, expected)
    finally:
        browser.close()
    print(f"{page.name}: {len(check.faults)} faults")
    for fault in check.faults:
        print("fault:", fault)
    sys.exit(1 if check.faults else 0)


if __name__ == "__main__":
    main()
