"""Pulls at the knee on the page of a plan: it begins with the plan's cuts and grafts, and goes back to them.

usage: plan.py PLAN.html EXPECTED.json SCREENSHOTS_FOLDER
EXPECTED.json: {"about": ..., "told": the answer to the plan's knee at rest}. Ends as report.py does: 0, 1 with a line a fault, 77.
"""

import html
import json
import re

import live

START = re.compile('data-start="([^"]*)"')


def more_grafts(check, page):
    """All grafts of a plan are in, however many, and its compression is borne: the page again with five grafts and 50 N."""
    text = page.read_text()
    start = json.loads(html.unescape(START.search(text)[1]))
    start["grafts"] = [{**start["grafts"][0], "name": f"g{n}"} for n in range(5)]
    start["load"][4] = 50.0
    other = check.folder / "five.html"
    other.write_text(START.sub(lambda _: f'data-start="{html.escape(json.dumps(start))}"', text, count=1))
    check.browser.ask("/url", {"url": other.as_uri()})
    check.browser.run("document.getElementById('live').scrollIntoView()")
    check.expect(check.settled(120), "five grafts: the knee is not open")
    names = check.browser.run("return [...document.querySelectorAll('#live-ligaments [data-graft] th')].map(h => h.textContent)")
    check.expect(names == [f"g{n}" for n in range(5)] and check.load("si") == 50, f"of five grafts and 50 N there are {names} and {check.load('si')} N")
    check.press_button("[data-preset='Lachman']")
    check.expect(check.load("si") == 50 and check.load("ap") == 133, f"a test on a plan of 50 N gives {check.state()}")
    other.unlink()


def use(check, page, expected):
    browser, about, told = check.browser, expected["about"], expected["told"]
    check.cdp("Page.addScriptToEvaluateOnNewDocument", live.CATCH)
    browser.ask("/url", {"url": page.as_uri()})
    browser.run("document.getElementById('live').scrollIntoView()")
    check.expect(check.settled(120), "the knee is not open after 120 s: " + browser.run("return document.getElementById('live').textContent.slice(0, 400)"))
    if check.faults:
        return
    check.wait("return document.querySelector('#live figure').dataset.ready === 'yes'")
    force = lambda: check.cell("live-ligaments", "graft0", 1)
    check.says(told, about, "as planned")
    check.expect(abs(force() - told["forces_n"][-1]) <= live.SHOWN["force"], f"the graft bears {force()}, expected {told['forces_n'][-1]}")
    # rest is this knee without load, with its cuts and grafts: the page counts from where its tables do
    check.press_button("[data-preset='At rest']")
    rest = check.cell("live-pose", "ap_mm", 1)
    off = max(abs(check.cell("live-pose", name, 4)) for name in ["ap_mm", "ie_deg", "ml_mm"])
    check.expect(check.cell("live-pose", "ap_mm", 3) == 0 and off > 0.05, f"the planned knee at rest is not at its own rest, or lies as the intact one: {off}")
    check.press_button("[data-preset='Lachman']")
    gone = check.cell("live-pose", "ap_mm", 1) - rest
    check.expect(gone > 0.1 and abs(check.cell("live-pose", "ap_mm", 3) - gone) <= 2 * live.SHOWN["pose"], f"from rest the page tells {check.cell('live-pose', 'ap_mm', 3)} mm, its poses {gone}")
    check.expect(force() > told["forces_n"][-1] + 5, f"under Lachman the graft bears {force()}")
    check.press_button("[data-take='0']")
    check.expect("graft" not in check.state(), "a graft that was taken out is in")
    check.press_button("[data-act='reset']")
    check.says(told, about, "after Reset")
    said = browser.run("return [document.querySelector('.live-said').textContent, !!document.querySelector('[data-unasked]')]")
    check.expect(("No samples were asked for" in said[0]) == said[1], f"of samples it is said: {said}")
    # below the knee's middle lies the tibia, above it the femur [mm]
    at = "const p = liveHand.project(view, [0, 0, arguments[0]]); return (liveHand.bone(view, p.x, p.y) || {}).name"
    bones = [browser.run(at, z) for z in (-30, 40)]
    check.expect(bones == ["tibia", "femur"], f"the bones in the picture are {bones}")
    for width, scheme in [(400, "light"), (1400, "dark")]:
        check.shot(f"plan-{width}-{scheme}", width, scheme)
    check.axe()
    more_grafts(check, page)
    check.quiet()


if __name__ == "__main__":
    live.main(use)
