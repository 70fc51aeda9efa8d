#!/usr/bin/env python3
"""Size, first paint and frame rate of a report page in headless Chromium on the wall clock.

    report_page.py REPORT.html [TIMES]

The page of 4 x 13 x 4000 lines: build/release/tests/tools/report_sample DIRECTORY full
Prints medians over TIMES (5) fresh browsers: first contentful paint, all sections built, frames a second of the
mode shape. The browser's own entries, from the start of the navigation.
"""

import pathlib
import statistics
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "tools/dashboard"))
from browser import Browser, find_browser

SHAPES = "window.stageidReport.shapes"


def measure(page):
    browser = Browser(find_browser())
    browser.resize(1280, 1000)
    browser.call("Page.navigate", url=f"file://{page}")
    browser.wait_for("document.readyState === 'complete' && performance.getEntriesByName('first-contentful-paint').length > 0")
    paint = browser.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")
    built = browser.evaluate("performance.getEntriesByType('navigation')[0].domComplete")
    rate = 0.0
    if browser.evaluate(f"Boolean({SHAPES} && {SHAPES}.figure)"):
        browser.evaluate("document.getElementById('shape-plot').scrollIntoView({block: 'center'})")
        browser.wait_for(f"{SHAPES}.frames > 10")
        rate = browser.evaluate(f"""new Promise((done) => {{ const first = {SHAPES}.frames, start = performance.now();
            setTimeout(() => done(1000 * ({SHAPES}.frames - first) / (performance.now() - start)), 2000); }})""")
    browser.close()
    return paint, built, rate


def main():
    page = pathlib.Path(sys.argv[1]).resolve()
    times = int(sys.argv[2]) if len(sys.argv) > 2 else 5
    paint, built, rate = (statistics.median(values) for values in zip(*(measure(page) for _ in range(times))))
    print(f"{page.stat().st_size / 1e6:.2f} MB, first paint {paint:.0f} ms, built {built:.0f} ms, {rate:.0f} frames/s")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main()
