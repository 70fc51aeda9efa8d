"""What the checks of a report page in the browser of ../dashboard have in common."""

import argparse
import os
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "dashboard"))
from browser import find_browser

failures = []


def expect(condition, message):
    if not condition:
        failures.append(message)


def run(description, checks):
    """Calls checks(sample, work) with the program that writes pages and a directory; returns an exit code."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sample", required=True, help="program that writes the page")
    parser.add_argument("--work", required=True, type=pathlib.Path)
    options = parser.parse_args()
    if find_browser() is None:
        print("no Chromium found; install it with: apt-get install --no-install-recommends chromium")
        return 1 if os.environ.get("STAGEID_REQUIRE_BROWSER") else 77
    checks(options.sample, options.work.resolve())
    for failure in failures:
        print("FAILED:", failure)
    return 1 if failures else 0
