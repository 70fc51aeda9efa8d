#!/usr/bin/python3
"""Data and models that must not be trusted, in every command that judges: the exit code, the cause, and that it comes first.

The data are logs and FRFs of the simulated small stage, spoilt with numpy.

    verdict_test.py PROGRAM CONFIGS WORK_DIR
"""

import json
import pathlib
import shutil
import sys
import unittest

import h5py
import numpy as np

from processes import ProcessTest

PROGRAM, CONFIGS, WORK = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
SMALL = "configs/experiment/small_stage.yaml"
STAGE = "configs/stage/small_stage.yaml"


def spoilt(source, name, operate):
    """A copy of an HDF5 file after operate(file)."""
    shutil.copy(WORK / source, WORK / name)
    with h5py.File(WORK / name, "r+") as file:
        operate(file)
    return name


def each_run(change):
    """An operation on a log: change(t, sensors, actuators) of each run, which may change both arrays."""
    def operate(log):
        for run in log["runs"].values():
            sensors, actuators = run["sensors"][:], run["actuators"][:]
            change(np.arange(len(sensors)) / log.attrs["sample_rate_hz"], sensors, actuators)
            run["sensors"][:], run["actuators"][:] = sensors, actuators
    return operate


class VerdictTest(ProcessTest):
    program, folder = PROGRAM, WORK

    @classmethod
    def setUpClass(cls):
        shutil.rmtree(WORK, ignore_errors=True)
        shutil.copytree(CONFIGS, WORK / "configs")
        for words in (["identify", SMALL, "-o", "all"], ["log", "convert", "all/run.slog", "-o", "run.h5"]):
            done = cls.call(*words)
            assert done.returncode == 0, done.stderr

    def ends(self, code, *words):
        done = self.call(*words)
        self.assertEqual(done.returncode, code, f"{words}\n{done.stdout}{done.stderr}")
        return done

    def tells(self, code, *words):
        """The object that a command prints with --json."""
        return json.loads(self.ends(code, *words, "--json").stdout)

    def configure(self, name, *changes):
        """NAME.yaml: the small experiment, and its stage, with (text, replacement)."""
        experiment = (WORK / SMALL).read_text().replace("../stage/small_stage.yaml", f"{name}_stage.yaml")
        stage = (WORK / STAGE).read_text()
        for old, new in changes:
            self.assertTrue(old in experiment or old in stage, old)
            experiment, stage = experiment.replace(old, new), stage.replace(old, new)
        (WORK / f"{name}.yaml").write_text(experiment)
        (WORK / f"{name}_stage.yaml").write_text(stage)

    def first_finding(self, code, log, *flags):
        """The same in `frf` and `log info --health`."""
        findings = self.tells(code, "frf", log, "-o", "f.h5", *flags)["health"]
        examined = self.tells(code, "log", "info", log, "--health", *flags)["health"]
        self.assertEqual([f["cause"] for f in findings], [f["cause"] for f in examined])
        return findings[0]

    # -- faults of the data --------------------------------------------------------------------------------------------

    def test_a_fault_of_the_data_is_the_first_reason_of_every_verdict(self):
        def turn(t, sensors, actuators):
            sensors[:, 1] *= -1.0
        log = spoilt("run.h5", "turned.h5", each_run(turn))
        self.assertEqual(self.first_finding(3, log, "--stage", STAGE)["cause"], "sign")
        self.ends(3, "frf", log, "-o", "turned_frf.h5", "--stage", STAGE)
        fit = self.tells(3, "fit", "turned_frf.h5", "-o", "turned.json", "--band", 120, 800)
        self.assertEqual((fit["status"], fit["trustworthy"]), ("faulty_data", False))
        self.assertRegex(fit["message"], "^s2: ")
        told = self.ends(3, "validate", "all/model.json", "turned_frf.h5").stdout
        self.assertRegex(told, "verdict: not to be trusted: s2: ")
        self.ends(3, "report", "turned.json", "turned_frf.h5", "-o", "turned.html")

    def test_one_sample_lost_in_a_run(self):
        def lose(log):
            for kind in ("sensors", "actuators"):
                samples = log["runs/0001"][kind][:]
                samples[1733:-1] = samples[1734:]
                log["runs/0001"][kind][:] = samples
        log = spoilt("run.h5", "lost.h5", lose)
        for flags in ((), ("--stage", STAGE)):
            found = self.first_finding(0, log, *flags)
            self.assertEqual(found["cause"], "lost_samples", found)
            self.assertRegex(found["what"], "one sample (was )?lost in run 0001 near row 17[0-9][0-9]")

    def test_an_excitation_that_is_recorded_one_sample_late_affects_nothing(self):
        def delay(log):
            for run in log["runs"].values():
                run["excitation"][:] = np.roll(run["excitation"][:], 1, axis=0)
        found = self.first_finding(0, spoilt("run.h5", "late.h5", delay))
        self.assertEqual((found["cause"], found["severity"]), ("excitation_timing", "doubt"), found)
        self.assertIn("unaffected", found["what"] + found["remedy"])

    def test_a_glitch_and_a_bump_are_told(self):
        def glitch(log):
            sensors = log["runs/0001/sensors"][:]
            sensors[1300, 0] += 100.0 * sensors[:, 0].std()
            log["runs/0001/sensors"][:] = sensors
        log = spoilt("run.h5", "glitch.h5", glitch)
        done = self.ends(0, "frf", log, "-o", "f.h5")
        self.assertRegex(done.stdout + done.stderr, "experiment 2: samples 29[0-9] ... 30[0-9] of period 1 replaced")
        told = self.tells(0, "frf", log, "-o", "f.h5")
        replaced, = told["replaced_samples"]
        # It is not taken for noise, a drift or a fault of the channel.
        self.assertEqual({finding["severity"] for finding in told["health"]}, {"not checked"}, told["health"])
        self.assertEqual((replaced["realization"], replaced["experiment"], replaced["period"]), (1, 2, 1))

        def bump(log):
            sensors = log["runs/0001/sensors"][:]
            sensors[1600:1900] += 3.0 * sensors.std() * np.hanning(300)[:, None]
            log["runs/0001/sensors"][:] = sensors
        log = spoilt("run.h5", "bump.h5", bump)
        done = self.ends(0, "frf", log, "-o", "f.h5")
        self.assertRegex(done.stdout + done.stderr, "experiment 2: period 2 discarded: ")
        self.assertIn("data health: no findings", done.stdout)

    def test_lightly_damped_modes_that_still_ring(self):
        self.configure("light", ("damping: [0.02, 0.015]", "damping: [0.0008]"),
                       ("transient_periods: 2", "transient_periods: 1"))
        done = self.ends(3, "identify", "light.yaml", "-o", "light")
        self.assertRegex(done.stdout, "verdict: not to be trusted: not settled: the transient of the start still rings "
                                      "at .* with transient_periods: [0-9]")
        finding = self.first_finding(3, "light/run.slog")
        self.assertEqual(finding["cause"], "unsettled", finding)

    def test_a_slow_disturbance_is_never_explained_by_a_sound_verdict(self):
        """0.43 Hz, larger than the motion: it leaks into the lowest lines."""
        def disturb(t, sensors, actuators):
            sensors += (20.0 * sensors.std() * np.sin(2.0 * np.pi * 0.43 * t + 1.0))[:, None]
        log = spoilt("run.h5", "slow.h5", each_run(disturb))
        measured = json.loads(self.call("frf", log, "-o", "slow_frf.h5", "--json").stdout)
        self.assertIn("unsettled", {finding["cause"] for finding in measured["health"]})
        validated = self.call("validate", "all/model.json", "slow_frf.h5", "--json")
        told = json.loads(validated.stdout)
        self.assertEqual(told["trustworthy"], validated.returncode == 0)
        # The model is right, but the scatter of three realizations has two degrees of freedom, common to all lines.
        figures = told["frequency_domain"]
        self.assertTrue(validated.returncode == 3 or
                        figures["chi_square_per_dof"] < 5.0 * figures["expected_chi_square"], figures)
        self.assertIn("the records are not settled", self.call("validate", "all/model.json", "slow_frf.h5").stdout)

    # -- models that leave too much ------------------------------------------------------------------------------------

    def test_one_output_that_the_model_does_not_explain_is_named(self):
        def scale(frf):
            response = frf["response"][:]
            response[:, 1, :] *= 2.36
            frf["response"][:] = response
        other = spoilt("all/frf_validation.h5", "scaled.h5", scale)
        told = self.ends(3, "validate", "all/model.json", other).stdout
        self.assertRegex(told, "verdict: not to be trusted: .*s2")

    def test_identify_with_too_few_modes(self):
        self.configure("few", ("fit:\n", "fit:\n  modes: 1\n"))
        done = self.ends(3, "identify", "few.yaml", "-o", "few")
        self.assertRegex(done.stdout + done.stderr, "not to be trusted: .*the residual is ")
        summary = json.loads((WORK / "few/summary.json").read_text())
        self.assertEqual(summary["trustworthy"], False)
        self.assertRegex(summary["reasons"][0], "the residual is ")
        self.assertTrue((WORK / "few/report.html").exists())

    # -- nonlinear plants ----------------------------------------------------------------------------------------------

    def cubic(self, name, stiffness, *changes):
        self.configure(name, ("  plate:", f"  cubic_stiffness_n_m3: {stiffness}\n  plate:"), *changes)
        return f"{name}.yaml"

    def test_a_strong_cubic_spring_still_gets_its_report(self):
        done = self.call("identify", self.cubic("strong", "3e15"), "-o", "strong")
        self.assertIn(done.returncode, (0, 3), done.stderr)
        self.assertTrue((WORK / "strong/report.html").exists())
        again = self.call("report", "strong", "-o", "again.html")
        self.assertEqual(again.returncode, done.returncode, again.stderr)

    def test_the_nonlinearity_is_named_before_the_modes_that_it_causes(self):
        done = self.call("identify", self.cubic("many", "1e15", ("fit:\n", "fit:\n  modes: 12\n")), "-o", "many")
        summary = json.loads((WORK / "many/summary.json").read_text())
        self.assertRegex(summary["reasons"][0], "^the plant is nonlinear", done.stderr)
        page = (WORK / "many/report.html").read_text()
        self.assertIn("the plant is nonlinear", page)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
