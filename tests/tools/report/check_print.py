#!/usr/bin/env python3
"""Prints a report page in headless Chromium: the first page holds the matrix, and no page is wasted.

    check_print.py --sample REPORT_SAMPLE --work DIRECTORY

Exit code 77 (skipped) when there is no Chromium and STAGEID_REQUIRE_BROWSER is not set.
"""

import base64
import re
import subprocess
import sys
import zlib

from page_checks import expect, open_page, run

LEAST_SEGMENTS = 4 * 13 * 100  # of the curves of the matrix
MOST_PAGES = {"full": 9, "full_compared": 10}
A4, LETTER = (8.27, 11.69), (8.5, 11.0)  # inches, before they are turned

def printed(browser, paper, pages=""):
    """The PDF of that paper, landscape, with the page's own margins."""
    margins = dict.fromkeys(("marginTop", "marginBottom", "marginLeft", "marginRight"), 12 / 25.4)
    return base64.b64decode(browser.call("Page.printToPDF", printBackground=True, landscape=True, paperWidth=paper[0],
                                         paperHeight=paper[1], pageRanges=pages, **margins)["data"])


def page_count(pdf):
    return len(re.findall(rb"/Type\s*/Page\b", pdf))


def line_segments(pdf):
    """Operators l (PDF 32000-1, 8.5.2.1) in all streams that are deflated."""
    total = 0
    for stream in re.findall(rb"stream\r?\n(.*?)endstream", pdf, re.DOTALL):
        try:
            total += len(re.findall(rb" l\n", zlib.decompress(stream)))
        except zlib.error:
            continue  # a font or a picture
    return total


def check_paper(page, kind, paper, work):
    browser = open_page(page)
    pdf = printed(browser, paper)
    (work / f"{kind}_{paper[0]}.pdf").write_bytes(pdf)
    pages, drawn = page_count(pdf), line_segments(printed(browser, paper, "1"))
    print(f"{kind} on {paper}: {pages} pages, {drawn} line segments on the first")
    expect(0 < pages <= MOST_PAGES[kind], f"{kind} on {paper}: {pages} pages instead of at most {MOST_PAGES[kind]}")
    expect(drawn >= LEAST_SEGMENTS, f"{kind} on {paper}: {drawn} line segments on the first page: the matrix is not on it")
    expect(browser.problems == [], f"console: {browser.problems}")
    browser.close()


def checks(sample, work):
    for kind in MOST_PAGES:
        subprocess.run([sample, work / kind, kind], check=True)
    for kind, paper in (("full", A4), ("full", LETTER), ("full_compared", A4)):
        check_paper(work / kind / "report.html", kind, paper, work)


if __name__ == "__main__":
    sys.exit(run(__doc__, checks))
