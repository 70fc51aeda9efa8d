#!/usr/bin/env python3
"""Opens a report page in headless Chromium on the wall clock: the mode shape moves, rests where the reader
wants no motion, and the page is used with the keyboard alone.

    check_motion.py --sample REPORT_SAMPLE --work DIRECTORY

Prints frames a second, time of the first paint and size. Exit code 77 (skipped) when there is no Chromium and
STAGEID_REQUIRE_BROWSER is not set.
"""

import subprocess
import sys

from page_checks import expect, open_page, run

SHAPES = "window.stageidReport.shapes"
SHOW = "document.getElementById('shape-plot').scrollIntoView({block: 'center'})"


def check_motion(page):
    browser = open_page(page)
    browser.evaluate(SHOW)
    expect(browser.wait_for(f"{SHAPES}.frames > 5"), "the mode shape does not move")
    rate = browser.evaluate(f"""new Promise((done) => {{ const first = {SHAPES}.frames, start = performance.now();
        setTimeout(() => done(1000 * ({SHAPES}.frames - first) / (performance.now() - start)), 1500); }})""")
    paint = browser.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")
    print(f"{page.stat().st_size / 1e6:.2f} MB, first paint after {paint:.0f} ms, animation at {rate:.0f} frames/s")
    browser.evaluate("document.getElementById('shape-play').click()")
    before = browser.evaluate(f"(async () => {{ await new Promise(requestAnimationFrame); return {SHAPES}.frames; }})()")
    after = browser.evaluate(f"(async () => {{ for (let i = 0; i < 5; ++i) await new Promise(requestAnimationFrame); return {SHAPES}.frames; }})()")
    expect(after == before, f"paused, it draws {after - before} frames")
    expect(browser.problems == [], f"console: {browser.problems}")
    browser.close()


def check_stillness(page):
    browser = open_page(page, still=True)
    browser.evaluate(SHOW)
    browser.evaluate("(async () => { for (let i = 0; i < 10; ++i) await new Promise(requestAnimationFrame); })()")
    expect(browser.evaluate(f"{SHAPES}.frames") == 0, "it moves although the reader wants no motion")
    browser.evaluate("document.getElementById('shape-play').click()")
    expect(browser.wait_for(f"{SHAPES}.frames > 3"), "it does not move when asked to")
    browser.close()


def check_keyboard(page):
    """The first stop of the Tab key skips to the plots; every control and figure has a name that can be read out."""
    browser = open_page(page)
    browser.press("Tab")
    expect(browser.evaluate("document.activeElement.className") == "skip", "the first stop is not the way past the head")
    browser.press("Enter")
    expect(browser.evaluate("document.activeElement.id") == "main", "the way past the head leads nowhere")
    browser.press("Tab")
    expect(browser.evaluate("document.getElementById('main').contains(document.activeElement)"), "after the head comes no plot")
    nameless = browser.evaluate("""Array.from(document.querySelectorAll('button, select, input, a, [role=img], [role=group]')).filter((e) => e.offsetParent !== null).filter((e) => {
        const label = e.getAttribute('aria-label') || e.textContent.trim() || (e.labels && e.labels.length && e.labels[0].textContent.trim())
            || (e.getAttribute('aria-labelledby') || '').split(' ').filter(Boolean).every((id) => document.getElementById(id)) && e.getAttribute('aria-labelledby');
        return !label; }).map((e) => e.outerHTML.slice(0, 120))""")
    expect(nameless == [], f"without a name: {nameless}")
    stops = browser.evaluate("document.querySelectorAll('.panel[tabindex=\"0\"]').length")
    expect(stops == 1, f"the matrix has {stops} stops of the Tab key instead of one")
    browser.close()


def checks(sample, work):
    subprocess.run([sample, work, "full"], check=True)
    check_motion(work / "report.html")
    check_stillness(work / "report.html")
    check_keyboard(work / "report.html")


if __name__ == "__main__":
    sys.exit(run(__doc__, checks))
