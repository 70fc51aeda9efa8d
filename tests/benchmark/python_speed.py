#!/usr/bin/python3
"""The Python package beside the program: the same work, its time by the clock.

    python_speed.py PROGRAM PACKAGE_DIR CONFIG [REPEATS]

Prints, for each step, the least of REPEATS times (default 3) of the program as a whole process and of the package,
by the wall's clock and by the processors': the latter tells more on a machine that others use as well. Ratios
are the package's over the program's. The results must be equal to the bit.
"""

import json
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

PROGRAM, PACKAGES, CONFIG = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
REPEATS = int(sys.argv[4]) if len(sys.argv) > 4 else 3
sys.path.insert(0, str(PACKAGES))

import numpy as np

import stageid


def used(who):
    """Seconds by the wall's clock, and of the processors."""
    usage = resource.getrusage(who)
    return np.array([time.perf_counter(), usage.ru_utime + usage.ru_stime])


def timed(work, who=resource.RUSAGE_SELF):
    begin = used(who)
    result = work()
    return used(who) - begin, result


def program(folder, *words):
    """Times of the process."""
    seconds, done = timed(lambda: subprocess.run([PROGRAM, "--verbosity", "quiet", *words], cwd=folder,
                                                 capture_output=True, text=True), resource.RUSAGE_CHILDREN)
    if done.returncode not in (0, 3):
        sys.exit(done.stderr)
    return seconds


def compare(step, run_program, run_package):
    """Alternately, so that both see the same machine."""
    process, package, result = [], [], None
    for _ in range(REPEATS):
        process.append(run_program())
        result = None  # its memory is free again
        seconds, result = timed(run_package)
        package.append(seconds)
    process, package = np.min(process, axis=0), np.min(package, axis=0)
    print(f"{step:28}" + "".join(f"{a:10.3f}{b:10.3f}{b / a:8.3f}" for a, b in zip(process, package)), flush=True)
    return result


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)

        def measure():
            (folder / "run.slog").unlink(missing_ok=True)
            return program(folder, "run", CONFIG, "-o", "run.slog", "--backend", "sim", "--pace", "0")

        head = "".join(f"{word:>{width}}" for word, width in (("program", 10), ("package", 10), ("ratio", 8)))
        print(f"{'':28}{'wall, s':>28}{'processors, s':>28}\n{'':28}{head}{head}")
        log = compare("run | simulate", measure, lambda: stageid.simulate(CONFIG))
        estimate = ("frf", "run.slog", "-o", "frf.h5")
        compare("frf of a file, written", lambda: program(folder, *estimate),
                            lambda: stageid.write_frf(folder / "ours.h5", stageid.frf(folder / "run.slog")))
        frf = compare("frf of a file | of arrays", lambda: program(folder, *estimate),
                      lambda: stageid.frf(log))
        fit = compare("fit", lambda: program(folder, "fit", "frf.h5", "-o", "model.json"),
                      lambda: stageid.fit(folder / "frf.h5"))
        theirs = stageid.read_frf(folder / "frf.h5")
        assert (folder / "ours.h5").read_bytes() == (folder / "frf.h5").read_bytes()
        assert np.array_equal(frf.response, theirs.response)
        fit.model.save(folder / "ours.json")
        assert (folder / "ours.json").read_bytes() == (folder / "model.json").read_bytes()


if __name__ == "__main__":
    main()
