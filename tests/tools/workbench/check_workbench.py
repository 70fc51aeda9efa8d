#!/usr/bin/env python3
"""Drives the workbench in headless Chromium: opens a result, adds a mode, removes one, changes the band, undoes,
compares, saves; the saved model has the bytes of the printed command line.

    check_workbench.py PROGRAM CONFIGS GUIDE WORK

Prints how long the answers took beside a fit on the command line; nothing depends on that. Exit code 77 (skipped)
when there is no Chromium and STAGEID_REQUIRE_BROWSER is not set.
"""

import pathlib
import shlex
import shutil
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "dashboard"))
from browser import Browser, expect, find_browser, skipped, verdict
from open_program import OpenProgram, identify

PAGE = "window.stageidReport"


class Workbench:
    """The page, as a user has it."""

    def __init__(self, url):
        self.browser = Browser(find_browser())
        self.browser.resize(1280, 1000)
        self.browser.call("Page.navigate", url=url)
        expect(self.browser.wait_for(f"{PAGE}.bench.edition >= 1"), "the page does not come up")
        self.times = {}

    def get(self, script):
        return self.browser.evaluate(script)

    def state(self):
        return self.get(f"{PAGE}.bench.state")

    def current(self):
        state = self.state()
        return state["states"][state["index"]]

    def modes(self):
        return self.get(f"({PAGE}.content.modes || []).map((mode) => mode.frequency_hz).filter(Boolean)")

    def mouse(self, kind, x, y, buttons=0):
        self.browser.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left" if kind != "mouseMoved" else "none",
                          buttons=buttons, clickCount=1)

    def place(self, selector, x=None, y=None):
        """Scrolls to an element; the place on the screen of a point in it, by default its centre."""
        box = self.get(f"(() => {{ const e = document.querySelector('{selector}'); e.scrollIntoView({{ block: 'center' }}); "
                       "const b = e.getBoundingClientRect(); return [b.left, b.top, b.width, b.height]; })()")
        return box[0] + (box[2] / 2 if x is None else x), box[1] + (box[3] / 2 if y is None else y)

    def click(self, selector, x=None, y=None):
        at = self.place(selector, x, y)
        self.mouse("mouseMoved", *at)
        self.mouse("mousePressed", *at, buttons=1)
        self.mouse("mouseReleased", *at)

    def drag(self, selector, x0, x1, y):
        begin = self.place(selector, x0, y)
        self.mouse("mouseMoved", *begin)
        self.mouse("mousePressed", *begin, buttons=1)
        for step in (0.3, 0.7, 1.0):
            self.mouse("mouseMoved", begin[0] + step * (x1 - x0), begin[1], buttons=1)
        self.mouse("mouseReleased", begin[0] + x1 - x0, begin[1])

    def answered(self, name, command_of=None):
        """Waits until the fit of a new state is done and shown."""
        begin, stages = time.monotonic(), {}
        before = command_of
        for _ in range(6000):
            state = self.state()
            stage = state["states"][state["index"]]["stage"]
            if state["command"] != before:
                stages.setdefault(stage, time.monotonic() - begin)
                if state["state"] == "ready":
                    break
            time.sleep(0.01)
        else:
            expect(False, f"{name}: no answer: {state}")
        expect(self.browser.wait_for(f"{PAGE}.bench.edition >= {state['edition']} && {PAGE}.bench.stage === 'refined'"),
               f"{name}: the results are not shown")
        self.times[name] = stages
        return state


def edit(bench, name, action):
    before = bench.state()["command"]
    action()
    return bench.answered(name, before)


def diagram_point(bench, hz, order):
    return bench.get(f"(() => {{ const f = {PAGE}.diagramFrame(); return [f.x({hz}), f.y({order})]; }})()")


def check_edits(bench):
    plot = "#stabilization-plot"
    modes = bench.modes()
    target = min(modes, key=lambda hz: abs(hz - 422))
    x, y = diagram_point(bench, target, 3)
    edit(bench, "remove", lambda: bench.click(plot, x, y))
    expect(len(bench.modes()) == len(modes) - 1, f"a click on the line removed {len(modes) - len(bench.modes())} modes")
    expect(min(abs(hz - target) for hz in bench.modes()) > 5, "another mode was removed")
    expect("removed 422" in bench.current()["what"], f"history: {bench.current()}")

    pole = bench.get(f"{PAGE}.content.stabilization.filter((p) => p[3] === 2 && Math.abs(p[1] - {target}) < 1).pop()")
    x, y = diagram_point(bench, pole[1], pole[0])
    edit(bench, "add", lambda: bench.click(plot, x, y))
    expect(len(bench.modes()) == len(modes), "a click on a pole did not add a mode")
    expect(min(abs(hz - target) for hz in bench.modes()) < 0.1, f"the mode is not where it was: {bench.modes()}")

    x0, y = diagram_point(bench, 40, 20)
    x1, _ = diagram_point(bench, 700, 20)
    state = edit(bench, "band", lambda: bench.drag(plot, x0, x1, y))
    low, high = state["controls"]["band_hz"]
    expect(39 < low < 41 and 690 < high < 710, f"the band is {low} to {high} Hz")
    expect(bench.get("document.querySelectorAll('.outside').length") == 2, "the lines that are not fitted are not shaded")

    with_band, cost = state["command"], bench.current()["cost"]
    state = edit(bench, "undo", lambda: bench.click("#undo"))
    expect(state["controls"]["band_hz"] is None and "--band" not in state["command"], "undo left the band")
    state = edit(bench, "redo", lambda: bench.click("#redo"))
    expect(state["command"] == with_band and bench.current()["cost"] == cost, "redo made another fit")

    state = edit(bench, "option", lambda: bench.get("(() => { const s = document.getElementById('option-damping'); s.value = 'general'; "
                                                    "s.dispatchEvent(new Event('change')); })()"))
    expect("--damping general" in state["command"], f"the option is not in the command: {state['command']}")
    edit(bench, "undo again", lambda: bench.click("#undo"))


def check_numbers(bench):
    """What the page draws of the model is what the newest results contain; the residual is their difference."""
    errors = bench.get(f"""(() => {{ const c = {PAGE}.channelCurves(0), a = {PAGE}.array; let worst = 0;
      const g = a('response'), p = a('model_response'), r = a('residual');
      for (let i = 0; i < g.length; ++i) worst = Math.max(worst, Math.abs(g[i] - p[i] - r[i]));
      return [worst, c.model.length, c.relativeError]; }})()""")
    expect(errors[0] == 0 and errors[1] > 100 and 0 < errors[2] < 0.2, f"residual, lines, error: {errors}")


def check_band_and_loop(bench):
    """What follows from the covariance of a fit comes after the fit itself."""
    def text(selector):
        return bench.get(f"(document.querySelector('{selector}') || {{ textContent: '' }}).textContent")
    expect(bench.browser.wait_for(f"{PAGE}.channelCurves(0).modelDeviation && /\u00b1/.test(document.querySelector('#loop').textContent)"),
           f"no band of the model, or no discs of the loop: {text('#loop')[:200]}")
    radius = bench.get(f"{PAGE}.content.loop.loops[0].phase_margin_deg.radius_95")
    expect(radius > 0, f"the phase margin has the radius {radius}")
    expect("model" in text("#entry-legend"), "the model is not in the legend")


def check_comparison(bench):
    rows = bench.get("document.querySelectorAll('#trend-table tbody tr').length")
    expect(rows == 2, f"{rows} rows of trends instead of the other day and this fit")
    trend = bench.get(f"{PAGE}.trendRows('frequency_hz').map((row) => [row.title, row.value, row.half, row.pair && row.pair.frequency_deviation])")
    expect(trend[0][0] == "day2" and trend[0][2] > 0 and abs(trend[0][3]) < 6, f"trend of one plant: {trend}")
    edition = bench.state()["edition"]
    bench.get("(() => { const s = document.getElementById('compare-with'); s.value = '0'; s.dispatchEvent(new Event('change')); })()")
    expect(bench.browser.wait_for(f"{PAGE}.bench.edition > {edition} && !!document.getElementById('comparison')"), "no comparison")
    expect(bench.get(f"!!{PAGE}.channelCurves(0).other && !!{PAGE}.channelCurves(0).otherModel"), "no curves of the other day")
    expect("day2" in bench.get("document.getElementById('entry-legend').textContent"), "the other day is not in the legend")


def check_matrix(bench):
    """A drag across a panel zooms all figures, as in the report."""
    before = bench.get("document.querySelector('.band-text').textContent")
    bench.drag(".panel", 20, 80, 40)
    expect(bench.get("document.querySelector('.band-text').textContent") != before, "a drag across a panel does not zoom")
    bench.get("Array.from(document.querySelectorAll('.band-bar button')).pop().click()")


def check_cursor_and_provenance(bench):
    at = bench.place("#entry-magnitude")
    bench.mouse("mouseMoved", *at)
    hz = bench.get(f"{PAGE}.bench.cursor")
    expect(hz is not None and hz > 0, "no cursor")
    lit = bench.get("['entry-phase', 'cmif-plot', 'stabilization-plot'].filter((id) => document.querySelector('#' + id + '.cursor, #' + id + ' .cursor'))")
    expect(len(lit) == 3, f"the cursor is in {lit} only")
    panels = bench.get("document.querySelectorAll('.panel.cursor').length")
    expect(panels == 6, f"the cursor is in {panels} panels of the matrix")
    expect("Hz" in bench.get("document.getElementById('entry-values').textContent"), "no values at the cursor")
    low, high = bench.get(f"(() => {{ const p = {PAGE}; return p.nyquistShown(); }})()")
    x, _ = diagram_point(bench, (low * high) ** 0.5, 20)
    bench.mouse("mouseMoved", *bench.place("#stabilization-plot", x, 60))
    expect(bench.get("!!document.querySelector('#entry-nyquist.cursor-point')"), "no point in the complex plane")

    bench.mouse("mouseMoved", *bench.place("#modes td:nth-child(2)"))
    title = bench.get("document.querySelector('#modes td:nth-child(2)').title")
    for part in ("frf.h5", "stageid fit", "realization"):
        expect(part in title, f"'{part}' is not in the provenance of a number: {title}")


def check_sentences(bench, guide):
    text = " ".join(guide.read_text().split())
    sentences = bench.get("Array.from(document.querySelectorAll('.fit-options .quiet'), (e) => e.textContent)")
    expect(len(sentences) == 6, f"{len(sentences)} sentences beside the options")
    for sentence in sentences:
        expect(sentence in text, f"not in the guide: {sentence}")


def check_save(program, bench, work):
    bench.place("#save-name")
    bench.get("document.getElementById('save-name').value = 'edited'")
    bench.click("#save-form button")
    expect(bench.browser.wait_for(f"{PAGE}.bench.state.command.includes('edited.json')"), "the model was not saved")
    command = shlex.split(bench.get("document.getElementById('command').textContent"))
    saved = work / "saved" / "edited.json"
    expect(command[:2] == ["stageid", "fit"] and command[4] == str(saved), f"the command is {command}")
    command[0], command[4] = program, str(work / "by_command.json")
    begin = time.monotonic()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    seconds = time.monotonic() - begin
    expect(done.returncode in (0, 3), f"{command}: {done.returncode}: {done.stderr}")
    expect(saved.read_bytes() == (work / "by_command.json").read_bytes(), "the saved model is not that of its command line")
    for name, stages in bench.times.items():
        print(f"{name}:", ", ".join(f"{stage} {1e3 * s:.0f} ms ({s / seconds:.2f} of the command)" for stage, s in stages.items()))


def main():
    program, configs, guide, work = sys.argv[1], *map(pathlib.Path, sys.argv[2:5])
    if find_browser() is None:
        return skipped("no Chromium found; install it with: apt-get install --no-install-recommends chromium")
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    for seed in (1, 2):
        identify(program, configs, work / f"day{seed}", seed)
    running = OpenProgram(program, work / "day1", "--compare", work / "day2", "--write", "-o", work / "saved",
                          "--controller-view", configs / "stage/small_stage.yaml")
    bench = Workbench(running.url)
    try:
        bench.browser.check_tab("workbench")
        check_edits(bench)
        check_numbers(bench)
        check_band_and_loop(bench)
        check_comparison(bench)
        check_matrix(bench)
        check_cursor_and_provenance(bench)
        check_sentences(bench, guide)
        check_save(program, bench, work)
        bench.browser.check_widths(work, "workbench", 1000)
        expect(bench.browser.problems == [], f"the browser complains: {bench.browser.problems}")
        expect(bench.get(f"{PAGE}.errors") == [], f"errors on the page: {bench.get(PAGE + '.errors')}")
        expect(running.interrupt() == 130, "it did not end in order")
        expect(bench.browser.wait_for("document.getElementById('status').textContent.includes('ended')"), "the page did not see the end")
        expect(sorted(file.name for file in (work / "saved").iterdir()) == ["edited.json"], "other files were written")
    finally:
        bench.browser.close()
        running.close()
    return verdict()


if __name__ == "__main__":
    sys.exit(main())
