#!/usr/bin/python3
"""`watch` on long logs of the small stage, beside what it is to equal.

    watch_long.py PROGRAM CONFIGS WORK_DIR refit [SEED [LOGS]]  tracked values beside those of `frf` and `fit` of the same
                                                               log; one frequency 1e-3 higher, one damping 5 % larger
    watch_long.py PROGRAM CONFIGS WORK_DIR day                 time and memory over 86 400 periods of 1 s (8.3 GB)
"""

import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import time

PROGRAM, CONFIGS, WORK = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
FAULTS = """
faults:
  - {kind: mode_frequency, mode: 7, value: 1e-3}
  - {kind: mode_damping, mode: 9, value: 0.05}
"""


def call(*words):
    done = subprocess.run([PROGRAM, *map(str, words)], cwd=WORK, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 3), f"{words}: {done.stderr}"
    return done.stdout


def write(seed, faults, experiment):
    """stage.yaml and watch.yaml: those of the small stage with another noise, with faults and (text, replacement)."""
    stage = (CONFIGS / "stage/small_stage.yaml").read_text()
    (WORK / "stage.yaml").write_text(re.sub(r"(force_n: 1e-4, seed:) \d+", rf"\1 {seed}", stage) + faults)
    text = (CONFIGS / "experiment/small_stage_watch.yaml").read_text().replace("../stage/small_stage.yaml", "stage.yaml")
    for old, new in experiment:
        assert old in text, old
        text = text.replace(old, new)
    (WORK / "watch.yaml").write_text(text)


def modes_of(model):
    """By frequency: frequency and damping ratio with their deviations."""
    modes = json.loads((WORK / model).read_text())["submodels"]
    return [{"frequency": (m["natural_frequency_hz"], m["natural_frequency_std_hz"]),
             "damping": (m["damping_ratio"], m["damping_ratio_std"])}
            for m in modes if "natural_frequency_std_hz" in m]  # fmt: skip


def refit(seed=1, logs=3):
    reference = modes_of("base/model.json")
    differences = []
    for log in range(logs):
        write(seed + log, FAULTS, [("scheme: simultaneous", "scheme: single_axis"), ("periods: 120", "periods: 48")])
        (WORK / "log.slog").unlink(missing_ok=True)
        call("run", "watch.yaml", "-o", "log.slog")
        told = json.loads(call("watch", "base/model.json", "log.slog", "--memory", "1e9", "--json"))
        call("frf", "log.slog", "-o", "frf.h5")
        call("fit", "frf.h5", "-o", "refit.json", "--band", 16, 800)
        refitted = modes_of("refit.json")
        for tracked in told["tracked"]:
            if tracked["kind"] not in ("frequency", "damping"):
                continue
            mode_hz = float(re.search(r"at ([\d.]+) Hz", tracked["name"])[1])
            at, fitted = (min(modes, key=lambda m: abs(m["frequency"][0] - mode_hz)) for modes in (reference, refitted))
            value, deviation = fitted[tracked["kind"]]
            before = at[tracked["kind"]][0]
            change, uncertain = value / before - 1, deviation / before
            combined = (tracked["deviation"] ** 2 + uncertain**2) ** 0.5
            differences.append((tracked["change"] - change) / combined)
            print(f"{tracked['name']:40s} tracked {tracked['change']: .3e} +- {tracked['deviation']:.1e}, "
                  f"refitted {change: .3e} +- {uncertain:.1e}: {differences[-1]: .2f} combined deviations")
    rms = (sum(d * d for d in differences) / len(differences)) ** 0.5
    print(f"{len(differences)} values: largest {max(map(abs, differences)):.2f}, rms {rms:.2f} combined deviations")


def usage_of(*words):
    """Seconds of processor time and MB of memory of one command, and what it says."""
    process = subprocess.Popen([PROGRAM, *map(str, words)], cwd=WORK, stdout=subprocess.PIPE, text=True)
    said = process.stdout.read()
    _, _, usage = os.wait4(process.pid, 0)
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024, said


def day(seed=1):
    for hours in (1, 24):
        write(seed, "", [("periods: 120", f"periods: {3600 * hours}")])
        (WORK / "day.slog").unlink(missing_ok=True)
        begin = time.monotonic()
        call("run", "watch.yaml", "-o", "day.slog")
        measured = time.monotonic() - begin
        seconds, megabytes, said = usage_of("watch", "base/model.json", "day.slog", "--json")
        told = json.loads(said)
        size = (WORK / "day.slog").stat().st_size / 1e9
        print(f"{hours} h: {size:.2f} GB, measured in {measured:.0f} s; watch: {told['periods']} periods in {seconds:.1f} s "
              f"of processor time, {megabytes:.0f} MB, {len(told['changes'])} changes", flush=True)
    (WORK / "day.slog").unlink()


def main():
    shutil.rmtree(WORK, ignore_errors=True)
    WORK.mkdir(parents=True)
    shutil.copytree(CONFIGS, WORK / "configs")
    call("identify", "configs/experiment/small_stage.yaml", "-o", "base")
    {"refit": refit, "day": day}[sys.argv[4]](*map(int, sys.argv[5:]))


if __name__ == "__main__":
    main()
