#!/usr/bin/env python3
"""All 17 actuators and 7 sensors of the shipped stage, from the design to the report: exit code 0, every mode, and figures that
channels without a response do not decide.

    whole_stage_test.py PROGRAM CONFIGS WORK_DIR
"""

import json
import pathlib
import shutil
import subprocess
import sys
import unittest

PROGRAM, CONFIGS, WORK = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])


class WholeStageTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        shutil.rmtree(WORK, ignore_errors=True)
        WORK.mkdir(parents=True)
        cls.done = subprocess.run([PROGRAM, "identify", CONFIGS / "experiment/wafer_stage_full.yaml", "-o", WORK / "out"],
                                  capture_output=True, text=True, check=False)
        (WORK / "out/run.slog").unlink(missing_ok=True)  # 2 GB

    def test_it_is_done_and_finds_every_mode(self):
        self.assertEqual(self.done.returncode, 0, self.done.stderr)
        summary = json.loads((WORK / "out/summary.json").read_text())
        modes = summary["truth"]["modes"]
        self.assertEqual(len(modes), 20)
        self.assertTrue(all(mode["found"] for mode in modes), modes)
        self.assertEqual(summary["truth"]["extra_modes_hz"], [])
        # Half of the errors of the measured FRF are below 0.4 % (see the stage file); the model's are smaller.
        self.assertLess(summary["truth"]["relative_rms_error"], 0.05)
        self.assertLess(summary["truth"]["normalized_error"], 0.005)
        # x and y actuators do not move z sensors, z actuators neither x nor y sensors.
        errors = summary["validation"]["channel_error"]
        self.assertEqual(len(errors), 7 * 17)
        names = [*(f"z{i}" for i in range(1, 14)), "x1", "x2", "y1", "y2"]
        for channel, error in enumerate(errors):
            out_of_plane = channel % 7 < 4
            self.assertEqual(error is not None, out_of_plane == names[channel // 7].startswith("z"), channel)

    def test_the_report_is_written_and_says_so(self):
        page = (WORK / "out/report.html").read_text()
        self.assertIn("error against the exact plant", page)
        self.assertIn("error of the model against the exact plant:", self.done.stdout)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
