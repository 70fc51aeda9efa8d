#!/usr/bin/env python3
"""Opens report pages of 50 x 50 and 400 x 10 channels in headless Chromium: only panels near the visible part are drawn,
names remain visible, channels are found, the page remains within its window.

    check_size.py --sample REPORT_SAMPLE --work DIRECTORY

Exit code 77 (skipped) when there is no Chromium and STAGEID_REQUIRE_BROWSER is not set.
"""

import subprocess
import sys

from page_checks import expect, open_page, run

MOST_DRAWN = 500  # of 2500 panels
PAUSE = "new Promise((done) => setTimeout(done, 300))"
DRAWN = "document.querySelectorAll('.panel canvas').length"
# For the panel in the middle of the matrix: whether it is drawn, and whether the names of its row and column are seen.
MIDDLE = """(() => { const box = document.querySelector('.matrix-scroll').getBoundingClientRect();
  const at = (x, y) => document.elementFromPoint(x, y);
  const panel = at((box.left + box.right) / 2, (box.top + box.bottom) / 2).closest('.panel');
  const seen = (kind, place) => { const name = document.querySelector(`.${kind}[style="${place}:${panel.style.getPropertyValue(place)}"]`);
    const b = name.getBoundingClientRect(); return name.contains(at((b.left + b.right) / 2, (b.top + b.bottom) / 2)) && name.textContent; };
  return { panel: panel.title, drawn: Boolean(panel.querySelector('canvas')), names: [seen('output-name', '--o'), seen('input-name', '--i')] }; })()"""


def check_drawn(browser, when, least=20):
    browser.evaluate(PAUSE)
    drawn = browser.evaluate(DRAWN)
    expect(least <= drawn <= MOST_DRAWN, f"{when}: {drawn} panels are drawn")


def check_matrix(browser):
    expect(browser.evaluate("document.querySelectorAll('.panel').length") == 2500, "panels of the matrix")
    for width in (1280, 390):
        browser.resize(width, 1000)
        browser.evaluate("document.querySelector('.matrix-scroll').scrollIntoView({ block: 'center' }); " + PAUSE)
        for x, y in ((0, 0), (1500, 1700)):
            browser.evaluate(f"document.querySelector('.matrix-scroll').scrollTo({x}, {y})")
            check_drawn(browser, f"scrolled to {x}, {y} at {width} pixels")
            middle = browser.evaluate(MIDDLE)
            expect(middle["drawn"] and " \u2190 ".join(map(str, middle["names"])) == middle["panel"], f"{width} pixels: {middle}")
    band = browser.evaluate("document.querySelector('.band-text').textContent")
    browser.evaluate("document.querySelector('#response [title=\"Zoom in\"]').click()")
    check_drawn(browser, "zoomed")
    expect(browser.evaluate("document.querySelector('.band-text').textContent") != band, "no zoom")
    browser.evaluate("dispatchEvent(new Event('beforeprint'))")
    expect(browser.evaluate(DRAWN) == 2500, "panels are missing on paper")
    browser.evaluate("dispatchEvent(new Event('afterprint'))")
    check_drawn(browser, "after printing")
    browser.evaluate("document.getElementById('provenance').scrollIntoView()")
    check_drawn(browser, "out of sight", 0)
    expect(browser.evaluate(DRAWN) == 0, "panels out of sight are drawn")


TITLES = "Array.from(document.querySelectorAll('.panel'), (panel) => panel.title)"


def check_list(browser):
    expect(browser.evaluate(TITLES)[59:] == ["z60 \u2190 az1"], "a page of the list")
    browser.evaluate("document.getElementById('matrix-search').focus()")
    browser.call("Input.insertText", text="az3 Z12")
    expect(browser.evaluate(TITLES) == [f"z{n} \u2190 az3" for n in (12, *range(120, 130))], "what was searched for")
    for _ in range(3):
        browser.press("Tab")
    expect(browser.evaluate("document.activeElement.title") == "z12 \u2190 az3", "Tab leads to the first panel")
    browser.press("ArrowRight")
    browser.press("Enter")
    expect(browser.evaluate("document.getElementById('entry-title').textContent") == "z120 \u2190 az3", "a panel of the list is chosen")
    expect(browser.evaluate("document.querySelector('.panel[aria-pressed=true]').title") == "z120 \u2190 az3", "the panel is pressed")


def checks(sample, work):
    for kind, check in (("large", check_matrix), ("list", check_list)):
        subprocess.run([sample, work / kind, kind], check=True)
        browser = open_page(work / kind / "report.html", still=True)
        check(browser)
        browser.check_widths(work, kind, 1000, accessible=False)
        browser.check_accessibility(kind)
        expect(browser.problems == [], f"console: {browser.problems}")
        expect(browser.evaluate("window.stageidReport.errors") == [], "errors on the page")
        browser.close()


if __name__ == "__main__":
    sys.exit(run(__doc__, checks))
