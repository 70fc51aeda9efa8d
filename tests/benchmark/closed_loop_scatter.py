#!/usr/bin/python3
"""Scatter of the modes of one stage, measured in closed loop many times, against the reported standard deviations.

    closed_loop_scatter.py PROGRAM CONFIGS WORK_DIR EXPERIMENT RUNS SEED

EXPERIMENT: small_stage or wafer_stage_quick. Each run is one `identify` with another noise and other random phases; the
true natural frequencies and damping ratios are those of the simulated stage. Noise acts on the sensors and, as
disturbance forces, on the inputs; the controller repeats both.
"""

import json
import math
import pathlib
import re
import shutil
import subprocess
import sys

LOW_HZ = 460.0  # below, the controller of the wafer stage has an effect


def write(configs, work, name, seed):
    """The experiment with other random phases, and its stage with another noise."""
    text = (configs / f"experiment/{name}.yaml").read_text()
    stage = pathlib.Path(re.search(r"^stage: (\S+)", text, re.M)[1]).name
    noisy, changed = re.subn(r"(\bseed:) \d+", rf"\1 {seed}", (configs / "stage" / stage).read_text())
    assert changed == 1, stage
    (work / stage).write_text(noisy)
    text = re.sub(r"^stage: \S+", f"stage: {stage}", text, flags=re.M)
    text, changed = re.subn(r"(\bseed:) \d+", rf"\1 {seed}", text)
    assert changed == 1, name
    (work / "experiment.yaml").write_text(text)


def identify(program, work):
    """The summary of one identification, or None if it is not trustworthy."""
    out = work / "identified"
    shutil.rmtree(out, ignore_errors=True)
    done = subprocess.run([program, "identify", work / "experiment.yaml", "-o", out, "--threads", "1"],
                          capture_output=True, text=True, check=False)
    assert done.returncode in (0, 3), done.stderr
    if done.returncode == 3:
        print(json.loads((out / "summary.json").read_text())["reasons"], flush=True)
        return None
    return json.loads((out / "summary.json").read_text())


def report(what, in_std):
    """Errors from the truth, in reported standard deviations."""
    n = len(in_std)
    if n == 0:
        return
    rms = math.sqrt(sum(x * x for x in in_std) / n)
    inside = sum(abs(x) < 1.96 for x in in_std) / n
    print(f"{what:32s} {n:6d} {rms:8.3f} {100 * inside:8.1f} %")


def main():
    program, configs, work = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
    name, runs, seed = sys.argv[4], int(sys.argv[5]), int(sys.argv[6])
    work.mkdir(parents=True, exist_ok=True)
    errors = {}  # of a mode and kind: in reported standard deviations
    trusted = extra = 0
    for run in range(runs):
        write(configs, work, name, seed + run)
        summary = identify(program, work)
        if summary is None:
            continue
        trusted += 1
        extra += len(summary["truth"]["extra_modes_hz"])
        for mode in summary["truth"]["modes"]:
            assert mode["found"], (seed + run, mode)
            for kind in ("frequency", "damping"):
                deviation = mode[f"{kind}_deviation_in_std"]
                errors.setdefault((mode["true_frequency_hz"], kind), []).append(deviation)
        (work / "errors.json").write_text(json.dumps([[*key, values] for key, values in errors.items()]))
    print(f"{trusted} of {runs} trustworthy; modes that the stage does not have: {extra}")
    print(f"{'':32s} {'errors':>6s} {'rms/std':>8s} {'in 95 %':>8s}")
    for kind in ("frequency", "damping"):
        for low in (True, False):
            report(f"{kind} {'below' if low else 'above'} {LOW_HZ:g} Hz",
                   [x for (f, k), values in errors.items() for x in values if k == kind and (f < LOW_HZ) == low])
    for (f, kind), values in sorted(errors.items()):
        report(f"{f:.1f} Hz, {kind}", values)


main()
