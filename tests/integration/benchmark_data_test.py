#!/usr/bin/python3
"""`stageid fit` on measured and benchmark data made by others, number of modes given and nothing else.
Errors no larger than docs/benchmarks.md says, every pole stable. Skips where the data are not there.

    benchmark_data_test.py PROGRAM DATA WORK_DIR
"""

import json
import pathlib
import shutil
import subprocess
import sys
import unittest

import h5py
import numpy as np

PROGRAM, DATA, WORK = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])


def fitted(data, *arguments):
    model = WORK / "model.json"
    done = subprocess.run(
        [PROGRAM, "fit", DATA / data, "-o", model, "--weighting", "relative", *arguments],
        capture_output=True, text=True)
    # 3: the model is the best of its kind, but insufficient according to the variances of the data.
    assert done.returncode in (0, 3), done.stderr
    return json.loads(model.read_text())


def response(model, frequency_hz):
    """sum of B(s) / (s^l A(s)), l, A and B of every submodel."""
    s = 2j * np.pi * frequency_hz
    total = 0.0
    for m in model["submodels"]:
        numerator = sum(np.multiply.outer(s**p, np.array(B)) for p, B in enumerate(m["numerator"]))
        denominator = s ** m["integrators"] * np.polyval(m["denominator"][::-1], s)
        total = total + numerator / denominator[:, None, None]
    return total


class BenchmarkData(unittest.TestCase):
    def check(self, model, error):
        self.assertLessEqual(model["fit"]["relative_rms_error"], error)
        for m in model["submodels"]:
            poles = np.roots(m["denominator"][::-1])
            self.assertTrue((poles.real < 0).all(), m["denominator"])

    def test_f16(self):
        for modes, damping, error in (
            (8, "proportional", 0.09078), (8, "general", 0.07594), (11, "proportional", 0.07145),
            (11, "general", 0.06275), (13, "proportional", 0.06587), (13, "general", 0.05624)):  # fmt: skip
            with self.subTest(modes=modes, damping=damping):
                self.check(fitted("f16_1x3.h5", "--modes", str(modes), "--damping", damping,
                                  "--direct-term", "full"), error)

    def test_two_inertia(self):
        for damping, error in (("proportional", 0.17943), ("general", 0.17610)):
            self.check(fitted("two_inertia_1x2.h5", "--modes", "1", "--damping", damping), error)

    def test_wafer_stage(self):
        model = fitted("wafer4x13.h5")
        self.check(model, 9.991e-4)
        self.assertEqual(sum("natural_frequency_hz" in m for m in model["submodels"]), 17)

    def test_iss_exact(self):
        self.check(fitted("iss1r_exact.h5", "--modes", "135", "--damping", "general",
                          "--rigid-body", "none"), 1e-10)  # fmt: skip

    def test_iss_noisy(self):
        model = fitted("iss1r_noise60.h5", "--modes", "135", "--damping", "general",
                       "--rigid-body", "none")  # fmt: skip
        self.check(model, 9.63e-4)
        with h5py.File(DATA / "iss1r_exact.h5") as file:
            frequency_hz, exact = file["frequency_hz"][:], file["response"][:]
        error = np.abs(response(model, frequency_hz) - exact) / np.abs(exact)
        self.assertLessEqual(np.sqrt(np.mean(error**2)), 2.8e-4)


if __name__ == "__main__":
    if not DATA.is_dir():
        print(f"skipped: no data in {DATA}")
        sys.exit(77)
    shutil.rmtree(WORK, ignore_errors=True)
    WORK.mkdir(parents=True)
    unittest.main(argv=sys.argv[:1])
