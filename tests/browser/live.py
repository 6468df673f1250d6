"""Pulls at the knee of a report in headless Chromium without network, and holds what the page shows against what the library answers.

usage: live.py REPORT.html EXPECTED.json SCREENSHOTS_FOLDER
EXPECTED.json: {"about": ..., "lachman": reply, "cut": reply of the same with the ACL cut, "graft": {"asked", "told", "bands"}}. Ends as report.py does: 0, 1 with a line a fault, 77.
"""

import base64
import html
import json
import os
import pathlib
import sys
import time
import urllib.parse

from report import Browser, Check, NoBrowser

SHOWN = {"force": 0.051, "pose": 0.0051}  # half the last digit that the tables show, and rounding [N; deg, mm]
TAB, ENTER, LEFT, RIGHT, SHIFT, ESCAPE = "\ue004", "\ue007", "\ue012", "\ue014", "\ue008", "\ue00c"
# `view` is what the page draws with; the figure hands it out when it is drawn
CATCH = {"source": "document.addEventListener('shown', e => { if (e.target.closest('#live')) window.view = e.detail; }, true)"}
# a free place on the tibia: no fibre near, and room to drag to the right of it
TIBIA = """const b=view.plot.getBoundingClientRect(); for (let y=b.height-30; y>b.height/2; y-=6) for (let x=b.width/2; x>b.width/5; x-=6) {
  const hit=liveHand.bone(view,x,y); if (hit && hit.name==='tibia' && liveHand.fibre(view,x,y,'touch',hit)<0) return {x, y, point: hit.point}; } return null"""
BONE = """const b=view.plot.getBoundingClientRect(); for (let y=b.height/5; y<b.height*4/5; y+=5) for (let x=b.width/4; x<b.width*3/4; x+=5) {
  const hit=liveHand.bone(view,x,y); if (hit && hit.name===arguments[0] && liveHand.fibre(view,x,y,'touch',hit)<0) return {x, y, point: hit.point}; } return null"""
FIBRE = """const of=arguments[0]; for (let f=0; 2*f<view.ends.length; f++) { if (!of.includes(f)) continue; for (const t of [0.5,0.4,0.6,0.3,0.7,0.2,0.8]) {
  const [a,b]=[view.ends[2*f],view.ends[2*f+1]], p=liveHand.project(view,a.map((v,k)=>v+t*(b[k]-v))), hit=liveHand.bone(view,p.x,p.y);
  if (of.includes(liveHand.fibre(view,p.x,p.y,'mouse',hit))) return {x:p.x, y:p.y}; } } return null"""
# where plotly.js itself puts a point of the page, by the matrices that it draws with
PLOTLY = """const c=view.plot._fullLayout.scene._scene.glplot.cameraParams, by=(m,v)=>[0,1,2,3].map(r=>m[r]*v[0]+m[4+r]*v[1]+m[8+r]*v[2]+m[12+r]*v[3]), scale=view.plot._fullLayout.scene._scene.dataScale||[1,1,1];
  const q=by(c.projection,by(c.view,by(c.model,[...arguments[0].map((x,k)=>x*scale[k]),1]))), b=view.plot.getBoundingClientRect(), own=liveHand.project(view,arguments[0]);
  return [(1+q[0]/q[3])*b.width/2-own.x, (1-q[1]/q[3])*b.height/2-own.y]"""


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
        return self.browser.run("return document.getElementById('live').dataset.state")

    def heard(self):
        """What the page says of a number or a link that it could not take as it was."""
        return self.browser.run("return document.querySelector('.live-heard').textContent")

    def go(self, link):
        self.browser.run("location.hash = arguments[0]", link)
        self.expect(self.settled(), f"{link}: no answer")

    def first_minute(self, expected):
        """Lachman, cut the ACL, read the difference; undo and reset."""
        about = expected["about"]
        self.expect("the tibia lies as it does at rest." in self.words(), f"at rest: {self.words()}")
        self.press_button("[data-preset='Lachman']")
        self.says(expected["lachman"], about, "Lachman")
        self.press_button("[data-cut='ACL']")
        self.says(expected["cut"], about, "Lachman without ACL")
        more = expected["cut"]["pose"]["ap_mm"] - expected["lachman"]["pose"]["ap_mm"]
        self.expect(f"{more:.1f} mm anterior" in self.words(), f"the difference of {more:.2f} mm is not in: {self.words()}")
        self.expect("Cut: ACL." in self.words(), f"the cut is not in: {self.words()}")
        names = self.browser.run("return document.querySelector('.live-names').textContent")
        self.expect("PCAP: posterior capsule" in names, f"what the names stand for: {names}")
        self.beside("first minute", [("Lachman", "[data-preset='Lachman']"), ("ACL", "[data-cut='ACL']")])
        self.press_button("[data-act='undo']")
        self.says(expected["lachman"], about, "undone")
        self.press_button("[data-act='reset']")
        self.expect(self.state() == "#live&flexion=30", f"reset leaves {self.state()}")

    def beside(self, name, buttons):
        """What a button does is read beside it: with the button in the upper half of a screen the whole sentence is seen, at three widths."""
        seen = """document.querySelector(arguments[0]).scrollIntoView({block: 'start'}); window.scrollBy(0, -innerHeight / 4); const r = document.querySelector('.live-words').getBoundingClientRect();
          return [r.top >= 0 && r.bottom <= innerHeight + 1, [0.1, 0.9].every(s => document.elementFromPoint(r.left + r.width / 2, r.top + s * r.height)?.closest('.live-words'))]"""
        for width, height in [(400, 800), (820, 1100), (1400, 900)]:
            self.cdp("Emulation.setDeviceMetricsOverride", {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False})
            for words, button in buttons:
                self.expect(self.browser.run(seen, button) == [True, True], f"{name}, {width} px: from the button {words} the sentence is not seen")
        self.cdp("Emulation.clearDeviceMetricsOverride", {})

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
        self.expect(self.wait(f"return Number(document.getElementById('live').dataset.samples) === {most}", seconds=120), "no intervals of a changed knee after 120 s")
        changed = self.browser.run("return document.querySelector(`#live-ligaments [data-row='ACL_AM']`).cells[3].textContent")
        self.expect(" to " in changed and changed not in text, f"the interval of a changed ligament: {changed}")
        self.press_button("[data-act='undo']")
        self.expect(self.cell("live-ligaments", "ACL_AM", 1) == before, "undo does not bring the force back")

    # -- the pointer

    def pointer(self, actions, kind="mouse", keys=()):
        """Actions of a pointer on the picture, places in its pixels; `keys` are held meanwhile. What was pressed stays so until the next call."""
        self.browser.run("document.querySelector('#live .view').scrollIntoView({block: 'center'})")
        left, top = self.browser.run("const b=view.plot.getBoundingClientRect(); return [b.left, b.top]")
        moves = [{"type": "pointerMove", "duration": 30, "x": round(left + a[0]), "y": round(top + a[1])} if isinstance(a, tuple) else {"type": a, "button": 0} for a in actions]
        held = lambda kind_: [{"type": kind_, "value": key} for key in keys]
        pause = [{"type": "pause", "duration": 0}] * len(keys)
        waits = [{"type": "pause", "duration": 0}] * len(moves)
        sources = [{"type": "pointer", "id": kind, "parameters": {"pointerType": kind}, "actions": pause + moves + pause}]
        if keys:
            sources.append({"type": "key", "id": "keyboard", "actions": held("keyDown") + waits + held("keyUp")})
        self.browser.ask("/actions", {"actions": sources})

    def dragged(self, kind, start, to, keys=()):
        """A drag in steps, let go at its end."""
        steps = [(start[0] + (to[0] - start[0]) * n / 4, start[1] + (to[1] - start[1]) * n / 4) for n in range(1, 5)]
        self.pointer([tuple(start), "pointerDown", *steps, "pointerUp"], kind, keys)
        self.expect(self.settled(), f"a drag by {kind}: no answer")

    def load(self, key):
        """A load of the state, by its link."""
        return float(urllib.parse.parse_qs(self.state().removeprefix("#live&")).get(key, ["0"])[0])

    def look(self, words):
        self.browser.run("[...document.querySelectorAll('#live .tools button')].find(b => b.textContent === arguments[0]).click()", words)
        self.wait("return !document.querySelector('#live figure').dataset.busy")
        time.sleep(0.2)

    def hand(self):
        """Pulls at the tibia: the drag is the load, by mouse, pen and finger; a turn with Shift; Escape and a spring undo it; the background turns the picture."""
        self.press_button("[data-act='reset']")
        self.look("patient's right")
        place = self.browser.run(TIBIA)
        self.expect(place is not None, "no free place on the tibia")
        off = self.browser.run(PLOTLY, place["point"])
        self.expect(max(map(abs, off)) < 1.5, f"the pointer's camera is {off} px beside plotly's")
        px = self.browser.run("const a=arguments[0], p=liveHand.project(view,a), q=liveHand.project(view,[a[0],a[1]+1,a[2]]); return q.x-p.x", place["point"])
        start = (place["x"], place["y"])
        for kind, newtons in [("mouse", 90), ("pen", 60), ("touch", -70)]:
            self.press_button("[data-act='reset']")
            self.dragged(kind, start, (start[0] + newtons / 2 * px, start[1]))
            ap = self.load("ap")
            self.expect(abs(ap - newtons) <= 2.5, f"{kind}: a pull of {newtons} N is {ap} N")
            slider, anterior = self.browser.run("return Number(document.getElementById('live-ap').value)"), self.cell("live-pose", "ap_mm", 1)
            self.expect(slider == ap, f"{kind}: the slider stands at {slider}, the load is {ap}")
            self.press_button("[data-act='undo']")
            self.expect(self.load("ap") == 0, f"{kind}: one drag is not one step of undo")
            self.browser.run("const r=document.getElementById('live-ap'); r.value=arguments[0]; r.dispatchEvent(new Event('input')); r.dispatchEvent(new Event('change'))", ap)
            self.expect(self.settled() and self.cell("live-pose", "ap_mm", 1) == anterior, f"{kind}: the slider at the same load gives another pose")
        self.press_button("[data-act='reset']")
        # in the midst: the arrow tells the newtons; a pull beyond the slider's range is held there
        self.pointer([start, "pointerDown", (start[0] + 20 * px, start[1]), (start[0] + 50 * px, start[1])])
        self.expect(self.settled(), "in the midst of a drag: no answer")
        arrow = self.browser.run("const t=document.querySelector('.live-arrow text'); return t && t.textContent")
        self.expect(arrow and f"forwards +{self.load('ap'):.0f} N" in arrow and abs(self.load("ap") - 100) < 3, f"the arrow says {arrow} at {self.load('ap')} N")
        self.pointer([(start[0] - 130 * px, start[1])])
        self.expect(self.settled() and self.load("ap") == -200, f"a long pull gives {self.load('ap')} N")
        self.browser.press(ESCAPE)
        self.expect(self.settled() and self.load("ap") == 0, f"Escape leaves {self.load('ap')} N")
        self.pointer(["pointerUp"])
        self.expect(self.settled() and self.load("ap") == 0 and not self.browser.run("return !!document.querySelector('.live-arrow')"), "after Escape the drag goes on")
        self.browser.run("document.getElementById('live-springs').click()")
        self.dragged("mouse", start, (start[0] + 40 * px, start[1]))
        self.expect(self.load("ap") == 0, f"a spring leaves {self.load('ap')} N")
        self.browser.run("document.getElementById('live-springs').click()")
        self.turns()
        self.orbit()

    def turns(self):
        """With Shift a pull sideways at the shin is a bend, by its lever."""
        self.look("front")
        place = self.browser.run(TIBIA)
        start, side = (place["x"], place["y"]), self.browser.run("const a=arguments[0], p=liveHand.project(view,a), q=liveHand.project(view,[a[0]+1,a[1],a[2]]); return q.x-p.x", place["point"])
        newtons = 60
        self.dragged("mouse", start, (start[0] + newtons / 2 * side, start[1]), keys=[SHIFT])
        # towards the patient's right at a place so far below the knee's middle [mm]
        expected = newtons * -place["point"][2] / 1000 * (-1 if self.side == "left" else 1)
        self.expect(abs(self.load("vv") - expected) < 0.25 and self.load("ap") == 0, f"a bend of {expected:.1f} N m is {self.load('vv')} N m")
        self.press_button("[data-act='undo']")

    def orbit(self):
        """A drag on the background turns the picture and changes no load."""
        before, eye = self.state(), self.browser.run("return view.eye")
        self.dragged("mouse", (12, 12), (90, 30))
        turned = self.wait("return Math.hypot(...view.eye.map((x, k) => x - arguments[0][k])) > 0.05", eye, seconds=10)
        self.expect(turned and self.state() == before, "a drag on the background does not turn the picture alone")

    def clicks(self, about):
        """A click on a ligament in the picture cuts it, as its button does; another puts it back."""
        self.press_button("[data-act='reset']")
        for words in ["front", "patient's right", "patient's left", "behind"]:
            self.look(words)
            for name in ["LCL", "sMCL"]:
                of = [f for f, b in enumerate(about["fibres"]) if about["bundles"][b]["name"].split("_")[0] == name]
                place = self.browser.run(FIBRE, of)
                if place:
                    break
            if place:
                break
        self.expect(place is not None, "no ligament is seen from anywhere")
        if not place:
            return
        click = [(place["x"], place["y"]), "pointerDown", "pointerUp"]
        self.pointer(click)
        self.expect(self.settled(), "a click on a ligament: no answer")
        own = [b["name"] for b in about["bundles"] if b["name"].split("_")[0] == name]
        by_click = [self.cell("live-ligaments", b["name"], 1) for b in about["bundles"]]
        self.expect(f"cut={','.join(own)}" in urllib.parse.unquote(self.state()), f"a click on {name} gives {self.state()}")
        self.expect(self.browser.run("return document.querySelector(`[data-cut='${arguments[0]}']`).getAttribute('aria-pressed')", name) == "true", f"the list does not show {name} as cut")
        self.press_button("[data-act='undo']")
        self.press_button(f"[data-cut='{name}']")
        self.expect(by_click == [self.cell("live-ligaments", b["name"], 1) for b in about["bundles"]], f"a click on {name} and its button differ")
        self.press_button("[data-act='undo']")

    def grafts(self, page, expected):
        """A graft by two clicks bears its tension; one by a link answers as the library does, with its intervals."""
        about = expected["about"]
        self.press_button("[data-act='reset']")
        self.look("front")
        self.browser.run("const t=document.getElementById('live-graft-tension'); t.value='65,5'; t.dispatchEvent(new Event('change'))")
        self.press_button("[data-act='graft']")
        femur, tibia = self.browser.run(BONE, "femur"), self.browser.run(BONE, "tibia")
        self.pointer([(tibia["x"], tibia["y"]), "pointerDown", "pointerUp"])
        said = "return document.querySelector('.live-graft-said').textContent"
        self.expect("not the femur" in self.browser.run(said), f"the tibia in the femur's place: {self.browser.run(said)}")
        for place in [femur, tibia]:
            self.pointer([(place["x"], place["y"]), "pointerDown", "pointerUp"])
        self.expect(self.settled(), "a graft: no answer")
        graft = json.loads(urllib.parse.parse_qs(self.state())["graft"][0])[0]
        self.expect(graft["drawn"] == {"tension_n": 65.5, "at_flexion_deg": 30} and graft["stiffness_n_per_mm"] == about["graft"]["stiffness_n_per_mm"], f"the graft is {graft}")
        back = self.browser.run("const ct=arguments[0], p=arguments[1].map((x,k)=>x-ct[4*k+3]); return liveHand.project(view,[0,1,2].map(c=>ct[c]*p[0]+ct[4+c]*p[1]+ct[8+c]*p[2]))", about["ct"], graft["ends"][0][1])
        self.expect(abs(back["x"] - tibia["x"]) < 2 and abs(back["y"] - tibia["y"]) < 2, f"the tibial end lies at {back}, clicked was {tibia}")
        force = self.cell("live-ligaments", "graft0", 1)
        self.expect(abs(force - 65.5) < 0.4, f"the graft bears {force} N where it was fixed with 65.5 N")
        self.expect("65.5 N at 30 deg" in self.browser.run("return document.querySelector('.live-grafts').textContent"), "the list does not tell the graft")
        self.press_button("[data-act='undo']")
        self.expect("graft" not in self.state(), "undo leaves the graft")
        self.press_button("[data-act='graft-there']")
        self.expect("graft" in self.state(), "a graft without a pointer is not in")
        self.press_button("[data-take='0']")
        self.expect("graft" not in self.state(), "a graft that was taken out is in")
        # as the library answers, intervals too
        asked, told = expected["graft"]["asked"], expected["graft"]["told"]
        query = urllib.parse.urlencode({"flexion": asked["flexion_deg"], "ap": asked["load"][3], "cut": ",".join(asked["cut"]), "graft": json.dumps(asked["grafts"])})
        self.browser.run("location.hash = arguments[0]", "#live&" + query)
        self.expect(self.settled(), "a link with a graft: no answer")
        self.says(told, about, "the graft by a link")
        self.expect(abs(self.cell("live-ligaments", "graft0", 1) - told["forces_n"][-1]) <= SHOWN["force"], "the graft's force")
        most = expected["graft"]["bands"]["asked"]
        self.expect(self.wait(f"return Number(document.getElementById('live').dataset.samples) === {most}", seconds=180), "no intervals of a knee with a graft")
        band = expected["graft"]["bands"]["bands"]["force_graft0_n"]
        shown = self.browser.run("return document.querySelector(`#live-ligaments [data-row='graft0']`).cells[3].textContent").split(" to ")
        self.expect(abs(float(shown[0]) - band["lower"]) < SHOWN["force"] and abs(float(shown[1]) - band["upper"]) < SHOWN["force"], f"the interval {shown}, expected {band}")
        print("intervals of a grafted knee by", most, "samples after", self.browser.run("return document.getElementById('live').dataset.bandsMs"), "ms")
        self.press_button("[data-act='reset']")

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
        """A decimal comma is a point; words are refused without harm. A flexion beyond the slider is asked as far as the solver goes; what is held back is said."""
        typed = "const t=document.querySelectorAll('.live-slider input[type=text]')[arguments[0]]; t.value=arguments[1]; t.dispatchEvent(new Event('change')); return t.value"
        self.browser.run(typed, 2, "2,5")
        self.expect(self.settled() and "ie=2.5" in self.state(), f"2,5 N m becomes {self.state()}")
        self.expect(self.browser.run(typed, 2, "much") == "2.5", "a word in a number's place stays")
        self.expect("\"much\" is no number" in self.heard(), f"a word in a number's place: {self.heard()}")
        for given, slider in [("-5", "0"), ("133.25", "120")]:
            self.browser.run(typed, 0, given)
            self.expect(self.settled() and self.load("flexion") == float(given), f"{given} deg becomes {self.state()}")
            shown = self.browser.run("const r=document.getElementById('live-flexion'); return [r.value, r.parentElement.querySelector('[type=text]').value]")
            self.expect(shown == [slider, given] and not self.heard(), f"{given} deg: slider and number are {shown}, said is {self.heard()}")
            told = f"At {float(given):.0f} deg"
            self.expect(told in self.words(), f"{given} deg: {self.words()}")
        self.browser.run(typed, 0, "-45")
        self.expect(self.settled() and self.load("flexion") == -30, f"-45 deg becomes {self.state()}")
        self.expect("-45 deg is beyond" in self.heard() and "it is -30 deg" in self.heard(), f"-45 deg: {self.heard()}")
        self.press_button("[data-act='reset']")

    def beyond(self):
        """What goes beyond the calibration's trials is said, and that a femur has left its plateau takes the meaning of intervals."""
        self.go("#live&flexion=150&ap=450")
        text = self.words()
        self.expect("beyond what was measured" in text and "flexion of 150 deg" in text and "pull forwards of 450 N" in text, f"beyond the calibration: {text}")
        self.press_button("[data-preset='At rest']")
        self.expect("beyond what was measured" not in self.words(), f"at rest: {self.words()}")
        self.go("#live&flexion=30&ap=200&cut=ACL,PCL,LCL,sMCL,dMCL")
        text, look = self.words(), "return [document.getElementById('live').classList.contains('off'), document.querySelector('#live-contact caption').textContent, document.querySelector(`#live-contact [data-row='contact_medial_peak_mpa']`).cells[2].textContent]"
        if "No answer" in text:
            self.expect(self.browser.run(look)[1].endswith("(grey: of the state before)"), f"without an answer: {self.browser.run(look)}")
            self.press_button("[data-act='reset']")
            return
        self.expect("has left the plateau" in text and self.browser.run(look) == [True, "Contact of the cartilages (grey: the femur has left the plateau)", "not told"], f"off the plateau: {text} {self.browser.run(look)}")
        self.expect(self.csv()["flags"][1].startswith("dislocated"), "the file does not tell that the femur has left the plateau")
        self.press_button("[data-act='reset']")
        self.expect(self.browser.run(look)[0] is False, "after Reset the numbers are grey")

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
        self.expect(self.state() == "#live&flexion=160&cut=LCL", f"a strange link gives {self.state()}")
        self.expect(all(words in self.heard() for words in ["9999 deg is beyond", "it is 160 deg", "NOBODY, ACL_AM:x"]), f"a strange link: {self.heard()}")
        self.go("#live&flexion=-4")
        self.expect(self.load("flexion") == -4 and not self.heard(), f"a link of -4 deg gives {self.state()}, {self.heard()}")

    def csv(self):
        """Rows of the file by their names."""
        self.browser.run("document.querySelector(\"[data-act='csv']\").click()")
        text = self.browser.run("return document.getElementById('live').dataset.csv")
        return {line.split(",")[0]: line.split(",") for line in text.splitlines()}

    def file(self):
        """The file holds what is shown, what was done to the knee, and how many samples say so."""
        self.press_button("[data-preset='Lachman']")
        self.wait("return Number(document.getElementById('live').dataset.samples) >= 8", seconds=120)
        rows = self.csv()
        self.expect(rows["name"][1:] == ["value", "mean", "lower", "upper", "as_calibrated", "at_rest"], f"{rows['name']}")
        self.expect(abs(float(rows["ap_mm"][1]) - self.cell("live-pose", "ap_mm", 1)) <= SHOWN["pose"], "the file has another pose")
        self.expect(float(rows["load_ap_n"][1]) == 133, "the file has another load")
        self.expect(rows["cut"][1] == "" and int(rows["samples_asked"][1]) >= 8 and {"flags", "beyond_calibration", "samples_lost", "samples_leaving"} <= set(rows), f"the file has {list(rows)}")
        self.go("#live&flexion=30&cut=ACL&strain=LCL:0.02&stiffness=PFL:2")
        self.press_button("[data-act='graft-there']")
        rows = self.csv()
        told = [rows[name][1] for name in ["cut", "added_strain_LCL", "stiffness_factor_PFL", "graft0_name", "graft0_tension_n"]]
        self.expect(told[:4] == ["ACL_AM ACL_PL", "0.02", "2", "graft 1"] and float(told[4]) > 0, f"the file tells {told}")
        self.press_button("[data-act='reset']")

    def tabbed(self, selector, most=60):
        """Goes on by Tab to a control."""
        passed = []
        for _ in range(most + 1):
            there, place = self.browser.run("const a=document.activeElement; return [a.matches(arguments[0]), a.id || a.textContent.trim().slice(0, 20) || a.tagName]", selector)
            if there:
                return
            passed.append(place)
            self.browser.press(TAB)
        self.expect(False, f"{selector} is not reached by {most} Tabs: {passed}")

    def entered(self, selector):
        """Goes on by Tab to a control and presses Enter there."""
        self.tabbed(selector)
        self.browser.press(ENTER)
        self.expect(self.settled(), f"Enter on {selector}: no answer")

    def keyboard(self, page, expected):
        """By keys alone from the top of the page: a test, a slider, a cut, a graft, Undo, the link; on values."""
        about = expected["about"]
        self.browser.ask("/url", {"url": "about:blank"})
        self.browser.ask("/url", {"url": page.as_uri()})
        # a link of its own: how many controls stand before the knee depends on warnings, and on whether the knee is open already
        self.tabbed("a.skip[href='#live']", most=2)
        self.browser.press(ENTER)
        self.expect(self.settled(120), "by the link to the section: the knee is not open")
        self.entered("[data-preset='Lachman']")
        self.says(expected["lachman"], about, "Lachman by keys")
        self.tabbed("#live-ap")
        self.browser.press(RIGHT)
        self.expect(self.settled() and self.load("ap") == 134, f"an arrow on the slider gives {self.state()}")
        self.browser.press(LEFT)
        self.expect(self.settled(), "an arrow back: no answer")
        self.entered("[data-cut='ACL']")
        self.says(expected["cut"], about, "a cut by keys")
        self.entered("[data-act='graft-there']")
        bears = self.browser.run("return Number((document.querySelector(`#live-ligaments [data-row='graft0']`) || {cells: []}).cells[1]?.textContent)")
        self.expect(bears > 5, f"a graft by keys bears {bears} N")
        self.entered("[data-act='undo']")
        self.says(expected["cut"], about, "a graft undone by keys")
        self.entered("[data-act='undo']")
        self.says(expected["lachman"], about, "a cut undone by keys")
        self.entered("#live-link")
        self.expect(self.browser.run("return location.hash") == self.state() and "ap=133" in self.state(), f"Enter on the link of {self.state()} goes to {self.browser.run('return location.hash')}")
        unnamed = self.browser.run("return [...document.querySelectorAll('#live input, #live button, #live a, #live summary')].filter(e => !(e.textContent.trim() || e.getAttribute('aria-label') || (e.labels && e.labels.length))).length")
        self.expect(unnamed == 0, f"{unnamed} controls without a name")
        status = self.browser.run("return document.querySelector('#live .unseen[role=status]').textContent")
        self.expect("mm" in status, f"a screen reader is told: {status}")
        self.wait("return document.querySelector('#live figure').dataset.ready === 'yes'")

    def frame(self, page):
        """In a frame without an address, as a notebook has it, nothing takes the frame elsewhere, and the state is copied as text."""
        around = self.folder / "frame.html"
        around.write_text(f"<!doctype html><title>frame</title><iframe title='knee' style='width:100%;height:900px' srcdoc='{html.escape(page.read_text())}'></iframe>")
        self.browser.ask("/url", {"url": around.as_uri()})
        self.browser.ask("/frame", {"id": 0})
        self.browser.run("location.hash = 'live&'; document.getElementById('live').scrollIntoView()")
        self.expect(self.settled(120), "in a frame: the knee is not open")
        self.press_button("[data-preset='Lachman']")
        self.browser.run("document.getElementById('live-link').click()")
        copies = self.wait("return document.querySelector('.live-heard').textContent.includes(arguments[0])", self.state(), seconds=10)
        self.expect(copies and not self.browser.run("return document.querySelector('a#live-link')"), f"in a frame: {self.heard()}")
        self.browser.run("document.querySelector('nav a').click()")
        self.expect(self.browser.run("return location.href").startswith("about:srcdoc") and self.cell("live-pose", "ap_mm", 1) is not None, "a link in the page takes the frame elsewhere")
        self.browser.ask("/frame", {"id": None})
        around.unlink()

    def calm(self, page):
        """Whoever wants less motion gets a step of a motion a press."""
        self.cdp("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-reduced-motion", "value": "reduce"}]})
        self.browser.ask("/url", {"url": "about:blank"})
        self.browser.ask("/url", {"url": page.as_uri()})
        self.browser.run("document.getElementById('scene-a-knee').scrollIntoView()")
        self.wait("return document.querySelector('#scene-a-knee').dataset.ready === 'yes'")
        press = "const f=document.querySelector('#scene-a-knee'), b=f.querySelector('.play'); b.click(); return [b.textContent, f.querySelector('.motion input').value]"
        first = self.browser.run(press)
        time.sleep(0.6)
        self.expect([first, self.browser.run(press)] == [["Next step", "1"], ["Next step", "2"]], f"with less motion Play gives {first} and goes on")
        self.cdp("Emulation.setEmulatedMedia", {"features": []})

    def frames(self):
        """Tells what a frame of a drag by the pointer takes, each drawn before the next. Without a graphics card the processor draws, and other programs may
        hold it: the drag ends after twenty frames or ten seconds. GENU_FRAMES sets how many frames, 60 for a measurement, which has a minute."""
        asked = os.environ.get("GENU_FRAMES")
        count, seconds = (int(asked), 60) if asked else (20, 10)
        self.press_button("[data-act='reset']")
        self.wait("return Number(document.getElementById('live').dataset.samples) > 8", seconds=120)
        self.look("patient's right")
        place = self.browser.run(TIBIA)
        drag = """const [place, count, seconds, done] = arguments, s = document.getElementById('live'), f = s.querySelector('figure'), b = view.plot.getBoundingClientRect(), out = [];
          const send = (type, dx) => view.plot.dispatchEvent(new PointerEvent(type, { bubbles: true, cancelable: true, isPrimary: true, pointerId: 1, pointerType: 'mouse', button: 0, clientX: b.left + place.x + dx, clientY: b.top + place.y }));
          const frame = () => new Promise(requestAnimationFrame), idle = async () => { do await frame(); while (s.dataset.busy || f.dataset.busy); };
          view.frame.setPointerCapture = () => {};
          (async () => { send('pointerdown', 0); send('pointermove', 10); await idle(); const gl = view.plot._fullLayout.scene._scene.glplot.gl, read = gl.readPixels; let reads = 0; gl.readPixels = (...of) => { reads++; return read.apply(gl, of); }; const begin = performance.now(); let n = 0; for (; n < count && performance.now() - begin < 1000 * seconds; n++) { const t = performance.now(); send('pointermove', 10 + n); await idle(); out.push([performance.now() - t, Number(s.dataset.ms)]); } send('pointermove', 10 + count); await idle(); const drawn = [view.rough, view.plot.data.reduce((sum, t) => sum + (t.i ? t.i.length : 0), 0), reads, gl.getContextAttributes().antialias, view.byProcessor]; gl.readPixels = read; send('pointerup', 10 + count); return [out, drawn]; })().then(done)"""
        triangles = lambda: self.browser.run("return view.plot.data.reduce((sum, t) => sum + (t.i ? t.i.length : 0), 0)")
        before, whole = self.browser.spent(), triangles()
        times, drawn = self.browser.ask("/execute/async", {"script": drag, "args": [place, count, seconds]})
        after, count = self.browser.spent(), len(times)
        for k, words in enumerate(["frame of a drag", "trial in the worker"]):
            sorted_ = sorted(t[k] for t in times)
            print(f"{words}: median {sorted_[count // 2]:.0f} ms, 95 % {sorted_[int(0.95 * count)]:.0f} ms of {count}")
        print("processor time of a frame:", ", ".join(f"{name} {1000 * (after[name] - before[name]) / count:.0f} ms" for name in after))
        print(f"drawn with fewer corners: {bool(drawn[0])}, {drawn[1]} triangles of {whole}")
        self.expect(drawn[2] == 0, f"{drawn[2]} pictures are read back while the knee is pulled at: each waits for all that was drawn")
        self.expect(not (drawn[3] and drawn[4]), "the processor draws, and smooths edges that are drawn fourfold already")
        self.expect(not drawn[4] or drawn[0], "the processor draws all corners while the knee is pulled at")
        self.expect(drawn[1] < 0.4 * whole if drawn[0] else drawn[1] == whole, f"a drag draws {drawn[1]} triangles of {whole}")
        self.expect(self.settled() and self.wait("return !document.querySelector('#live figure').dataset.busy") and triangles() == whole, f"after a drag {triangles()} triangles of {whole}")
        self.expect(abs(self.load("ap")) > 20, f"a drag of {count} frames gives {self.load('ap')} N")

    def axe(self):
        """No serious finding of axe-core on the page, light and dark; GENU_AXE names its axe.min.js, where it could be had."""
        file = os.environ.get("GENU_AXE")
        if not file:
            print("axe-core is not there: the page is not tried with it")
            return
        for scheme in ["light", "dark"]:
            self.cdp("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": scheme}]})
            self.browser.run(pathlib.Path(file).read_text())
            find = "const done=arguments[0]; axe.run(document, {resultTypes: ['violations']}).then(r => done(r.violations.map(v => [v.impact, v.id, v.nodes.length, v.nodes[0].html.slice(0, 200)])))"
            found = self.browser.ask("/execute/async", {"script": find, "args": []})
            self.expect(not [v for v in found if v[0] in ("serious", "critical")], f"axe, {scheme}: {found}")
            print(f"axe, {scheme}:", ", ".join(f"{v[1]} ({v[0]}, {v[2]})" for v in found) or "nothing")

    def cdp(self, cmd, params):
        return self.browser.ask("/goog/cdp/execute", {"cmd": cmd, "params": params})

    def broken(self):
        """A worker that breaks off in a trial is said, and the next question is answered by a new one. Intervals of an earlier state may still be asked."""
        self.browser.run("const p=Worker.prototype.postMessage; Worker.prototype.postMessage=function(m) { if (!m.request || !m.request.trial) return p.call(this, m); Worker.prototype.postMessage=p; this.onmessage({ data: { id: m.id, ms: 0, reply: { fault: 'out of memory', broken: true } } }); }")
        self.press_button("[data-preset='Dial test, 90 deg']")
        self.expect("No answer: out of memory" in self.words(), f"a broken worker is not said: {self.words()}")
        self.press_button("[data-preset='Dial test, 30 deg']")
        self.expect("external" in self.words(), f"after a broken worker: {self.words()}")

    def without(self, page):
        """Without what the solver needs the section names it and points to the stored motions."""
        for name in ["DecompressionStream", "Worker", "WebAssembly"]:
            added = self.cdp("Page.addScriptToEvaluateOnNewDocument", {"source": f"delete window.{name}"})
            self.browser.ask("/url", {"url": "about:blank"})
            self.browser.ask("/url", {"url": page.as_uri() + "#live"})
            # the words of the page stand there until its script runs
            self.wait("return document.querySelector('.live-note').textContent.includes('This browser')")
            said = self.browser.run("const n=document.querySelector('.live-note'); return [n.textContent, n.querySelector('a').getAttribute('href'), document.querySelectorAll('#live [data-preset]').length]")
            self.expect(f"has no {name}, so" in said[0] and said[1:] == ["#scene-a-knee", 0], f"without {name}: {said}")
            self.expect(self.browser.run("return !!document.getElementById('scene-a-knee')"), "the stored motions are not there")
            self.cdp("Page.removeScriptToEvaluateOnNewDocument", {"identifier": added["identifier"]})

    def shot(self, name, width, scheme):
        cdp = self.cdp
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

    def shots(self):
        """Pictures of the section at three widths, light and dark; nothing is wider than the screen."""
        for width in [400, 820, 1400]:
            for scheme in ["light", "dark"]:
                self.shot(f"live-{width}-{scheme}", width, scheme)

    def quiet(self):
        """No error on the console, nothing asked of the network."""
        for entry in self.browser.log("browser"):
            self.expect(entry["level"] != "SEVERE", f"console: {entry['message']}")
        for entry in self.browser.log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] == "Network.requestWillBeSent":
                url = message["params"]["request"]["url"]
                self.expect(url.startswith(("file:", "data:", "blob:", "about:")), f"asks the network for {url}")


def use(check, page, expected):
    browser = check.browser
    check.cdp("Page.addScriptToEvaluateOnNewDocument", CATCH)
    browser.ask("/url", {"url": page.as_uri()})
    browser.run("document.getElementById('live').scrollIntoView()")
    check.side = expected["about"]["side"]
    check.expect(check.settled(120), "the knee is not open after 120 s: " + browser.run("return document.getElementById('live').textContent.slice(0, 400)"))
    if check.faults:
        return
    print("opened after", browser.run("return document.getElementById('live').dataset.opened"), "ms")
    check.wait("return document.querySelector('#live figure').dataset.ready === 'yes'")
    about = expected["about"]
    steps = [("first_minute", expected), ("intervals", about), ("slider",), ("hand",), ("clicks", about), ("grafts", page, expected), ("decimals",), ("beyond",), ("file",),
             ("frames",), ("axe",), ("broken",), ("shots",), ("keyboard", page, expected), ("link", page), ("frame", page), ("calm", page), ("without", page), ("quiet",)]
    for name, *given in steps:
        begin = time.time()
        print(f"{name}:", flush=True)
        getattr(check, name)(*given)
        print(f"{name} took {time.time() - begin:.1f} s", flush=True)


def main(use):
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
    main(use)
