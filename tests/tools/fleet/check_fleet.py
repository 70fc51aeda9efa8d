"""The page of a fleet in a browser: its numbers are those of the store, at 1280 and 390 pixels without an error.

    check_fleet.py PROGRAM CONFIGS WORK_DIR
"""
import json
import pathlib
import re
import shutil
import sqlite3
import subprocess
import sys
from urllib.parse import unquote, urlparse

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "dashboard"))
from browser import Browser, expect, find_browser, skipped, verdict

READY = "document.readyState === 'complete' && window.stageidFleet.among.graph !== null"


def make_page(program, configs, work):
    """Four logs of two stages, and a corrupt one; a report in a folder below."""
    shutil.rmtree(work, ignore_errors=True)
    (work / "pages").mkdir(parents=True)

    def call(*words, wanted=0):
        done = subprocess.run([program, *map(str, words)], cwd=work, capture_output=True, text=True)
        if done.returncode != wanted:
            sys.exit(f"{words}: {done.returncode}\n{done.stderr}")

    experiment = (configs / "experiment" / "small_stage.yaml").read_text().replace("../stage", str(configs / "stage"))
    table = "log,stage,time_utc\n"
    for seed in range(4):
        (work / "experiment.yaml").write_text(re.sub(r"seed: \d+", f"seed: {seed}", experiment))
        call("run", "experiment.yaml", "-o", f"{seed}.slog")
        table += f"{seed}.slog,<b>stage {seed % 2}</b>,2026-01-0{seed + 1}T06:00:00Z\n"
    (work / "4.slog").write_bytes((work / "0.slog").read_bytes()[:50000])
    (work / "logs.csv").write_text(table + "4.slog,<b>stage 0</b>,2026-01-09T06:00:00Z\n")
    (work / "fleet.yaml").write_text("format: stageid-fleet\ntable: logs.csv\nresults: 'all #results'\nidentification: "
                                     "{fit: {rigid_body: suspension, suspension_hz: [0.4, 0.5], direct_term: full}}\n")
    call("fleet", "fleet.yaml", wanted=1)
    call("fleet", "report", "fleet.db", "-o", "pages/fleet.html")
    return work / "pages" / "fleet.html"


def check_numbers(browser, work):
    store = sqlite3.connect(work / "fleet.db")
    for index, (name,) in enumerate(store.execute("SELECT name FROM stage ORDER BY name").fetchall()):
        shown = json.loads(browser.evaluate(
            f"JSON.stringify((() => {{ const stage = stageidFleet.content.stages[{index}]; return {{name: stage.name, "
            "tracks: stage.tracks.map((track) => [track.mode, stageidFleet.valuesOf(stage, track)])}; })())"))
        expect(shown["name"] == name, f"stage {shown['name']}, not {name}")
        for mode, values in shown["tracks"]:
            stored = store.execute("SELECT frequency_hz, frequency_std_hz FROM modes WHERE stage = ? AND mode = ? "
                                   "ORDER BY time_utc", (name, mode)).fetchall()
            values = [value for value in values if value]
            expect(len(values) == len(stored) > 0, f"mode {mode} of {name}: {len(values)} of {len(stored)} values")
            for (hz, std), (stored_hz, stored_std) in zip(values, stored):
                # Rounded to a third of a standard deviation, or 1/30000 of the range.
                expect(abs(hz - stored_hz) <= (stored_std or 0) / 3 + 1e-4 * abs(stored_hz), f"{hz} for {stored_hz} Hz")
                expect(abs(std - (stored_std or 0)) <= 0.05 * (stored_std or 0), f"{std} for {stored_std} Hz")


def check_links(browser, page, work):
    links = json.loads(browser.evaluate("JSON.stringify(Array.from(document.querySelectorAll('#outliers td a'), (a) => a.href))"))
    addresses = json.loads(browser.evaluate(
        "JSON.stringify(Array.from({length: 5}, (_, i) => stageidFleet.reportOf(i)).map((a) => a && new URL(a, location).pathname))"))
    reports = [pathlib.Path(unquote(address)) for address in addresses if address]
    expect(len(reports) == 4 and all(report.exists() for report in reports), f"reports {addresses}")
    expect(all(pathlib.Path(unquote(urlparse(link).path)).exists() for link in links), f"links {links}")
    text = browser.evaluate("document.getElementById('outliers').textContent")
    expect("failed: 4.slog: damaged at byte" in text, text)


def check_click(browser, work):
    """Opens the report of the first day of the shown stage."""
    browser.evaluate("(() => { window.opened = []; HTMLAnchorElement.prototype.click = function () { opened.push(this.href); }; "
                     "document.getElementById('modes-plot').scrollIntoView({ block: 'center' }); })()")
    x, y = json.loads(browser.evaluate(
        "JSON.stringify((() => { const box = document.getElementById('modes-plot').getBoundingClientRect(); "
        "return [box.x + 0.2 * box.width, box.y + 0.5 * box.height]; })())"))
    for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
        browser.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="none" if kind == "mouseMoved" else "left", clickCount=1)
    expect(browser.wait_for("opened.length === 1", 5), "a click opens nothing")
    opened = pathlib.Path(unquote(urlparse(browser.evaluate("opened[0] || ''")).path))
    job = opened.parent.name
    store = sqlite3.connect(work / "fleet.db")
    expect(store.execute("SELECT time_utc FROM identification WHERE job LIKE ?", (job + "%",)).fetchall() ==
           [("2026-01-02T06:00:00Z",)] and opened.exists(), f"a click opens {opened}")


def check_width(page, work, width):
    browser = Browser(find_browser())
    browser.resize(width, 1000)
    browser.call("Page.navigate", url=f"file://{page}")
    expect(browser.wait_for(READY, 60), f"{width}: the page does not come up")
    check_numbers(browser, work)
    check_links(browser, page, work)
    expect(browser.evaluate("document.querySelector('#modes option').textContent") == "<b>stage 0</b>", "names are text")
    expect(browser.evaluate("document.querySelectorAll('#main b').length") == 0, "names are not HTML")
    browser.evaluate("stageidFleet.showStage(1)")
    expect(browser.evaluate("stageidFleet.over.graph.numRows()") == 2, "two days of the second stage")
    check_click(browser, work)
    browser.evaluate("(() => { const pick = document.getElementById('mode'); pick.value = '2'; "
                     "pick.dispatchEvent(new Event('change')); })()")
    expect(browser.evaluate("stageidFleet.over.graph.numColumns()") == 2, "one mode is shown alone")
    expect(browser.evaluate("JSON.stringify(stageidFleet.errors)") == "[]", browser.evaluate("JSON.stringify(stageidFleet.errors)"))
    expect(not browser.problems, browser.problems)
    browser.close()


def check_look(page, work):
    """At all widths, light and dark, and with the keyboard."""
    browser = Browser(find_browser())
    browser.resize(1280, 1000)
    browser.call("Page.navigate", url=f"file://{page}")
    expect(browser.wait_for(READY, 60), "the page does not come up")
    browser.check_tab("fleet")
    browser.check_widths(work, "fleet", 1000)
    expect(not browser.problems, browser.problems)
    browser.close()


if __name__ == "__main__":
    if find_browser() is None:
        sys.exit(skipped("no Chromium found; install it with: apt-get install --no-install-recommends chromium"))
    work = pathlib.Path(sys.argv[3]).resolve()
    page = make_page(sys.argv[1], pathlib.Path(sys.argv[2]).resolve(), work)
    for width in (1280, 390):
        check_width(page, work, width)
    check_look(page, work)
    sys.exit(verdict())
