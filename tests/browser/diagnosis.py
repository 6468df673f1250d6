"""Pulls at the knee on the page of a diagnosis: its answers are those of the model that the diagnosis leaves.

usage: diagnosis.py REPORT.html EXPECTED.json SCREENSHOTS_FOLDER
EXPECTED.json: {"about": ..., "rest": the answer at 30 deg, "lachman": the answer to a Lachman test}. Ends as report.py does: 0, 1 with a line a fault, 77.
"""

import live


def use(check, page, expected):
    browser, about = check.browser, expected["about"]
    check.cdp("Page.addScriptToEvaluateOnNewDocument", live.CATCH)
    browser.ask("/url", {"url": page.as_uri()})
    browser.run("document.getElementById('live').scrollIntoView()")
    check.expect(check.settled(120), "the knee is not open after 120 s: " + browser.run("return document.getElementById('live').textContent.slice(0, 400)"))
    if check.faults:
        return
    check.says(expected["rest"], about, "at rest")
    check.press_button("[data-preset='Lachman']")
    check.says(expected["lachman"], about, "Lachman")
    verdict = browser.run("return document.querySelector('.diagnosis').shadowRoot.querySelector('.verdict').textContent")
    check.expect(len(verdict) > 20, f"the diagnosis is not on the page: {verdict}")
    for width, scheme in [(400, "light"), (1400, "dark")]:
        check.shot(f"diagnosis-{width}-{scheme}", width, scheme)
    check.axe()
    check.quiet()


if __name__ == "__main__":
    live.main(use)
