#!/usr/bin/python3
"""The Python package beside the program: the same work, its time by the clock.

    python_speed.py PROGRAM PACKAGE_DIR CONFIG [REPEATS]

Prints, for each step, the least of REPEATS times (default 3) by the program as a whole process, by the
program's own account of its work, and by the package; the last column is the package over the process.
The results must be equal to the bit.
"""

import json
import pathlib
import subprocess
import sys
import tempfile
import time

PROGRAM, PACKAGES, CONFIG = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
REPEATS = int(sys.argv[4]) if len(sys.argv) > 4 else 3
sys.path.insert(0, str(PACKAGES))

import numpy as np

import stageid


def timed(work):
    begin = time.perf_counter()
    result = work()
    return time.perf_counter() - begin, result


def program(folder, *words):
    """Wall time of the process, and what it says itself."""
    seconds, done = timed(lambda: subprocess.run([PROGRAM, "--json", "--verbosity", "quiet", *words], cwd=folder,
                                                 capture_output=True, text=True))
    if done.returncode not in (0, 3):
        sys.exit(done.stderr)
    return seconds, json.loads(done.stdout)["seconds"]


def compare(step, run_program, run_package):
    """Alternately, so that both see the same machine."""
    process, own, package = [], [], []
    for _ in range(REPEATS):
        whole, inner = run_program()
        seconds, result = timed(run_package)
        process.append(whole)
        own.append(inner)
        package.append(seconds)
    print(f"{step:34}{min(process):10.3f}{min(own):10.3f}{min(package):10.3f}"
          f"{min(package) / min(process):10.3f}", flush=True)
    return result


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)

        def measure():
            (folder / "run.slog").unlink(missing_ok=True)
            return program(folder, "run", CONFIG, "-o", "run.slog", "--backend", "sim", "--pace", "0")

        print(f"{'':34}{'process':>10}{'its work':>10}{'package':>10}{'ratio':>10}")
        log = compare("run | simulate", measure, lambda: stageid.simulate(CONFIG))
        estimate = ("frf", "run.slog", "-o", "frf.h5")
        from_file = compare("frf of a file, written", lambda: program(folder, *estimate),
                            lambda: stageid.write_frf(folder / "ours.h5", stageid.frf(folder / "run.slog")))
        frf = compare("frf of a file | of arrays", lambda: program(folder, *estimate),
                      lambda: stageid.frf(log))
        fit = compare("fit", lambda: program(folder, "fit", "frf.h5", "-o", "model.json"),
                      lambda: stageid.fit(folder / "frf.h5"))
        assert from_file is None
        theirs = stageid.read_frf(folder / "frf.h5")
        assert (folder / "ours.h5").read_bytes() == (folder / "frf.h5").read_bytes()
        assert np.array_equal(frf.response, theirs.response)
        fit.model.save(folder / "ours.json")
        assert (folder / "ours.json").read_bytes() == (folder / "model.json").read_bytes()


if __name__ == "__main__":
    main()
