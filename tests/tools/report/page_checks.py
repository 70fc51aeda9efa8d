"""What the checks of a report page in the browser of ../dashboard have in common."""

import argparse
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "dashboard"))
from browser import Browser, expect, find_browser, skipped, verdict

READY = "document.readyState === 'complete' && window.stageidReport.shapes.figure !== null"


def open_page(page, width=1280, ready=READY, still=False):
    """A browser that shows the page, from the moment that it is ready on."""
    browser = Browser(find_browser())
    browser.resize(width, 1000)
    browser.call("Emulation.setEmulatedMedia",
                 features=[{"name": "prefers-reduced-motion", "value": "reduce" if still else "no-preference"}])
    browser.call("Page.navigate", url=f"file://{page}")
    expect(browser.wait_for(ready, 900), "the page does not come up")
    return browser


def run(description, checks, **options):
    """Calls checks(sample, work, ...) with the program that writes pages and a directory; returns an exit code."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sample", required=True, help="program that writes the page")
    parser.add_argument("--work", required=True, type=pathlib.Path)
    for name, default in options.items():
        parser.add_argument(f"--{name}", default=default)
    words = vars(parser.parse_args())
    words["work"] = words["work"].resolve()
    if find_browser() is None:
        return skipped("no Chromium found; install it with: apt-get install --no-install-recommends chromium")
    checks(**words)
    return verdict()
