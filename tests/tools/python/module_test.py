#!/usr/bin/python3
"""The Python module gives what the program gives, to the bit.

    module_test.py PROGRAM MODULE_DIR CONFIG WORK_DIR
"""

import pathlib
import shutil
import subprocess
import sys
import unittest

PROGRAM, CONFIG, WORK = sys.argv[1], sys.argv[3], pathlib.Path(sys.argv[4])
sys.path.insert(0, sys.argv[2])

import h5py
import numpy as np

import stageid


class Module(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        shutil.rmtree(WORK, ignore_errors=True)
        WORK.mkdir(parents=True)
        for words in (("run", CONFIG, "-o", "run.slog"), ("log", "convert", "run.slog", "-o", "run.h5"),
                      ("frf", "run.slog", "-o", "frf.h5"),
                      ("fit", "frf.h5", "-o", "model.json", "--band", "120", "800"),
                      ("export", "model.json", "-o", "model.h5")):
            result = subprocess.run([PROGRAM, *words], cwd=WORK, capture_output=True, text=True)
            assert result.returncode in (0, 3), result.stderr

    def test_commands_write_the_same_bytes(self):
        self.assertEqual(stageid.call("frf", WORK / "run.slog", "-o", WORK / "again.h5"), 0)
        self.assertEqual((WORK / "again.h5").read_bytes(), (WORK / "frf.h5").read_bytes())
        self.assertRaises(RuntimeError, stageid.call, "frf", WORK / "none.slog", "-o", WORK / "n.h5")

    def test_files_as_arrays(self):
        frf = stageid.read_frf(WORK / "frf.h5")
        with h5py.File(WORK / "frf.h5") as h5:
            for name in ("frequency_hz", "response", "noise_variance"):
                np.testing.assert_array_equal(frf[name], h5[name][()])
        with h5py.File(WORK / "run.h5") as h5:
            runs = stageid.read_log(WORK / "run.slog")
            self.assertEqual(len(runs), len(h5["runs"]))
            for run, name in zip(runs, h5["runs"]):
                for group in ("excitation", "actuators", "sensors"):
                    np.testing.assert_array_equal(run[group], h5[f"runs/{name}/{group}"][()])

    def test_a_model(self):
        model = stageid.read_model(WORK / "model.json")
        with h5py.File(WORK / "model.h5") as h5:
            np.testing.assert_array_equal(model.response(h5["frequency_hz"][()]), h5["response"][()])
            for given, name in zip(model.state_space(), "ABCD"):
                np.testing.assert_array_equal(given, h5[f"state_space/continuous/{name}"][()])
            for given, name in zip(model.sampled_state_space(), "ABCD"):
                np.testing.assert_array_equal(given, h5[f"state_space/discrete/{name}"][()])
            np.testing.assert_array_equal([m["modal_mass"] for m in model.modes()],
                                          h5["modes/modal_mass"][()])
        model.save(WORK / "saved.json")
        self.assertEqual(stageid.read_model(WORK / "saved.json").outputs, model.outputs)
        self.assertRaises(RuntimeError, stageid.read_model, WORK / "frf.h5")

    def test_a_multisine(self):
        x = stageid.multisine(1000.0, 500, 10.0, 100.0, rms=2.0, seed=7)
        self.assertAlmostEqual(np.sqrt(np.mean(x**2)), 2.0, places=12)
        lines = np.abs(np.fft.rfft(x)) > 1e-9
        np.testing.assert_array_equal(np.flatnonzero(lines), np.arange(5, 51))
        self.assertRaises(ValueError, stageid.multisine, 1000.0, 500, 10.0, 100.0, rms=-1.0, seed=7)


if __name__ == "__main__":
    sys.argv = sys.argv[:1] + sys.argv[5:]
    unittest.main()
