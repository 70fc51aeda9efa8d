#!/usr/bin/python3
"""`stageid watch` over logs of the simulated small stage: nothing is told without a change, every planted change is
told with its name and size, also while the log grows and by `run --watch`, and neither gaps nor damaged or foreign logs are changes.

    watch_test.py PROGRAM CONFIGS WORK_DIR
"""

import json
import pathlib
import shutil
import signal
import subprocess
import sys
import time
import unittest

import h5py
import numpy as np

from processes import ProcessTest

PROGRAM, CONFIGS, WORK = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
FROM_CYCLE = 160000  # 80 s, of which 2 are transient periods
MODE_HZ = 181.147    # mode 7 of the stage


class WatchTest(ProcessTest):
    program, folder = PROGRAM, WORK

    @classmethod
    def setUpClass(cls):
        shutil.rmtree(WORK, ignore_errors=True)
        shutil.copytree(CONFIGS, WORK / "configs")
        done = cls.call("identify", "configs/experiment/small_stage.yaml", "-o", "model")
        assert done.returncode == 0, done.stderr
        cls.record("same")

    @staticmethod
    def write_stage(fault=None):
        stage = (CONFIGS / "stage/small_stage.yaml").read_text()
        (WORK / "configs/stage/small_stage.yaml").write_text(stage + (f"\nfaults:\n  - {{{fault}}}\n" if fault else ""))

    @classmethod
    def record(cls, name, fault=None):
        """NAME.slog: 2 + 120 periods of 1 s, with a fault of the stage."""
        cls.write_stage(fault)
        (WORK / f"{name}.slog").unlink(missing_ok=True)
        done = cls.call("run", "configs/experiment/small_stage_watch.yaml", "-o", f"{name}.slog")
        assert (WORK / f"{name}.slog").exists(), done.stderr
        return done

    def watch(self, log, code, *flags):
        done = self.call("watch", "model/model.json", log, *flags, "--json")
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return json.loads(done.stdout)

    def only_change(self, fault):
        self.record("changed", f"{fault}, from_cycle: {FROM_CYCLE}")
        told = self.watch("changed.slog", 3)
        self.assertEqual(len(told["changes"]), 1, told["changes"])
        change = told["changes"][0]
        self.assertAlmostEqual(change["since_s"], FROM_CYCLE / 2000, delta=1.001)
        self.assertGreater(change["probability"], 0.95)
        return change, told

    def assert_size(self, change, size):
        self.assertLess(abs(change["size"] - size), 4 * change["deviation"] + 0.005 * abs(size), change)

    def test_no_change(self):
        told = self.watch("same.slog", 0, "-o", "same.h5", "--events", "same.jsonl")
        self.assertEqual((told["changes"], told["periods"], told["learning_periods"]), ([], 120, 32))
        self.assertEqual((WORK / "same.jsonl").read_text(), "")
        with h5py.File(WORK / "same.h5") as tracks:
            self.assertEqual(tracks["change"].shape, (120, len(told["tracked"])))
            np.testing.assert_array_equal(tracks["change"][-1], [t["change"] for t in told["tracked"]])
            self.assertTrue(np.all(tracks["statistic"][32:] < tracks["threshold"][32:]))
            self.assertEqual(list(tracks["learning"][30:34]), [1, 1, 0, 0])
            np.testing.assert_allclose(tracks["time_s"][:], np.arange(3, 123))
            self.assertEqual(tracks["statistics"].shape, (120, len(told["tracked"]) + 2))
            np.testing.assert_allclose(np.max(tracks["statistics"][32:], axis=1) <= tracks["statistic"][32:], True)
            np.testing.assert_allclose(np.sqrt(np.diag(tracks["covariance"])), tracks["deviation"][-1])
            lines = len(tracks["frequency_hz"])
            self.assertEqual(tracks["response"].shape, (lines, 2, 3))
            self.assertEqual(tracks["response_variance"].shape, (lines, 2, 3))
        done = self.call("fleet", "add", "same.db", "same.h5", "--stage", "A", "--json")
        self.assertEqual((done.returncode, json.loads(done.stdout)["values"]), (0, len(told["tracked"])), done.stderr)
        done = self.call("fleet", "query", "same.db", "watched", "--json")
        frequency = next(r for r in json.loads(done.stdout)["rows"] if "181.147" in r["property"] and r["kind"] == "frequency")
        self.assertAlmostEqual(frequency["value"], MODE_HZ, delta=1e-3)

    def test_frequency(self):
        change, told = self.only_change("kind: mode_frequency, mode: 7, value: 1e-4")
        self.assertEqual(change["kind"], "frequency")
        self.assertAlmostEqual(change["mode_hz"], MODE_HZ, places=2)
        self.assert_size(change, 1e-4)
        tracked = next(t for t in told["tracked"] if t["kind"] == "frequency" and "181.147" in t["name"])
        self.assertLess(abs(tracked["change"] - 1e-4), 5 * tracked["deviation"] + 1e-6)

    def test_damping(self):
        change, _ = self.only_change("kind: mode_damping, mode: 7, value: 0.02")
        self.assertEqual(change["kind"], "damping")
        self.assert_size(change, 0.02)

    def test_all_frequencies(self):
        change, _ = self.only_change("kind: mode_frequency, value: -1e-3")
        self.assertEqual(change["kind"], "all_frequencies")
        self.assert_size(change, -1e-3)

    def test_gains(self):
        change, _ = self.only_change("kind: sensor_gain, channel: s2, value: 1.01")
        self.assertEqual((change["kind"], change["channel"]), ("sensor_gain", "s2"))
        self.assert_size(change, 0.01)
        change, _ = self.only_change("kind: actuator_gain, channel: a2, value: 0")
        self.assertEqual((change["kind"], change["channel"]), ("actuator_gain", "a2"))
        self.assertIn("dead", change["text"])

    def test_delay(self):
        change, _ = self.only_change("kind: extra_delay, value: 1")
        self.assertEqual(change["kind"], "delay")
        self.assert_size(change, 5e-4)

    def test_noise(self):
        change, _ = self.only_change("kind: sensor_noise, channel: s1, value: 3")
        self.assertEqual((change["kind"], change["channel"]), ("noise", "s1"))
        self.assertAlmostEqual(change["size"], 2.0, delta=0.5)  # the force noise does not grow

    def test_a_gap_is_no_change(self):
        self.record("gap", f"kind: missed_cycle, from_cycle: {FROM_CYCLE}, cycles: 5")
        told = self.watch("gap.slog", 0)
        self.assertEqual((told["changes"], told["skipped_periods"]), ([], 1))

    def run_watched(self, fault=None, *flags, model="model/model.json"):
        for file in WORK.glob("live.*"):
            file.unlink()
        self.write_stage(fault)
        return self.call("run", "configs/experiment/small_stage_watch.yaml", "-o", "live.slog", "--watch", model, *flags, "--json")

    def events(self, name):
        lines = (WORK / "live.events.jsonl").read_text().splitlines()
        return [event for event in map(json.loads, lines) if event["event"] == name]

    def test_a_run_without_change(self):
        done = self.run_watched()
        self.assertEqual(done.returncode, 0, done.stderr)
        told = json.loads(done.stdout)["watch"]
        self.assertEqual((told["changes"], told["periods"], told["learning_periods"]), ([], 120, 32))
        self.assertEqual(told["tracked"], self.watch("live.slog", 0)["tracked"])
        self.assertEqual(self.events("change"), [])

    def test_a_run_with_a_change(self):
        done = self.run_watched(f"kind: mode_frequency, mode: 7, value: 1e-4, from_cycle: {FROM_CYCLE}")
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertIn("the stage has changed", done.stderr)
        told = json.loads(done.stdout)
        self.assertEqual((told["exit_code"], len(told["watch"]["changes"])), (3, 1))
        self.assertEqual(told["watch"]["changes"], self.watch("live.slog", 3)["changes"])
        event, = self.events("change")
        self.assertEqual(event["text"], told["watch"]["changes"][0]["text"])
        self.assertEqual(self.events("end")[0]["exit_code"], 3)
        # The log itself is whole: what the watch found is no property of the measurement.
        self.assertEqual(self.call("log", "verify", "live.slog").returncode, 0)

    def test_a_run_tells_the_change_at_once(self):
        self.write_stage(f"kind: sensor_gain, channel: s2, value: 1.01, from_cycle: {FROM_CYCLE}")
        (WORK / "told.slog").unlink(missing_ok=True)
        done = self.call("run", "configs/experiment/small_stage_watch.yaml", "-o", "told.slog", "--watch", "model/model.json")
        self.assertEqual(done.returncode, 3, done.stderr)
        lines = done.stdout.splitlines()
        self.assertRegex(lines[0], r"^8[2-5] s: gain of sensor 's2' changed by \+(0\.99|1)")
        self.assertRegex(lines[-1], "^watch: 120 periods, .* 1 event$")

    def test_a_failed_watch_does_not_fail_the_run(self):
        model = json.loads((WORK / "model/model.json").read_text())
        model["outputs"][0] = "s9"
        (WORK / "foreign.json").write_text(json.dumps(model))
        for flags, model, why in (([], "foreign.json", "s9"), (["--learn", "500"], "model/model.json", "nothing was watched")):
            done = self.run_watched(None, *flags, model=model)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertRegex(done.stderr, f"--watch: .*{why}")
            self.assertEqual(self.call("log", "verify", "live.slog").returncode, 0)

    def test_a_watch_that_cannot_begin_leaves_no_log(self):
        for flags, model in (([], "none.json"), (["--false-alarms", "3"], "model/model.json")):
            done = self.run_watched(None, *flags, model=model)
            self.assertIn(done.returncode, (1, 2))
            self.assertFalse((WORK / "live.slog").exists())

    def test_the_watch_yields_to_the_loop_and_ends_with_it(self):
        self.write_stage()
        with (WORK / "configs/stage/small_stage.yaml").open("a") as stage:
            stage.write("\nrealtime: {policy: off, misses_allowed: 1000000}\n")
        (WORK / "paced.slog").unlink(missing_ok=True)
        run = self.spawn_run("configs/experiment/small_stage_watch.yaml", "-o", "paced.slog", "--pace", "1", "--watch", "model/model.json")
        nice = lambda: {int(stat.read_text().rpartition(")")[2].split()[16]) for stat in pathlib.Path(f"/proc/{run.pid}/task").glob("*/stat")}
        until = time.monotonic() + 20
        while not (WORK / "paced.slog").exists() or len(nice()) < 2:
            self.assertLess(time.monotonic(), until, "no thread has another priority")
            time.sleep(0.05)
        self.assertEqual(max(nice()), 19)
        time.sleep(1)
        run.send_signal(signal.SIGINT)
        self.assertEqual(run.wait(timeout=30), 130)
        self.assertEqual(self.call("log", "verify", "paced.slog").returncode, 0)
        run.stderr.close()

    def test_a_resumed_run_is_watched_from_its_start(self):
        self.write_stage()
        text = (CONFIGS / "experiment/small_stage_watch.yaml").read_text()
        (WORK / "configs/experiment/two.yaml").write_text(text.replace("periods: 120", "periods: 30").replace("realizations: 1", "realizations: 2"))
        (WORK / "two.slog").unlink(missing_ok=True)
        self.succeed("run", "configs/experiment/two.yaml", "-o", "two.slog")
        content = (WORK / "two.slog").read_bytes()
        (WORK / "two.slog").write_bytes(content[: len(content) * 3 // 4])
        done = self.call("run", "configs/experiment/two.yaml", "-o", "two.slog", "--resume", "--watch", "model/model.json", "--learn", "8", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertGreaterEqual(json.loads(done.stdout)["watch"]["periods"], 60)

    def test_a_growing_log(self):
        self.record("whole", f"kind: mode_frequency, mode: 7, value: 1e-4, from_cycle: {FROM_CYCLE}")
        content = (WORK / "whole.slog").read_bytes()
        growing = WORK / "growing.slog"
        growing.write_bytes(content[: len(content) // 3])
        watching = subprocess.Popen([PROGRAM, "watch", "model/model.json", "growing.slog", "--follow", "--json", "--events",
                                     "growing.jsonl"], cwd=WORK, stdout=subprocess.PIPE, text=True)
        with growing.open("ab") as log:
            for part in range(len(content) // 3, len(content), 100003):
                log.write(content[part : part + 100003])
                log.flush()
                time.sleep(0.02)
        told, _ = watching.communicate(timeout=60)
        self.assertEqual(watching.returncode, 3)
        self.assertEqual(json.loads(told)["changes"], self.watch("whole.slog", 3)["changes"])
        event = json.loads((WORK / "growing.jsonl").read_text())
        self.assertEqual((event["event"], event["kind"]), ("change", "frequency"))

    def test_a_killed_watch_tells_the_same_when_started_again(self):
        self.record("killed", f"kind: mode_frequency, mode: 7, value: 1e-4, from_cycle: {FROM_CYCLE}")
        outputs = ["-o", "killed.h5", "--events", "killed.jsonl"]
        content = (WORK / "killed.slog").read_bytes()
        growing = WORK / "killed_growing.slog"
        growing.write_bytes(content[: len(content) * 3 // 4])
        for wait_s in (0.0, 0.1, 0.3, 1.0):
            watching = subprocess.Popen([PROGRAM, "watch", "model/model.json", growing.name, "--follow", *outputs], cwd=WORK,
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            time.sleep(wait_s)
            watching.kill()
            watching.wait()
            self.assertFalse((WORK / "killed.h5").exists(), "half a file under its name")
        growing.write_bytes(content)
        again = self.watch(growing.name, 3, "--follow", *outputs)
        whole = self.watch("killed.slog", 3, "-o", "whole.h5")
        self.assertEqual(again["changes"], whole["changes"])
        self.assertEqual((WORK / "killed.h5").read_bytes(), (WORK / "whole.h5").read_bytes())
        self.assertEqual(len((WORK / "killed.jsonl").read_text().splitlines()), 1, "told once")

    def test_a_cut_log(self):
        content = (WORK / "same.slog").read_bytes()
        (WORK / "cut.slog").write_bytes(content[: len(content) // 2])
        done = self.call("watch", "model/model.json", "cut.slog")
        self.assertEqual(done.returncode, 2)
        self.assertIn("log recover", done.stderr)

    def test_another_sample_rate(self):
        stage = (CONFIGS / "stage/small_stage.yaml").read_text().replace("sample_rate_hz: 2000", "sample_rate_hz: 1600")
        (WORK / "configs/stage/small_stage.yaml").write_text(stage)
        experiment = (CONFIGS / "experiment/small_stage_watch.yaml").read_text().replace("800]", "700]")
        (WORK / "configs/experiment/slower.yaml").write_text(experiment)
        done = self.call("run", "configs/experiment/slower.yaml", "-o", "slower.slog")
        self.assertEqual(done.returncode, 0, done.stderr)
        for tracked in self.watch("slower.slog", 0)["tracked"]:
            if tracked["kind"] in ("frequency", "delay"):  # a wrong hold would be a delay of 60 us
                self.assertLess(abs(tracked["change"]), 1e-4 if tracked["kind"] == "frequency" else 1e-6, tracked)

    def test_too_few_periods(self):
        told = self.watch("same.slog", 3, "--learn", "500")
        self.assertEqual((told["changes"], told["learning_periods"]), ([], 120))

    def test_a_model_of_another_stage(self):
        model = json.loads((WORK / "model/model.json").read_text())
        model["submodels"] = [model["submodels"][i] for i in range(2)]
        (WORK / "few.json").write_text(json.dumps(model))
        done = self.call("watch", "few.json", "same.slog", "--json")
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertIn("does not describe the response of sensor", done.stderr)

    def test_a_stage_that_differs_from_the_start(self):
        self.record("other", "kind: actuator_gain, channel: a1, value: 0.5")
        told = self.watch("other.slog", 3)
        self.assertEqual(told["changes"], [])
        self.assertIn("the stage differs from the model", self.call("watch", "model/model.json", "other.slog").stderr)

    def test_inputs_are_not_overwritten(self):
        before = (WORK / "model/model.json").read_bytes()
        for flag in ("--events", "-o"):
            for file in ("model/model.json", "same.slog"):
                done = self.call("watch", "model/model.json", "same.slog", flag, file)
                self.assertEqual(done.returncode, 2, (flag, file, done.stderr))
        self.assertEqual((WORK / "model/model.json").read_bytes(), before)

    def test_requests_that_cannot_be_met(self):
        for flags in (["--false-alarms", "3"], ["--false-alarms", "1/minute"], ["--band", "900", "950"], ["--learn", "2"]):
            done = self.call("watch", "model/model.json", "same.slog", *flags)
            self.assertEqual(done.returncode, 2, flags)
            self.assertEqual(done.stderr.count("\n"), 1, done.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
