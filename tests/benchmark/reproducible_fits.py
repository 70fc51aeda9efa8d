#!/usr/bin/python3
"""Whether fits of almost the same data, on other machines and with other threads, have the same modes and verdicts.

    reproducible_fits.py COPIES DATA OTHERS PROGRAM [PROGRAM ...]

DATA: the folder of frf.h5 of others (f16_1x3.h5, ...). OTHERS: a folder with further FRFs, fitted with default options.
Every FRF is fitted by every program (compiled for other instruction sets), by the first one with 1, 2, 4 and 8 threads and
with COPIES copies of the data, each number changed by a random part of 1e-13.
"""

import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

import h5py
import numpy as np

CHANGE = 1e-13
CASES = [
    ("F-16, defaults", "f16_1x3.h5", []),
    ("F-16, 11 modes", "f16_1x3.h5", "--modes 11 --weighting relative --damping general --direct-term full"),
    ("F-16, 13 modes", "f16_1x3.h5", "--modes 13 --weighting relative --damping general --direct-term full"),
    ("F-16, relative", "f16_1x3.h5", "--weighting relative --damping general"),
    ("two-inertia bench", "two_inertia_1x2.h5", []),
    ("wafer stage 4 x 13", "wafer4x13.h5", []),
    ("ISS 1R, exact", "iss1r_exact.h5", "--modes 135 --damping general --rigid-body none"),
    ("ISS 1R, noise", "iss1r_noise60.h5", "--modes 135 --damping general --rigid-body none"),
]


def fitted(program, frf, flags, work, threads=0):
    """(exit code, status, verdicts by frequency), cost, frequencies in Hz"""
    model = work / "model.json"
    model.unlink(missing_ok=True)
    done = subprocess.run([program, "fit", frf, "-o", model, "--threads", str(threads), *flags],
                          capture_output=True, text=True, check=False)
    if done.returncode not in (0, 3):
        return (done.returncode, done.stderr, ()), np.nan, np.zeros(0)
    read = json.loads(model.read_text())
    modes = [s for s in read["submodels"] if "natural_frequency_hz" in s]
    structure = (done.returncode, read["fit"]["status"], tuple(m.get("verdict") for m in modes))
    return structure, read["fit"]["cost"], np.array([m["natural_frequency_hz"] for m in modes])


def copy_of(frf, seed, work):
    """The FRF with a change of 1e-13 in every number of the response."""
    out = work / "copy.h5"
    shutil.copyfile(frf, out)
    with h5py.File(out, "r+") as file:
        rng = np.random.default_rng(seed)
        value = file["response"][...]
        real = value.view(np.float64)
        real *= 1.0 + CHANGE * rng.standard_normal(real.shape)
        file["response"][...] = value
    return out


def spread(costs):
    return (max(costs) - min(costs)) / min(costs)


def row(name, frf, flags, copies, programs, work):
    frf = frf.resolve()
    first = fitted(programs[0], frf, flags, work, 1)
    of_copies = [fitted(programs[0], copy_of(frf, seed, work), flags, work) for seed in range(copies)]
    of_programs = [fitted(program, frf, flags, work) for program in programs[1:]]
    of_threads = [fitted(programs[0], frf, flags, work, threads) for threads in (2, 4, 8)]
    same = [sum(first[0] == other[0] for other in others) for others in (of_copies, of_programs, of_threads)]
    alike = [first, *(o for o in of_copies + of_programs if o[0] == first[0])]
    moved = max(np.max(np.abs(o[2] / first[2] - 1.0), initial=0.0) for o in alike)
    exact = all(np.array_equal(first[2], o[2]) and first[1] == o[1] for o in of_threads)
    print(f"| {name} | {first[0][0]} | {len(first[2])} | {same[0]} of {copies} | {same[1]} of {len(of_programs)} | "
          f"{same[2]} of 3{', same numbers' if exact else ''} | {spread([o[1] for o in alike]):.1e} | {moved:.1e} |",
          flush=True)


def main():
    copies, data, others = int(sys.argv[1]), pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
    programs = [pathlib.Path(p).resolve() for p in sys.argv[4:]]
    print("| data | exit code | modes | copies | programs | threads | spread of costs | frequencies |\n"
          "| --- | --- | --- | --- | --- | --- | --- | --- |", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        work = pathlib.Path(folder)
        for name, frf, flags in CASES:
            row(name, data / frf, flags.split() if flags else [], copies, programs, work)
        for frf in sorted(others.glob("*.h5")):
            row(frf.stem, frf, [], copies, programs, work)


main()
