#!/usr/bin/env python3
"""Opens the dashboard of a running measurement in headless Chromium, at 1280 and 390 pixels, light and
dark; compares what it draws with what `stageid frf` makes of the finished log; stops another measurement
by its button, with the keyboard; watches a third one, whose stage changes.

    check_dashboard.py PROGRAM CONFIGS WORK

Exit code 77 (skipped) when there is no Chromium and STAGEID_REQUIRE_BROWSER is not set, or no h5py.
"""

import pathlib
import shutil
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

from browser import Browser, expect, find_browser, skipped, verdict
from running_program import RunningProgram, with_experiment

try:
    import h5py
    import numpy as np
except ImportError:
    h5py = None

PACE = 0.2  # of a stage at 2 kHz


def start(program, configs, work, name, pace, **numbers):
    """A paced run of a stage that may be late: its log, the program, a browser that shows it."""
    folder = work / name
    folder.mkdir(parents=True)
    return show(program, with_experiment(configs, folder, late=True, **numbers), folder / "run.slog", pace)


def show(program, config, log, pace, *flags):
    running = RunningProgram(program, config, "-o", log, "--pace", str(pace), *flags)
    browser = Browser(find_browser())
    browser.resize(1280, 1600)
    browser.call("Page.navigate", url=running.url)
    return log, running, browser


def check_levels(browser):
    levels = browser.evaluate("Array.from(document.querySelectorAll('.level-value'), (e) => e.textContent)")
    expect(len(levels) == 5, f"{len(levels)} levels instead of 3 actuators and 2 sensors")
    expect(all(" of " in level for level in levels), f"levels without limits: {levels}")
    state = browser.evaluate("window.stageidDashboard.state")
    expect(all(v > 0 for v in state["levels"]["largest_peak"]), "a channel that never moved")
    expect(state["timing"]["lateness"]["bins"], "no timing")
    drawn = browser.evaluate("window.stageidDashboard.traces().map((t) => [t.data.low.length, t.data.high[0] >= t.data.low[0], t.unit])")
    expect(all(bins > 10 and ordered for bins, ordered, _ in drawn) and [unit for *_, unit in drawn] == ["N", "m"], f"traces: {drawn}")
    expect(browser.evaluate("document.querySelectorAll('.histogram .step-bar > span').length") > 2, "no histogram")
    expect(browser.evaluate("document.querySelectorAll('.events tr').length") > 2, "no events")


RESPONSE = """(() => { const d = window.stageidDashboard; const f = d.content().frf; return {
  inputs: f.inputs.map((c) => c.name), outputs: f.outputs.map((c) => c.name), realizations: f.realizations,
  frequency: Array.from(d.array('frequency')), response: Array.from(d.array('response')), cmif: Array.from(d.array('cmif')),
  deviation: Array.from(d.array('deviation')), band: Array.from(d.array('cmif_deviation')),
  drawn: d.channelCurves(1).measured.length, panels: document.querySelectorAll('.panel').length,
  plots: Array.from(document.querySelectorAll('.plot'), (p) => p.id) }; })()"""


def estimate(program, log):
    file = log.with_name("frf.h5")
    done = subprocess.run([program, "frf", log, "-o", file], capture_output=True, text=True, check=False)
    expect(done.returncode in (0, 3), f"frf: exit code {done.returncode}: {done.stderr}")
    return file


def check_numbers(file, seen):
    """What the page draws is what `stageid frf` estimates from the finished log."""
    with h5py.File(file) as frf:
        G = frf["response"][()]
        G = G["r"] + 1j * G["i"] if G.dtype.names else G
        f = frf["frequency_hz"][()]
        variance = frf["noise_variance"][()]
        expect(frf.attrs["realizations"] == seen["realizations"], "realizations")
    lines, outputs, inputs = G.shape
    expect([len(seen["outputs"]), len(seen["inputs"])] == [outputs, inputs], "channels")
    expect(np.array_equal(np.array(seen["frequency"]), f), "frequencies differ")
    # Channel-major, channel = output + outputs * input; float32 on the way and no other difference.
    want = np.transpose(G, (2, 1, 0)).reshape(inputs * outputs, lines)
    got = np.array(seen["response"]).reshape(inputs * outputs, lines, 2)
    expect(np.array_equal(got[..., 0], want.real.astype(np.float32)), "real parts differ")
    expect(np.array_equal(got[..., 1], want.imag.astype(np.float32)), "imaginary parts differ")
    # One byte each on a logarithmic scale of 254 steps over a row's range.
    std = np.sqrt(np.transpose(variance, (2, 1, 0)).reshape(inputs * outputs, lines))
    step = (std.max(axis=1) / std.min(axis=1)) ** (0.5 / 253)
    ratio = np.array(seen["deviation"]).reshape(std.shape) / std
    expect(np.all(np.maximum(ratio, 1 / ratio) <= 1.0001 * step[:, None]), "deviations differ")
    # The CMIF by numpy's own singular values.
    accelerance = G * ((2 * np.pi * f) ** 2)[:, None, None]
    singular = np.linalg.svd(accelerance, compute_uv=False) ** 2
    got = np.array(seen["cmif"]).reshape(singular.shape[1], lines).T
    expect(np.allclose(got, singular, rtol=1e-6), "CMIF differs from numpy's")
    expect(len(seen["band"]) == singular.size and min(seen["band"]) > 0, "no bands of the CMIF")
    expect(seen["panels"] == inputs * outputs and seen["drawn"] == lines, "panels")
    expect(set(seen["plots"]) >= {"entry-magnitude", "entry-phase", "cmif-plot"}, f"plots {seen['plots']}")


def see_the_end(browser, running, timeout=60):
    """The page has shown the end and still does when it is loaded again, because the program waits for it."""
    expect(browser.wait_for("window.stageidDashboard.complete", timeout), "the page did not see the end")
    browser.evaluate("window.stageidDashboard.complete = false")
    browser.call("Page.reload")
    expect(browser.wait_for("window.stageidDashboard && window.stageidDashboard.complete"), "the end is not shown again")
    expect(running.process.poll() is None, "the program did not wait for its page")


def leave(browser, running):
    """@returns the exit code of the program, which ends with its page, and what it said"""
    expect(browser.problems == [], f"the browser complains: {browser.problems}")
    expect(browser.evaluate("window.stageidDashboard.errors") == [], "errors on the page")
    browser.call("Page.navigate", url="about:blank")
    return running.wait(30)


def watch_one(program, configs, work):
    # Few samples a period and 2.5 ms between them: a busy machine, this browser included, is seldom so
    # late, and then in few of the periods. A realization that it spoils is left out, in the page too.
    log, running, browser = start(program, configs, work, "whole", PACE, realizations=3, periods=6, period_s=0.05)
    try:
        expect(browser.wait_for("window.stageidDashboard.state && window.stageidDashboard.state.state === 'running'"), "no state came")
        expect(browser.wait_for("window.stageidDashboard.edition() >= 1"), "no response came")
        expect(browser.evaluate("window.stageidDashboard.state.state") == "running", "the first response came after the end only")
        check_levels(browser)
        browser.check_widths(work, "running", 1600)
        see_the_end(browser, running)
        shown_code = browser.evaluate("window.stageidDashboard.state.exit_code")
        seen = browser.evaluate(RESPONSE)
        browser.check_tab("ended")
        browser.check_widths(work, "ended", 1600)
        check_numbers(estimate(program, log), seen)
        code, out = leave(browser, running)
        expect(code in (0, 3), f"exit code {code}: {out}")
        expect(shown_code == code, "the page knows another exit code")
    finally:
        browser.close()
        running.close()


def stop_one(program, configs, work):
    # One run of minutes: the stop falls into it and not between two.
    log, running, browser = start(program, configs, work, "stopped", 1, periods=1000)
    try:
        expect(browser.wait_for("!!document.querySelector('#abort:enabled')"), "no button")
        browser.evaluate("document.getElementById('abort').focus()")
        browser.press("Enter")
        expect(browser.evaluate("document.getElementById('abort').textContent") == "Press again to stop", "one press was enough")
        expect(running.process.poll() is None, "one press ended it")
        browser.press("Enter")
        see_the_end(browser, running)
        browser.check_widths(work, "stopped", 1600)
        code, _ = leave(browser, running)
        expect(code == 130, f"exit code {code} instead of 130")
        verify = subprocess.run([program, "log", "verify", log], capture_output=True, text=True, check=False)
        expect(verify.returncode == 0, f"the log is not whole: {verify.stderr}")
        events = log.with_name("run.events.jsonl").read_text()
        expect('"event":"abort","from":"dashboard"' in events and '"reason":"interrupt"' in events, "no abort among the events")
    finally:
        browser.close()
        running.close()


def with_change(configs, folder):
    """An experiment to watch, of a stage whose mode at 181 Hz changes by 0.1 % after 18 of its 40 periods of 0.1 s."""
    shutil.copytree(configs, folder)
    stage = folder / "stage/small_stage.yaml"
    stage.write_text(stage.read_text() + """
faults:
  - {kind: mode_frequency, mode: 7, value: 1e-3, from_cycle: 4000}
realtime: {policy: try, misses_allowed: 1000000}
""")
    experiment = folder / "experiment/small_stage_watch.yaml"
    experiment.write_text(experiment.read_text().replace("period_s: 1", "period_s: 0.1").replace("periods: 120", "periods: 40"))
    return experiment


WATCH = """({ changes: Array.from(document.querySelectorAll('#watch .events tr'), (e) => e.textContent),
  cards: document.querySelectorAll('.watch-card').length,
  ribbons: Array.from(document.querySelectorAll('.ribbon canvas'), (c) => c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some((v) => v > 0)),
  red: Array.from(document.querySelectorAll('.watch-card'), (e) => e.querySelector('.verdict.bad') ? e.title : '').filter(Boolean),
  lit: document.querySelectorAll('.watch-card .verdict.good, .watch-card .verdict.doubt').length })"""


def watch_a_change(program, configs, work):
    model = work / "model"
    subprocess.run([program, "identify", configs / "experiment/small_stage.yaml", "-o", model], capture_output=True, check=True)
    log = work / "changed.slog"
    log, running, browser = show(program, with_change(configs, work / "changed"), log, PACE, "--watch", model / "model.json", "--learn", "12")
    try:
        expect(browser.wait_for("window.stageidDashboard.state.watch.changes >= 1", 120), "no change was told")
        metrics = running.get("metrics").decode()
        expect("\nstageid_watch_changes_total 1\n" in metrics, "no change in the metrics")
        expect('\nstageid_tracked_change{kind="frequency",name="frequency of the mode at 181.' in metrics, "no tracked value in the metrics")
        see_the_end(browser, running, 120)
        seen = browser.evaluate(WATCH)
        expect(len(seen["changes"]) == 1 and "181." in seen["changes"][0], f"changes: {seen['changes']}")
        expect(len(seen["red"]) == 1 and "frequency of the mode at 181." in seen["red"][0], f"red lights: {seen['red']}")
        expect(seen["lit"] == seen["cards"] - 1, f"{seen['lit']} of {seen['cards']} lights are on")
        expect(len(seen["ribbons"]) == seen["cards"] - 2 and all(seen["ribbons"]), "a ribbon was not drawn")
        browser.check_widths(work, "watched", 1600)
        running.process.send_signal(signal.SIGINT)  # ends the wait, with the code of the measurement
        code, out = running.wait(30)
        expect(code == 3, f"exit code {code}: {out}")
    finally:
        browser.close()
        running.close()


def main():
    program, configs, work = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
    if find_browser() is None or h5py is None:
        return skipped("no Chromium or no h5py found; install chromium, python3-h5py")
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    with ThreadPoolExecutor(2) as pool:  # they mostly wait
        for check in [pool.submit(part, program, configs, work) for part in (watch_one, watch_a_change, stop_one)]:
            check.result()
    return verdict()


if __name__ == "__main__":
    sys.exit(main())
