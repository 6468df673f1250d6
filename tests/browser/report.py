"""Opens a report in headless Chromium without network and uses it: every section, layers, cut, slider, keys.

usage: report.py REPORT.html SCREENSHOTS_FOLDER
Needs chromium and chromedriver on the path; nothing beyond Python's own library. Ends with status 1 and a line for each fault,
and with status 77 and the reason where chromium cannot be started.
"""

import base64
import contextlib
import json
import os
import pathlib
import socket
import struct
import subprocess
import sys
import time
import urllib.error
import urllib.request
import zlib

# chromedriver is on this machine: no proxy of the environment stands between
DIRECT = urllib.request.build_opener(urllib.request.ProxyHandler({}))


# what a script in the page may take, and longer than that, what an answer may [s]: other programs may hold the processors
SCRIPT, ANSWER = 240, 270


class NoBrowser(Exception):
    """Chromium does not start here."""


class Refused(Exception):
    """chromedriver cannot do what was asked: what it says, and what that was."""


def free_port():
    with socket.socket() as place:
        place.bind(("127.0.0.1", 0))
        return place.getsockname()[1]


class Browser:
    """A WebDriver session [https://www.w3.org/TR/webdriver2/]; `more` are further flags of chromium."""

    def __init__(self, more=()):
        self.port = free_port()
        self.driver = subprocess.Popen(["chromedriver", f"--port={self.port}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        flags = ["--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--window-size=1300,1000", "--hide-scrollbars", "--no-proxy-server",
                 "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--host-resolver-rules=MAP * ~NOTFOUND", *more]
        wanted = {"browserName": "chrome", "timeouts": {"script": 1000 * SCRIPT}, "goog:chromeOptions": {"args": flags}, "goog:loggingPrefs": {"browser": "ALL", "performance": "ALL"}}
        self.start(wanted)

    def start(self, wanted, seconds=60):
        """Asks for a session until chromedriver answers and chromium starts."""
        end, why = time.time() + seconds, ""
        while time.time() < end and self.driver.poll() is None:
            try:
                self.session = self.ask("", {"capabilities": {"alwaysMatch": wanted}}, "")["sessionId"]
                return
            except (Refused, OSError) as error:
                why = str(error)
            time.sleep(0.2)
        self.driver.kill()
        self.driver.wait()
        raise NoBrowser(why or f"chromedriver ended with status {self.driver.returncode}")

    def ask(self, path, body, session=None):
        base = f"http://127.0.0.1:{self.port}/session" + (f"/{self.session}" if session is None else session)
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(base + path, data, {"Content-Type": "application/json"})
        try:
            with DIRECT.open(request, timeout=ANSWER) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            why = str(error)
            with contextlib.suppress(ValueError, KeyError, OSError):
                why = json.load(error)["value"]["message"].splitlines()[0]
            raise Refused(f"{why}; asked for {path or 'a session'} {(data or b'')[:300].decode()}") from None

    def run(self, script, *arguments):
        return self.ask("/execute/sync", {"script": script, "args": list(arguments)})

    def picture(self):
        return base64.b64decode(self.ask("/screenshot", None))

    def log(self, kind):
        return self.ask("/se/log", {"type": kind})

    def press(self, key):
        actions = [{"type": "keyDown", "value": key}, {"type": "keyUp", "value": key}]
        self.ask("/actions", {"actions": [{"type": "key", "id": "keyboard", "actions": actions}]})

    def spent(self):
        """Processor time of Chromium so far [s]: of the solver's workers, of the page's thread, of all that draws."""
        parents, out = {}, {"solver": 0.0, "page": 0.0, "drawing": 0.0}
        for folder in pathlib.Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                parents[int(folder.name)] = int((folder / "stat").read_text().rsplit(")", 1)[1].split()[1])
        mine = lambda pid: pid == self.driver.pid or (pid in parents and mine(parents[pid]))
        for pid in filter(mine, parents):
            with contextlib.suppress(OSError):
                kind = (pathlib.Path("/proc") / str(pid) / "cmdline").read_text()
                for task in (pathlib.Path("/proc") / str(pid) / "task").iterdir():
                    name, rest = (task / "stat").read_text().split("(", 1)[1].rsplit(")", 1)
                    ticks = sum(map(int, rest.split()[11:13])) / os.sysconf("SC_CLK_TCK")
                    if "DedicatedWorker" in name:
                        out["solver"] += ticks
                    elif "--type=renderer" in kind and int(task.name) == pid:
                        out["page"] += ticks
                    elif "--type=gpu-process" in kind:
                        out["drawing"] += ticks
        return out

    def close(self):
        with contextlib.suppress(OSError):
            DIRECT.open(urllib.request.Request(f"http://127.0.0.1:{self.port}/session/{self.session}", method="DELETE"), timeout=20)
        self.driver.terminate()
        self.driver.wait()


def pixels(png):
    """Width, height and rows of RGB(A) of an 8-bit PNG."""
    at, header, packed = 8, None, b""
    while at < len(png):
        size, kind = struct.unpack(">I4s", png[at : at + 8])
        body = png[at + 8 : at + 8 + size]
        header = body if kind == b"IHDR" else header
        packed += body if kind == b"IDAT" else b""
        at += size + 12
    width, height, _, colour = struct.unpack(">IIBB", header[:10])
    step = {2: 3, 6: 4}[colour]
    raw, rows, before = zlib.decompress(packed), [], bytearray(width * step)
    for y in range(height):
        start = y * (width * step + 1)
        way, row = raw[start], bytearray(raw[start + 1 : start + 1 + width * step])
        for i in range(len(row)):
            left = row[i - step] if i >= step else 0
            up, corner = before[i], before[i - step] if i >= step else 0
            if way == 1:
                row[i] = (row[i] + left) & 255
            elif way == 2:
                row[i] = (row[i] + up) & 255
            elif way == 3:
                row[i] = (row[i] + (left + up) // 2) & 255
            elif way == 4:
                guess = left + up - corner
                near = min((abs(guess - left), 0, left), (abs(guess - up), 1, up), (abs(guess - corner), 2, corner))
                row[i] = (row[i] + near[2]) & 255
        rows.append(row)
        before = row
    return width, height, step, rows


def colours(png):
    """How many different colours a picture has, and which share of it is not white."""
    width, height, step, rows = pixels(png)
    seen, inked = set(), 0
    for row in rows:
        for x in range(width):
            c = bytes(row[x * step : x * step + 3])
            seen.add(c)
            inked += c != b"\xff\xff\xff"
    return len(seen), inked / (width * height)


class Check:
    """Uses the page and keeps what is wrong."""

    def __init__(self, browser, folder):
        self.browser, self.folder, self.faults = browser, folder, []

    def expect(self, holds, words):
        if not holds:
            self.faults.append(words)

    def wait(self, script, *arguments, seconds=60):
        end = time.time() + seconds
        while time.time() < end:
            if self.browser.run(script, *arguments):
                return True
            time.sleep(0.1)
        return False

    def wait_for(self, holds, seconds=60):
        end = time.time() + seconds
        while not holds() and time.time() < end:
            time.sleep(0.1)

    def settle(self):
        self.wait("return !document.querySelector('[data-busy]')")
        self.browser.run("return new Promise(r => setTimeout(() => requestAnimationFrame(() => requestAnimationFrame(r)), 60))")

    def view(self, scene):
        """A small picture of the scene's 3D view alone."""
        self.settle()
        # a view that was out of sight for a moment is taken down, and drawn anew
        there = "const p=document.querySelector(`[data-scene='${arguments[0]}'] .plot`); if (!p) return null; const r=p.getBoundingClientRect(); return {x: r.x + scrollX, y: r.y + scrollY, width: r.width, height: r.height, scale: 0.3}"
        clips = []
        self.wait_for(lambda: clips.append(self.browser.run(there, scene)) or clips[-1])
        clip = clips[-1]
        if clip is None:
            raise Refused(f"{scene}: its view is not drawn after 60 s")
        return base64.b64decode(self.browser.ask("/goog/cdp/execute", {"cmd": "Page.captureScreenshot", "params": {"clip": clip, "captureBeyondViewport": True}})["data"])

    def view_when(self, scene, holds, seconds=30):
        """The first view that holds what is asked, as a slow machine may draw late; the last one if none does."""
        end = time.time() + seconds
        while True:
            picture = self.view(scene)
            if holds(picture) or time.time() > end:
                return picture
            time.sleep(0.2)

    def scene(self, scene):
        words = self.browser.run("const f=document.querySelector(`[data-scene='${arguments[0]}']`); f.scrollIntoView(); return f.querySelector(':scope > figcaption').textContent.trim()", scene)
        self.expect(len(words) > 40, f"{scene}: no text alternative")
        ready = self.wait("return document.querySelector(`[data-scene='${arguments[0]}']`).dataset.ready === 'yes'", scene)
        self.expect(ready, f"{scene}: no 3D view after 60 s")
        if not ready:
            return
        label = self.browser.run("const v=document.querySelector(`[data-scene='${arguments[0]}'] .view`); return (v.getAttribute('aria-label') || '') + v.tabIndex", scene)
        self.expect("Arrow keys" in label and label.endswith("0"), f"{scene}: not for the keyboard: {label}")
        last = [None]
        steady = lambda picture: last[0] == picture or last.__setitem__(0, picture)
        first = self.view_when(scene, steady)
        count, share = colours(first)
        self.expect(count > 20 and share > 0.01, f"{scene}: blank ({count} colours, {share:.3f} inked)")
        (self.folder / f"{scene.replace('/', '-')}.png").write_bytes(self.browser.picture())
        self.layers(scene, first)
        self.keys(scene)

    def layers(self, scene, first):
        count = self.browser.run(f"const all=document.querySelectorAll(`[data-scene='${{arguments[0]}}'] .layers input:checked`); all.forEach(b => b.click()); return all.length", scene)
        self.expect(count > 0, f"{scene}: no layers")
        less = lambda picture: colours(picture)[1] < colours(first)[1] * 0.9
        self.expect(less(self.view_when(scene, less)), f"{scene}: hiding the layers changes nothing")
        self.browser.run("document.querySelectorAll(`[data-scene='${arguments[0]}'] .layers input`).forEach((b, n) => { if (arguments[1].includes(n)) b.click(); })", scene, self.on_at_first(scene))
        cut = "const s=document.querySelector(`[data-scene='${arguments[0]}'] .cut select`); s.value=arguments[1]; s.dispatchEvent(new Event('input'))"
        again = lambda picture: abs(colours(picture)[1] - colours(first)[1]) < 0.02
        shown = self.view_when(scene, again)
        before = colours(shown)[1]
        self.expect(again(shown), f"{scene}: shown again, the layers are not as before")
        self.browser.run(cut, scene, "0")
        cuts = lambda picture: colours(picture)[1] < before * 0.95
        self.expect(cuts(self.view_when(scene, cuts)), f"{scene}: the plane cuts nothing")
        self.browser.run(cut, scene, "-1")

    def on_at_first(self, scene):
        return self.browser.run("const d=JSON.parse(document.getElementById('data').textContent), [pool,id]=arguments[0].split('/'); return d[pool].scenes.find(s => s.id === id).layers.flatMap((l, n) => l.on ? [n] : [])", scene)

    def keys(self, scene):
        still = self.view(scene)
        self.browser.run("document.querySelector(`[data-scene='${arguments[0]}'] .view`).focus({preventScroll: true})", scene)
        for _ in range(4):
            self.browser.press("\ue014")
        turned = lambda picture: picture != still
        self.expect(turned(self.view_when(scene, turned)), f"{scene}: the arrow keys do not turn it")
        self.browser.press("0")

    def slider(self, scene):
        motions = self.browser.run("const s=document.querySelector(`[data-scene='${arguments[0]}'] .motion select`); return s ? s.options.length : 0", scene)
        if not motions:
            return False
        seen = set()
        move = "const f=document.querySelector(`[data-scene='${arguments[0]}']`), s=f.querySelector('.motion select'), r=f.querySelector('.motion input'); s.value=arguments[1]; s.dispatchEvent(new Event('input')); r.value=Math.round(arguments[2]*r.max); r.dispatchEvent(new Event('input')); return f.querySelector('.step').textContent"
        places = [(0, 0), (0, 0.5)] + [(motion, 1) for motion in range(motions)]
        for motion, share in places:
            words = self.browser.run(move, scene, str(motion), share)
            self.expect("flexion" in words, f"{scene}: no words on the step: {words}")
            seen.add(self.view_when(scene, lambda picture: picture not in seen, seconds=10))
        self.expect(len(seen) == len(places), f"{scene}: the slider moves nothing ({len(seen)} pictures of {len(places)})")
        place = "return document.querySelector(`[data-scene='${arguments[0]}'] .motion input`).value"
        self.browser.run(move, scene, "0", 0)
        self.browser.run("document.querySelector(`[data-scene='${arguments[0]}'] .play`).click()", scene)
        plays = self.wait("return document.querySelector(`[data-scene='${arguments[0]}'] .motion input`).value > 1", scene, seconds=30)
        self.expect(plays, f"{scene}: Play does not play")
        self.browser.run("document.querySelector(`[data-scene='${arguments[0]}'] .play`).click()", scene)
        self.settle()
        stopped = self.browser.run(place, scene)
        time.sleep(0.5)
        self.expect(self.browser.run(place, scene) == stopped, f"{scene}: Stop does not stop")
        self.browser.run(move, scene, "0", 0.6)
        self.settle()
        (self.folder / f"{scene.replace('/', '-')}-moved.png").write_bytes(self.browser.picture())
        return True

    def charts(self):
        for chart in self.browser.run("return [...document.querySelectorAll('[data-chart]')].map(c => c.dataset.chart)"):
            self.browser.run("document.querySelector(`[data-chart='${arguments[0]}']`).scrollIntoView()", chart)
            drawn = self.wait("return !!document.querySelector(`[data-chart='${arguments[0]}'] .plot-container path.js-line, [data-chart='${arguments[0]}'] .plot-container path.point`)", chart, seconds=20)
            self.expect(drawn, f"{chart}: no chart")
        if self.browser.run("return !!document.querySelector('[data-chart]')"):
            self.browser.run("document.querySelector('.charts').scrollIntoView()")
            self.settle()
            (self.folder / "charts.png").write_bytes(self.browser.picture())


def main():
    page, folder = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    try:
        browser = Browser()
    except NoBrowser as reason:
        print(f"chromium cannot be started: {reason}")
        sys.exit(77)
    try:
        check = Check(browser, folder)
        browser.ask("/url", {"url": page.as_uri()})
        check.expect(browser.run("return !!document.querySelector('.verdict')"), "no verdict")
        four = browser.run("return [...document.querySelectorAll('[data-answer]')].map(a => [a.dataset.answer, a.className, a.querySelector('.word').textContent])")
        check.expect([a[0] for a in four] == ["geometry", "calibrated", "predicts", "missing"], f"not four answers: {four}")
        check.expect(all(a[2] for a in four), f"an answer without a word: {four}")
        check.expect(not browser.run("return document.querySelector('.sheet').offsetHeight"), "the page to print shows on the screen")
        first = browser.run("return document.body.textContent.search(/Built|stopped/) < document.body.textContent.indexOf('01 ingest')")
        check.expect(first, "the verdict does not come first")
        (folder / "top.png").write_bytes(browser.picture())
        for link in browser.run("return [...document.querySelectorAll('nav a')].map(a => a.getAttribute('href'))"):
            there = browser.run("document.querySelector(`nav a[href='${arguments[0]}']`).click(); return !!document.getElementById(arguments[0].slice(1))", link)
            check.expect(there, f"nothing at {link}")
        scenes = browser.run("return [...document.querySelectorAll('[data-scene]')].map(f => f.dataset.scene)")
        check.expect(len(scenes) > 0, "no scenes")
        moved = False
        for scene in scenes:
            check.scene(scene)
            moved = check.slider(scene) or moved
        check.charts()
        unnamed = browser.run("return [...document.querySelectorAll('img')].filter(i => !i.alt).length")
        check.expect(unnamed == 0, f"{unnamed} pictures without words")
        for entry in browser.log("browser"):
            check.expect(entry["level"] != "SEVERE", f"console: {entry['message']}")
        for entry in browser.log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] == "Network.requestWillBeSent":
                url = message["params"]["request"]["url"]
                check.expect(url.startswith(("file:", "data:", "blob:")), f"asks the network for {url}")
        print(f"{page.name}: {len(scenes)} scenes, {'with' if moved else 'without'} motion, {len(check.faults)} faults")
    finally:
        browser.close()
    for fault in check.faults:
        print("fault:", fault)
    sys.exit(1 if check.faults else 0)


if __name__ == "__main__":
    main()
