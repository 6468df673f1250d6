"""Looks at a report at 400 and 1400 pixels, light and dark, and printed to PDF: nothing wider than the page, nothing blank.

usage: looks.py REPORT.html SCREENSHOTS_FOLDER [AXE.min.js]
With axe-core's script its serious and critical findings are faults too. Ends with status 1 and a line for each fault, and with
status 77 where chromium cannot be started.
"""

import base64
import pathlib
import re
import sys
import time

from report import Browser, NoBrowser, colours

WIDTHS = [400, 1400]


class Looks:
    """A page in one browser, and what is wrong with it."""

    def __init__(self, browser, folder):
        self.browser, self.folder, self.faults = browser, folder, []

    def command(self, name, **parameters):
        return self.browser.ask("/goog/cdp/execute", {"cmd": name, "params": parameters})

    def show(self, page, width, dark):
        self.command("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=False)
        scheme = "dark" if dark else "light"
        self.command("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        self.browser.ask("/url", {"url": page.as_uri()})
        end = time.time() + 60
        while time.time() < end and self.browser.run("const f=document.querySelector('.first [data-scene]'); return !!f && f.dataset.ready !== 'yes'"):
            time.sleep(0.3)
        time.sleep(1)

    def look(self, page, width, dark, axe):
        name = f"{page.stem}-{width}-{'dark' if dark else 'light'}"
        self.show(page, width, dark)
        top = self.browser.picture()
        (self.folder / f"{name}.png").write_bytes(top)
        count, _ = colours(top)
        if count < 20:
            self.faults.append(f"{name}: the first screen is blank")
        # every details open, so that nothing hides from the measure
        self.browser.run("document.querySelectorAll('details').forEach(d => { d.open = true; })")
        wide = self.browser.run(
            "const w = document.documentElement.clientWidth; const inside = e => e.closest('.wide, .diagnosis, .view, .chart');"
            "return document.documentElement.scrollWidth > w ? [...document.querySelectorAll('body *')].filter(e => !inside(e) && e.getBoundingClientRect().right > w + 1)"
            ".slice(0, 5).map(e => e.tagName + '.' + e.className + ' ' + Math.round(e.getBoundingClientRect().right)) : []"
        )
        if wide:
            self.faults.append(f"{name}: wider than {width} px: {', '.join(wide)}")
        dull = self.browser.run("const c = getComputedStyle(document.body); return c.color + ' on ' + c.backgroundColor")
        if dark == ("255, 255, 255" in dull.split(" on ")[1]):
            self.faults.append(f"{name}: not in its colours: {dull}")
        if axe:
            self.browser.run(axe)
            found = self.browser.ask("/execute/async", {"script": "const done = arguments[0]; axe.run(document, {resultTypes: ['violations']}).then(r => done(r.violations.map(v => [v.impact, v.id, v.nodes.length, v.nodes[0].target.join(' '), v.nodes[0].failureSummary || ''])), e => done([['serious', String(e), 0, '', '']]))", "args": []})
            for impact, rule, nodes, first, why in found:
                if impact in ("serious", "critical"):
                    self.faults.append(f"{name}: axe {impact} {rule}, {nodes} places, the first {first}: {' '.join(why.split())[:200]}")

    def paper(self, page):
        self.show(page, 1400, False)
        has_sheet = self.browser.run("return !!document.querySelector('body>.sheet')")
        for whole in (False, True) if has_sheet else (True,):
            self.browser.run(f"document.body.classList.toggle('whole', {str(whole).lower()})")
            pdf = base64.b64decode(self.command("Page.printToPDF", printBackground=True, preferCSSPageSize=True)["data"])
            name = page.stem if whole else f"{page.stem}-one-page"
            (self.folder / f"{name}.pdf").write_bytes(pdf)
            if not pdf.startswith(b"%PDF") or len(pdf) < 50_000:
                self.faults.append(f"{name}: printed, it is blank ({len(pdf)} bytes)")
            sheets = len(re.findall(rb"/Type\s*/Page\b", pdf))
            if sheets != 1 and not whole:
                self.faults.append(f"{name}: printed, it has {sheets} pages, expected one")


def main():
    page, folder = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2])
    axe = pathlib.Path(sys.argv[3]).read_text() if len(sys.argv) > 3 else None
    folder.mkdir(parents=True, exist_ok=True)
    try:
        browser = Browser()
    except NoBrowser as reason:
        print(f"chromium cannot be started: {reason}")
        sys.exit(77)
    try:
        browser.ask("/timeouts", {"script": 120_000, "pageLoad": 120_000})
        looks = Looks(browser, folder)
        for width in WIDTHS:
            for dark in (False, True):
                looks.look(page, width, dark, axe)
        looks.paper(page)
    finally:
        browser.close()
    print(f"{page.name}: {2 * len(WIDTHS)} looks and paper, {len(looks.faults)} faults")
    for fault in looks.faults:
        print("fault:", fault)
    sys.exit(1 if looks.faults else 0)


if __name__ == "__main__":
    main()
