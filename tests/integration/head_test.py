#!/usr/bin/python3
"""Eight bad cases: what the head of each result says is wrong, that it is the same in the terminal, in --json and on the
page, and that the command that it suggests removes the cause, after the repair that it asks for.

    head_test.py PROGRAM CONFIGS WORK_DIR
"""

import json
import pathlib
import shlex
import shutil
import sys
import unittest

import h5py
import numpy as np

from processes import ProcessTest

PROGRAM, CONFIGS, WORK = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
CUBIC = ("  plate:", "  cubic_stiffness_n_m3: 1e15\n  plate:")
VALIDATION = "\nvalidation:\n  realization: 3                   # held back from the fit; counts from 1\n"


def head_on(page):
    """The object `verdict` of a page."""
    text = (WORK / page).read_text()
    return json.JSONDecoder().raw_decode(text, text.index('"verdict":{') + len('"verdict":'))[0]


class HeadTest(ProcessTest):
    program, folder = PROGRAM, WORK

    @classmethod
    def setUpClass(cls):
        shutil.rmtree(WORK, ignore_errors=True)
        WORK.mkdir(parents=True)
        cls.configure("base")
        for words in (["identify", "base.yaml", "-o", "base"], ["log", "convert", "base/run.slog", "-o", "run.h5"]):
            done = cls.call(*words)
            assert done.returncode == 0, done.stderr

    @staticmethod
    def configure(name, *changes):
        """NAME.yaml: the small experiment, and its stage, with (text, replacement)."""
        experiment = (CONFIGS / "experiment/small_stage.yaml").read_text().replace(
            "../stage/small_stage.yaml", f"{name}_stage.yaml")
        stage = (CONFIGS / "stage/small_stage.yaml").read_text()
        for old, new in changes:
            assert old in experiment or old in stage, old
            experiment, stage = experiment.replace(old, new), stage.replace(old, new)
        (WORK / f"{name}.yaml").write_text(experiment)
        (WORK / f"{name}_stage.yaml").write_text(stage)

    def tells(self, code, *words):
        """The object that a command prints with --json."""
        done = self.call(*words, "--json")
        self.assertEqual(done.returncode, code, f"{words}\n{done.stdout}{done.stderr}")
        return json.loads(done.stdout)

    def first(self, verdict, cause):
        head = verdict["head"]
        self.assertTrue(1 <= len(head) <= 3, head)
        self.assertEqual(head[0]["cause"], cause, head)
        self.assertTrue(verdict["reasons"][0].startswith(head[0]["what"]), verdict)
        return head[0]

    def agree(self, code, cause, model, frf):
        """The first problem, the same in `validate`, `report` and on the page."""
        first = self.first(self.tells(code, "validate", model, "base/frf_validation.h5"), cause)
        told = self.call("validate", model, "base/frf_validation.h5").stdout
        self.assertIn(f": {first['what']}", told)
        self.assertIn(f"    {first['command']}\n", told)
        report = self.tells(code, "report", model, frf, "-o", "page.html")
        self.assertEqual(self.first(report["verdict"], cause)["what"], first["what"])
        self.assertEqual(head_on("page.html"), report["verdict"])
        self.assertEqual(head_on("page.html")["level"], "bad" if code else "doubt")
        return first

    def identified(self, name, cause):
        """The first problem of `identify NAME.yaml`."""
        first = self.first(self.tells(3, "identify", f"{name}.yaml", "-o", name), cause)
        self.assertEqual(head_on(f"{name}/report.html")["head"][0], first)
        self.assertEqual(self.agree(3, cause, f"{name}/model.json", f"{name}/frf.h5")["what"], first["what"])
        return first

    def fitted(self, name, log, cause):
        """The first problem of a fit to a log."""
        self.call("frf", log, "-o", f"{name}_frf.h5", "--realizations", "1,2")
        words = ["fit", f"{name}_frf.h5", "-o", f"{name}_model.json", "--band", 120, 800]
        first = self.first(self.tells(3, *words), cause)
        told = self.call(*words).stderr
        self.assertIn(f"{name}_model.json: not to be trusted: {first['what']}", told)
        self.assertIn(f"    {first['command']}\n", told)
        return self.agree(3, cause, f"{name}_model.json", f"{name}_frf.h5")

    def spoilt(self, name, change):
        """A copy of the sound log after change(sensors) of each run."""
        shutil.copy(WORK / "run.h5", WORK / name)
        with h5py.File(WORK / name, "r+") as log:
            for run in log["runs"].values():
                run["sensors"][:] = change(run["sensors"][:])
        return name

    def obey(self, problem, code=0):
        """Runs the suggested command. @returns what it prints with --json"""
        program, *words = shlex.split(problem["command"])
        self.assertEqual(program, "stageid")
        if words[0] == "run":
            (WORK / words[-1]).unlink(missing_ok=True)  # of another case
        return self.tells(code, *words)

    def test_a_sound_result_has_an_empty_head(self):
        told = self.tells(0, "validate", "base/model.json", "base/frf_validation.h5")
        self.assertEqual((told["trustworthy"], told["head"], told["reasons"]), (True, [], []))
        self.assertEqual(head_on("base/report.html")["level"], "good")

    def test_too_few_modes(self):
        self.configure("few", ("fit:\n", "fit:\n  modes: 1\n"))
        first = self.identified("few", "missing_modes")
        self.assertRegex(first["what"], r"modes are missing at 422\.\d, 488\.\d, 56[67](\.\d)? Hz")
        self.assertEqual(self.obey(first)["head"], [])
        self.tells(0, "validate", "few/model.json", "few/frf_validation.h5")

    def test_a_nonlinear_plant(self):
        """Cubic springs, and a fit with more modes than the plant has: they model the distortion."""
        self.configure("cubic", CUBIC, ("fit:\n", "fit:\n  modes: 12\n"))
        first = self.identified("cubic", "nonlinear")
        self.assertRegex(first["what"], r"s\d <- a\d between 16 and 44 Hz \(-\d+ dB")
        spurious = self.tells(3, "validate", "cubic/model.json", "cubic/frf_validation.h5")["head"][1]
        self.assertEqual(spurious["cause"], "undetermined")
        self.assertEqual(self.obey(spurious)["head"][0]["cause"], "nonlinear")
        self.configure("cubic", CUBIC, ("{rms_n: 1.0}", "{rms_n: 0.05}"))
        self.assertEqual(self.obey(first)["head"], [])

    def test_swapped_sensors(self):
        first = self.fitted("swapped", self.spoilt("swapped.h5", lambda sensors: sensors[:, ::-1]), "swapped")
        self.assertRegex(first["what"], "^s1 s2: ")
        self.obey(first)

    def test_one_realization_of_a_nonlinear_plant(self):
        one = (("realizations: 3", "realizations: 1"), (VALIDATION, "\n"))
        self.configure("one", CUBIC, *one)
        first = self.identified("one", "one_realization")
        self.configure("one", CUBIC)
        self.assertEqual(self.obey(first)["head"][0]["cause"], "nonlinear")
        # Of a linear plant, it is a doubt.
        self.configure("linear", *one)
        self.first(self.tells(0, "identify", "linear.yaml", "-o", "linear"), "one_realization")
        self.agree(0, "one_realization", "linear/model.json", "linear/frf.h5")

    def test_records_that_are_not_settled(self):
        self.configure("light", ("damping: [0.02, 0.015]", "damping: [0.0008]"),
                       ("transient_periods: 2", "transient_periods: 1"))  # fmt: skip
        first = self.identified("light", "unsettled")
        self.assertNotIn("unsettled", [found["cause"] for found in self.obey(first)["health"]])

    def test_a_delay_that_is_not_declared(self):
        self.configure("delay", ("fit:\n", "fit:\n  delay_s: 0\n"))
        first = self.identified("delay", "delay")
        self.assertRegex(first["what"], r"^a delay of 0\.0006 s instead of 0 s")
        self.assertEqual(self.obey(first)["head"], [])

    def test_noise_alone(self):
        self.configure("noise", ("{rms_n: 1.0}", "{rms_n: 1e-7}"), ("force_n: 1e-4", "force_n: 1e-5"))
        first = self.identified("noise", "noise")
        self.configure("noise")
        self.assertEqual(self.obey(first)["head"], [])

    def test_a_clipped_sensor(self):
        def clip(sensors):
            limit = 0.6 * np.abs(sensors[:, 1]).max()
            return np.stack([sensors[:, 0], np.clip(sensors[:, 1], -limit, limit)], axis=1)

        first = self.fitted("clipped", self.spoilt("clipped.h5", clip), "saturated")
        self.assertRegex(first["what"], "^s2: ")
        self.obey(first)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
