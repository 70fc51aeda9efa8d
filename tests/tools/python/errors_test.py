#!/usr/bin/python3
"""What the Python package refuses, and how; Ctrl-C. Arguments: experiment.py."""

import os
import shutil
import signal
import threading

from experiment import CONFIG, WORK, Case, run_tests, setUpModule

import h5py
import numpy as np

import stageid

RATE_HZ = 2000.0


class Refused(Case):
    def refuses(self, error, text, function, *words, **options):
        with self.assertRaisesRegex(error, text) as caught:
            function(*words, **options)
        self.assertIsInstance(caught.exception, stageid.StageidError)
        self.assertNotIn("\n", str(caught.exception))

    def refuses_request(self, text, function, *words, **options):
        self.refuses(stageid.RequestError, text, function, *words, **options)

    def test_kinds_of_errors(self):
        for kind, python in ((stageid.RequestError, ValueError), (stageid.FormatError, ValueError),
                             (stageid.FileError, OSError), (stageid.StageError, RuntimeError)):
            self.assertTrue(issubclass(kind, python) and issubclass(kind, stageid.StageidError))

    def test_files(self):
        (WORK / "wrong").write_text("wrong\n")
        for read in (stageid.read_frf, stageid.read_log, stageid.read_model, stageid.frf, stageid.fit,
                     stageid.simulate):
            self.refuses(stageid.FileError, "none", read, WORK / "none.h5")
            self.refuses(stageid.FormatError, "wrong", read, WORK / "wrong")
        self.refuses(stageid.FileError, "n.h5", stageid.write_frf, WORK / "no" / "n.h5", self.frf)
        self.refuses(stageid.FileError, "n.json", self.model.save, WORK / "no" / "n.json")
        self.assertFalse((WORK / "no").exists())

    def test_endings(self):
        for name, written in (("x.h5", self.model.save), ("w.csv", lambda file: stageid.write_frf(file, self.frf))):
            self.refuses_request(f"{name}: a .* is written as", written, WORK / name)
            self.assertFalse((WORK / name).exists())

    def test_commands(self):
        self.refuses(stageid.FileError, "none", stageid.call, "frf", WORK / "none.slog", "-o", WORK / "n.h5")
        self.refuses_request("'fit'", stageid.call, "fitt", "frf.h5")
        self.refuses(stageid.FormatError, "frf.h5", stageid.call, "validate", WORK / "frf.h5", WORK / "frf.h5")

    def test_words(self):
        for function, given, options in (
                (stageid.frf, self.log, "method covariance periods"), (stageid.modes, self.frf, "kind"),
                (stageid.cmif, self.frf, "kind"),
                (stageid.fit, self.frf, "hold weighting delay method damping rigid_body")):
            for option in options.split():
                with self.subTest(function=function.__name__, option=option):
                    self.refuses_request("wurst", function, given, **{option: "wurst"})
        self.refuses_request("modes", stageid.fit, self.frf, modes=[-5.0])
        self.refuses_request("wurst", self.frf.compensate, "wurst", 0.0)
        self.refuses_request("wurst", self.frf.confidence_radius, 0.95, "wurst")
        self.refuses_request("level", self.frf.confidence_radius, 1.5)
        self.refuses_request("wurst", stageid.multisine, 1000.0, 500, 10.0, 100.0, 1.0, 7, lines="wurst")

    def test_numbers(self):
        self.refuses_request("level", stageid.multisine, 1000.0, 500, 10.0, 100.0, -1.0, 7)
        self.refuses_request("", self.frf.select, band_hz=(900.0, 950.0))
        self.refuses_request("inputs: unknown input 'A1'; did you mean 'a1'", self.frf.select, inputs=["A1"])
        self.refuses_request("outputs: unknown output 'velocity'; available:", self.frf.select, outputs=["velocity"])
        self.refuses(stageid.RequestError,
                     r"run.slog: realization 9 has no complete run; those with one are 1, 2, 3 \(counted from 1\)",
                     stageid.frf, WORK / "run.slog", realizations=[9])
        self.refuses_request("realization 0 has no complete run", stageid.frf, WORK / "run.slog", realizations=[1, 0])
        for option in ("realizations", "inputs", "outputs"):
            self.refuses_request(f"{option}: empty list", stageid.frf, WORK / "run.slog", **{option: []})
        self.refuses_request("covariance_lines|odd", stageid.frf, WORK / "run.slog", covariance_lines=2)
        self.refuses(stageid.FileError, "no.yaml", stageid.frf, WORK / "run.slog", stage=WORK / "no.yaml")
        self.refuses_request("max_iterations", stageid.fit, self.frf, max_iterations=0)
        self.refuses_request("", stageid.stabilization, self.frf, most_order=1000)
        self.refuses_request("", self.frf.compensate("delay", 0.0).compensate, "delay", 0.0)
        self.refuses_request("", self.model.response, [1500.0])
        self.refuses_request("frequency_hz: .*finite", self.model.response, [100.0, np.nan])
        self.refuses_request("frequency_hz: .*axes", self.model.response, [[100.0, 200.0]])
        self.refuses_request("", stageid.validate, self.model, self.frf.select(inputs=["a1"]))
        no_rate = stageid.fit(stageid.Frf(self.frf.frequency_hz, self.frf.response), band_hz=(120, 800), modes=1).model
        self.refuses_request("rate", no_rate.sampled_state_space)
        self.refuses_request("", stageid.pair_modes, self.model, stageid.fit(
            self.frf.select(inputs=["a1"]), band_hz=(120, 800), modes=1).model)

    def test_responses_of_arrays(self):
        f, G = np.arange(1.0, 4.0), np.ones((3, 2, 2), complex)
        for words, options, text in (
                ((f, G[0]), {}, "response.*axes"), ((f[::-1], G), {}, "frequency"),
                ((f[:2], G), {}, ""), ((f, G * np.nan), {}, "finite"),
                ((f, G), {"noise_variance": -np.ones(G.shape)}, "variance"),
                ((f, G), {"noise_variance": np.ones((3, 2))}, "noise_variance"),
                ((f, G), {"inputs": ["one"]}, ""), ((f, G), {"input_units": ["N"]}, "inputs: 1 unit for 2 channels"), ((f, G), {"hold": "first"}, "first")):
            with self.subTest(text=text, **options):
                self.refuses_request(text, stageid.Frf, *words, **options)
        self.assertRaises(TypeError, stageid.Frf, f, "text")
        self.assertRaises(TypeError, stageid.Frf, "text", G)

    def test_complex_numbers_where_real_ones_belong(self):
        f, G = np.arange(1.0, 4.0), np.ones((3, 2, 2), complex)
        for name in ("noise_variance", "total_variance"):
            self.refuses_request(f"{name}: .*complex", stageid.Frf, f, G, **{name: G})
        self.refuses_request("frequency_hz: .*complex", stageid.Frf, f + 1j, G)
        self.refuses_request("frequency_hz: .*complex", self.model.response, [100.0 + 1j])
        self.refuses_request("shape: .*complex", stageid.multisine, 1000.0, 500, 10.0, 100.0, 1.0, 7, shape=np.ones(46, complex))
        given = dict(zip("ruy", self.log.arrays()))
        for name in given:
            self.refuses_request(f"{name}: .*complex", stageid.Log,
                         **{**given, name: given[name] + 0j}, sample_rate_hz=RATE_HZ)
            self.assertRaises(TypeError, stageid.Log, **{**given, name: "text"}, sample_rate_hz=RATE_HZ)

    def test_logs_of_arrays(self):
        r, u, y = self.log.arrays()
        for given, text in (((r[0], u, y), "excitation.*axes|excitation.*x"), ((r, u[..., 0], y), "actuators"),
                            ((r[:1], u, y), "excitation"), ((r, u[:, :1], y), "actuators"),
                            ((r, u[:, :, 1:], y), "actuators"), ((np.full_like(r, np.inf), u, y), "realization 1, experiment 1 .*finite"),
                            ((r[:0], u[:0], y[:0]), "one realization")):
            with self.subTest(text=text):
                self.refuses_request(text, stageid.Log, *given, sample_rate_hz=RATE_HZ)
        for options, text in (({"sensors": ["one"]}, "sensors: .*1 name"), ({"actuator_units": ["N"]}, "actuators"),
                              ({"marked": np.zeros(3)}, "marked"), ({"actuators": ["a", "a", "b"]}, "a"),
                              ({"transient_periods": -1}, "transient")):
            with self.subTest(text=text):
                self.refuses_request(text, stageid.Log, r, u, y, **{"sample_rate_hz": RATE_HZ, **options})
        self.refuses_request("rate", stageid.Log, r, u, y, sample_rate_hz=0.0)
        self.refuses(stageid.FormatError, "periods", stageid.Log, r, u[:, :, 1:], y[:, :, 1:], sample_rate_hz=RATE_HZ)

    def test_a_sample_that_is_no_number(self):
        r, u, y = self.log.arrays()
        y = y.copy()
        y[1, 2, 1234, 1] = np.nan
        log = stageid.Log(r, u, y, sample_rate_hz=RATE_HZ, sensors=["left", "right"])
        self.refuses(stageid.FormatError, "runs/0005.*row 1234 of sensor 'right'", stageid.frf, log)

    def test_runs(self):
        self.assertEqual(self.log[-1].experiment, 3)
        self.assertRaises(IndexError, lambda: self.log[9])
        self.assertRaises(IndexError, lambda: self.log[-10])
        self.assertRaises(TypeError, stageid.frf, 5)
        self.assertRaises(TypeError, stageid.fit, 5)
        shutil.copy(WORK / "run.h5", WORK / "gap.h5")
        with h5py.File(WORK / "gap.h5", "a") as gap:
            del gap["runs/0004"]
        self.refuses_request("gap.h5.*one by one", stageid.read_log(WORK / "gap.h5").arrays)

    def test_a_stage_that_is_stopped(self):
        folder = CONFIG.parent
        stage = (folder.parent / "stage" / "small_stage.yaml").read_text()
        (WORK / "tight.yaml").write_text(stage.replace("limit_n: 40", "limit_n: 0.5"))
        (WORK / "stopped.yaml").write_text(CONFIG.read_text().replace("../stage/small_stage.yaml", "tight.yaml"))
        self.refuses(stageid.StageError, "stopped.yaml: .*limit", stageid.simulate, WORK / "stopped.yaml")


class Interrupted(Case):
    def interrupts(self, function, *words):
        """The signal comes from another thread of Python: it runs while the call works."""
        timer = threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT))
        timer.start()
        with self.assertRaises(KeyboardInterrupt):
            function(*words)
        timer.join()
        self.assertIs(signal.getsignal(signal.SIGINT), signal.default_int_handler)
        self.assertEqual(len(stageid.simulate(CONFIG)), 9)  # the next call is not interrupted

    def test_a_simulation(self):
        self.interrupts(stageid.simulate, CONFIG.parent / "wafer_stage_quick.yaml")

    def test_a_command(self):
        self.interrupts(stageid.call, "run", CONFIG.parent / "wafer_stage_quick.yaml", "-o", WORK / "cut.slog")
        self.assertTrue((WORK / "cut.slog").exists())

    def test_estimates(self):
        rng = np.random.default_rng(1)
        shape = (1, 8, 4 * 40000, 8)
        log = stageid.Log(rng.standard_normal((1, 8, 40000, 8)), rng.standard_normal(shape),
                          rng.standard_normal(shape), sample_rate_hz=1e4)
        self.interrupts(lambda: [stageid.frf(log, method="lpm") for _ in range(1000)])


if __name__ == "__main__":
    run_tests()
