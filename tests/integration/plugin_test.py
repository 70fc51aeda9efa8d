#!/usr/bin/env python3
"""A back end of somebody else: docs/examples/plugin/udp_stage.c, built outside the tree against the header alone,
measures the small stage in another process.

plugin_test.py STAGEID UDP_PEER SOURCE_DIR WORK_DIR
"""

import json
import math
import pathlib
import re
import shutil
import subprocess
import sys
import time
import unittest

from processes import ProcessTest

PROGRAM, PEER, SOURCE, WORK = sys.argv[1:5]
STAGE = pathlib.Path(SOURCE) / "configs/stage/small_stage.yaml"
EXPERIMENT = pathlib.Path(SOURCE) / "configs/experiment/small_stage.yaml"


class Plugin(ProcessTest):
    program = PROGRAM

    @classmethod
    def setUpClass(cls):
        cls.work = pathlib.Path(WORK)
        shutil.rmtree(cls.work, ignore_errors=True)
        cls.work.mkdir(parents=True)
        shutil.copy(f"{SOURCE}/docs/examples/plugin/udp_stage.c", cls.work)
        shutil.copy(f"{SOURCE}/hal/plugin/stageid_backend.h", cls.work)
        subprocess.run(["cc", "-Wall", "-Wextra", "-Werror", "-O2", "-shared", "-fPIC", "-o", "udp_stage.so",
                        "udp_stage.c"], cwd=cls.work, check=True)

    def peer(self, *options, stage=STAGE):
        """The port of a device in another process."""
        self.device = self.spawn(PEER, stage, *options)
        return int(self.device.stdout.readline())

    def experiment(self, name, plugin):
        stage = STAGE.read_text().replace("backend: sim", f"backend: plugin\nplugin: {plugin}")
        (self.work / f"{name}_stage.yaml").write_text(stage)
        file = self.work / f"{name}.yaml"
        file.write_text(EXPERIMENT.read_text().replace("../stage/small_stage.yaml", f"{name}_stage.yaml"))
        return file

    def udp(self, name, port):
        return self.experiment(name, f"{{library: ./udp_stage.so, keys: {{port: {port}}}}}")

    def test_measures_the_small_stage(self):
        log = self.work / "good.slog"
        self.succeed("run", self.udp("good", self.peer()), "-o", log)
        frf, model = self.work / "frf.h5", self.work / "model.json"
        self.succeed("frf", log, "-o", frf)
        done = self.succeed("--json", "fit", frf, "-o", model, "--rigid-body", "suspension:0.4:0.5", "--direct-term", "full")
        modes = [mode["natural_frequency_hz"] for mode in json.loads(done.stdout)["modes"]]
        self.succeed("identify", EXPERIMENT, "-o", self.work / "truth")
        true_modes = json.loads((self.work / "truth/summary.json").read_text())["truth"]["modes"]
        flexible = [m["true_frequency_hz"] for m in true_modes if m["true_frequency_hz"] > 16]
        self.assertGreaterEqual(len(flexible), 4)
        for true_hz in flexible:
            nearest = min(modes, key=lambda hz: abs(hz - true_hz))
            self.assertLess(abs(nearest / true_hz - 1.0), 1e-4)

    def test_a_silent_stage_ends_the_run_and_the_rest_is_measured_later(self):
        log = self.work / "silent.slog"
        port = self.peer(4000)
        experiment = self.udp("silent", port)
        done = self.call("run", experiment, "-o", log)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.end(self.device)
        self.peer(0, port)
        self.succeed("run", experiment, "-o", log, "--resume")

    # The stage of the stop matrix: 20 kg, 650 N, a window of 200 um (docs/stops.md).
    AXIS = """
format: stageid-stage
name: one axis
backend: sim
sample_rate_hz: 10000
delay_s: 130e-6
actuators: [{name: f, unit: N, position_m: [0, 0, 0], direction: [0, 0, 1], limit_n: 650}]
sensors: [{name: s, unit: m, position_m: [0, 0, 0], direction: [0, 0, 1], window_m: 200e-6}]
plant:
  mass_kg: 20
  inertia_kg_m2: [1, 1, 1]
  suspension_hz: [0.3, 0.3, 0.3, 0.3, 0.3, 0.3]
  suspension_damping: 0.1
  plate: {length_x_m: 0.5, length_y_m: 0.5, first_mode_hz: 200, modes: 0, damping: [0.01]}
noise: {sensor_m: 1e-9, force_n: 1e-3, seed: 1}
controller:
  z: {crossover_hz: 60, integrator_hz: 5, lead_zero_hz: 18, lead_pole_hz: 240, lowpass_hz: 600}
"""
    AXIS_EXPERIMENT = """
format: stageid-experiment
stage: axis_stage.yaml
experiment: {axes: [f], level: {rms_n: 10}, lines: all, band_hz: [10, 1000], period_s: 0.1, transient_periods: 1,
             periods: 1000, realizations: 1, seed: 7}
"""
    WATCHDOG_S = 0.1

    def axis(self, cycles=0):
        """A run of 100 s, as fast as the device answers."""
        stage, file, log = (self.work / name for name in ("axis_stage.yaml", "axis.yaml", "axis.slog"))
        for old in self.work.glob("axis*"):
            old.unlink()
        stage.write_text(self.AXIS)
        port = self.peer(cycles, 0, self.WATCHDOG_S, stage=stage)
        stage.write_text(self.AXIS.replace(
            "backend: sim", f"backend: plugin\nplugin: {{library: ./udp_stage.so, keys: {{port: {port}}}}}"))
        file.write_text(self.AXIS_EXPERIMENT)
        return self.spawn_run(file, "-o", log), log

    def device_rests(self):
        """The device has stopped by itself, within two windows."""
        said = self.device.stdout.readline()
        print(said, end="", file=sys.stderr)
        found = re.match(r"the host stopped sending.*: (\d+) um, (\d+) N, (\d+) ms, (\S+) mm/s$", said)
        self.assertTrue(found, said)
        self.assertLess(int(found[1]), 400)
        self.assertLessEqual(int(found[2]), 650)
        self.assertLess(float(found[4]), 1.0)
        return [float(value) for value in found.groups()[:3]]

    def wait_for_samples(self, log):
        while not log.exists() or log.stat().st_size < 100_000:
            time.sleep(0.01)

    def check_link_down(self, host):
        _, said = host.communicate(timeout=60)
        self.assertEqual(host.returncode, 1, said)
        self.assertRegex(said, "link down")

    def check_log(self, log, marked):
        self.succeed("log", "verify", log)
        done = self.call("log", "info", log, "--json")
        self.assertEqual([r["health"]["marked"] for r in json.loads(done.stdout)["runs"]], [marked])

    def test_a_device_whose_host_is_killed_stops(self):
        host, log = self.axis()
        self.wait_for_samples(log)
        host.kill()
        host.communicate()
        self.device_rests()
        self.succeed("log", "recover", log, "-o", self.work / "axis_recovered.slog")

    def test_a_cut_wire_ends_the_run_and_the_device_stops(self):
        host, log = self.axis(cycles=20_000)
        self.check_link_down(host)
        told = re.search(r"^\| wire lost \| - \| (\d+) um, (\d+) N, (\d+) ms, 1, 1 \|",
                         (pathlib.Path(SOURCE) / "docs/stops.md").read_text(), re.M)
        for here, there in zip(self.device_rests(), told.groups()):
            self.assertLess(abs(here - float(there)), 2 + 0.05 * here)
        self.check_log(log, 1)

    def test_a_killed_device_ends_the_run(self):
        host, log = self.axis()
        self.wait_for_samples(log)
        self.device.kill()
        self.check_link_down(host)
        self.check_log(log, 1)

    def without_plant(self, name, port, **changes):
        """The stage file of a real stage: no plant, the gains of the controller in N/m and N m/rad."""
        def gain(inertia):
            crossover, integrator, zero, pole, low = (2j * math.pi * hz for hz in (20, 2, 6, 80, 200))
            x = crossover / abs(low)
            controller = ((1 + abs(integrator) / crossover) * (crossover / abs(zero) + 1)
                          / (crossover / abs(pole) + 1) / (x * x + 1.4 * x + 1))
            return inertia * abs(crossover) ** 2 / abs(controller)
        file = self.udp(name, port)
        stage = self.work / f"{name}_stage.yaml"
        text = stage.read_text()
        text = text[:text.index("plant:")] + "controller:" + text[text.index("controller:") + len("controller:"):]
        text = text.replace("z: &loop {", f"z: {{gain: {gain(8.0)}, ")
        axis = text[text.index("z: {") + 3:].split("}")[0] + "}"
        text = text.replace("Ry: *loop", "Ry: " + axis.replace(str(gain(8.0)), str(gain(0.25))))
        for old, new in changes.items():
            text = text.replace(old, new)
        stage.write_text(text)
        return file, stage

    def test_a_real_stage_needs_no_plant_and_can_be_held(self):
        file, stage = self.without_plant("real", self.peer(), stuck_sensor_s="between_runs: hold\nstuck_sensor_s")
        self.assertNotIn("plant:", stage.read_text())
        for checked in (file, stage):
            done = self.succeed("config", "check", checked)
            self.assertIn("stability of the loop is not tested: there is no 'plant'", done.stderr)
        done = self.succeed("design", file, "-o", self.work / "blind.h5")
        self.assertIn("signals are not predicted: the stage file has no 'plant'", done.stderr)
        log, frf = self.work / "real.slog", self.work / "real.h5"
        self.succeed("run", file, "-o", log)
        done = self.succeed("--json", "frf", log, "-o", frf, "--stage", stage)
        findings = json.loads(done.stdout)["health"]
        self.assertEqual([f for f in findings if f["severity"] in ("fault", "doubt")], [])
        self.assertTrue(any("geometry and mass" in f["remedy"] for f in findings), findings)
        # What the pilot says replaces the plant: the loop is tested and the signals are predicted.
        designed = self.work / "designed.yaml"
        designed.write_text(file.read_text().replace(
            "level: {rms_n: 1.0}", "level: {limits: {prior: real.h5}}\n  crest_iterations: 20"))
        done = self.succeed("design", designed, "-o", self.work / "designed.h5")
        self.assertNotIn("not tested", done.stderr)
        done = self.call("run", file, "-o", self.work / "sim.slog", "--backend", "sim")
        self.assertEqual(done.returncode, 2)
        self.assertIn("has no group 'plant', which is the simulated stage", done.stderr)
        self.succeed("identify", file, "-o", self.work / "all")
        self.assertNotIn("truth", json.loads((self.work / "all/summary.json").read_text()))

    def test_is_supervised_and_shown_like_any_other(self):
        plant = (self.work / "plant.yaml")
        plant.write_text(STAGE.read_text())
        node = self.spawn(PROGRAM, "node", plant, "--modbus-tcp", 0, "--modbus-fault", "interlock@12")
        door = re.search(r"127\.0\.0\.1:(\d+)", node.stdout.readline())[1]
        file = self.udp("supervised", self.peer())
        stage = self.work / "supervised_stage.yaml"
        stage.write_text(stage.read_text() + f"supervisor: {{modbus: {{tcp: {{port: {door}}}}}, poll_period_s: 0.1, gravity_compensator_n: [10, 50],\n"
                         "  temperature_k: [285, 325]}\n")
        file.write_text(re.sub(r"realizations: \d+", "realizations: 60", file.read_text()))
        log = self.work / "supervised.slog"
        done = self.call("run", file, "-o", log, "--dashboard", "0")
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("the interlock is open", done.stderr)
        self.assertRegex(done.stderr, r"dashboard: http://127\.0\.0\.1:\d+/\?token=")
        self.assertIn(self.call("log", "verify", log).returncode, (0, 3))

    def refused(self, name, plugin, *words):
        done = self.call("run", self.experiment(name, plugin), "-o", self.work / f"{name}.slog")
        self.assertEqual(done.returncode, 1, done.stderr)
        for word in words:
            self.assertIn(word, done.stderr)

    def test_refuses_what_is_no_back_end(self):
        self.refused("missing", "{library: ./nothing.so}", "nothing.so", "cannot be loaded")
        (self.work / "text.so").write_text("no library")
        self.refused("text", "{library: ./text.so}", "text.so", "cannot be loaded")
        (self.work / "other.c").write_text("int other(void) { return 1; }\n")
        subprocess.run(["cc", "-shared", "-fPIC", "-o", "other.so", "other.c"], cwd=self.work, check=True)
        self.refused("other", "{library: ./other.so}", "stageid_get_backend()")
        source = (self.work / "udp_stage.c").read_text()
        (self.work / "old.c").write_text(source.replace("calls = {STAGEID_BACKEND_VERSION", "calls = {99"))
        subprocess.run(["cc", "-shared", "-fPIC", "-o", "old.so", "old.c"], cwd=self.work, check=True)
        self.refused("old", "{library: ./old.so}", "interface version 99")
        self.refused("portless", "{library: ./udp_stage.so}", "write keys")
        self.refused("nobody", "{library: ./udp_stage.so, keys: {port: 9}}", "does not answer")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
