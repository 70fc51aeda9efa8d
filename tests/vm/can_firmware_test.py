#!/usr/bin/env python3
"""The example firmware behind CAN FD, docs/examples/firmware: streaming, resident, without its host, with two hosts.

    can_firmware_test.py PROGRAM SOURCE_DIR [unittest arguments]

To be run inside the machine of vmrun.sh, which has vcan0.
"""

import json
import pathlib
import struct
import subprocess
import sys
import time
import unittest

from can_machine import FRAME, node_state, raw_socket, wait_for_state

sys.path.append(str(pathlib.Path(__file__).parents[1] / "integration"))
from example_firmware import CAN, ExampleFirmware  # noqa: E402
from peers import CAN_COMMAND, CAN_STATE, START, can_command, sealed  # noqa: E402

PROGRAM, SOURCE = sys.argv[1], pathlib.Path(sys.argv[2])
WORK = pathlib.Path("/tmp/can_firmware")
WATCHDOG_S = 2.0
DELAY_S = 5.0  # of a machine in a machine


SETPOINT, LIMIT = 0x100, 2


def send(identifier, data):
    with raw_socket("vcan0") as raw:
        raw.send(FRAME.pack(identifier, len(data), 1, 0, 0, data))


def send_setpoint(run, sequence):
    """A setpoint for two actuators, in a frame of 16 bytes."""
    send(SETPOINT, sealed(SETPOINT, struct.pack("<HBBH", sequence, 0, run, 0x1234), bytes([0, 0, 0x10] * 2), 16))


def rejected():
    """Frames that the node has rejected, from its next state."""
    with raw_socket("vcan0") as raw:
        while True:
            data = raw.recv(FRAME.size)
            if len(data) == FRAME.size and FRAME.unpack(data)[0] == CAN_STATE:
                return struct.unpack_from("<I", FRAME.unpack(data)[5], 20)[0]


class Firmware(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.example = ExampleFirmware(SOURCE, WORK)
        sources = ["socketcan_node.c", *CAN]
        cls.example.build("can_node", sources)
        cls.example.build("drifting_node", sources, plant=SOURCE / "tests/integration/drifting_plant.c")
        stage = (WORK / "stage_can.yaml").read_text().replace("interface: can0", "interface: vcan0")
        stage = stage.replace("can:\n", "can:\n  reply_timeout_s: 0.1\n", 1)
        experiment = (WORK / "experiment.yaml").read_text()
        for mode in ("streaming", "resident"):
            (WORK / f"stage_{mode}.yaml").write_text(stage.replace("mode: streaming", f"mode: {mode}"))
            (WORK / f"{mode}.yaml").write_text(experiment.replace("stage.yaml", f"stage_{mode}.yaml"))

    def setUp(self):
        self.start_node("can_node")

    def start_node(self, name):
        self.node = subprocess.Popen([WORK / name, "vcan0", str(int(1000 * WATCHDOG_S))],
                                     stdout=subprocess.PIPE, text=True)
        self.assertIn("state 1", self.node.stdout.readline())

    def tearDown(self):
        self.node.kill()
        self.node.wait()
        self.node.stdout.close()

    def call(self, *words):
        return subprocess.run([PROGRAM, *map(str, words)], cwd=WORK, capture_output=True, text=True, timeout=300)

    def start(self, mode, log, *options):
        return subprocess.Popen([PROGRAM, "run", f"{mode}.yaml", "-o", log, *options], cwd=WORK,
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def check_modes(self, mode, *options):
        (WORK / f"{mode}.slog").unlink(missing_ok=True)
        done = self.call("run", f"{mode}.yaml", "-o", f"{mode}.slog", *options)
        self.assertEqual(done.returncode, 0, done.stderr)
        done = self.call("frf", f"{mode}.slog", "-o", "frf.h5")
        self.assertEqual(done.returncode, 0, done.stderr)
        done = self.call("--json", "fit", "frf.h5", "-o", "model.json", "--rigid-body", "none")
        self.assertEqual(done.returncode, 0, done.stderr)
        found = sorted(mode["natural_frequency_hz"] for mode in json.loads(done.stdout)["modes"])
        self.example.check_modes(self, found)

    def test_streaming(self):
        self.check_modes("streaming")

    def test_resident(self):
        self.check_modes("resident")

    def test_a_killed_host_leaves_the_stage_without_forces(self):
        host = self.start("streaming", "killed.slog", "--pace", "0.1")
        wait_for_state("measuring")
        time.sleep(1.0)
        host.kill()
        killed = time.monotonic()
        host.communicate()
        self.assertEqual(wait_for_state("fault"), ("fault", "watchdog"))
        self.assertLess(time.monotonic() - killed, WATCHDOG_S + DELAY_S)
        self.assertRegex([self.node.stdout.readline() for _ in range(2)][-1], r"^state 8, cause 1, forces 0 0 N$")
        done = self.call("run", "streaming.yaml", "-o", "refused.slog")
        self.assertEqual(done.returncode, 1, done.stderr)
        self.check_modes("resident", "--reset-fault")

    def test_the_limits_hold_without_setpoints(self):
        for seed, motion in ((1, "out of the window"), (2, "too fast")):
            with self.subTest(motion):
                self.tearDown()
                self.start_node("drifting_node")
                began = time.monotonic()
                send(CAN_COMMAND, can_command(START, 1, seed))
                states = [self.node.stdout.readline() for _ in range(2)]
                self.assertLess(time.monotonic() - began, WATCHDOG_S)
                self.assertRegex(states[1], f"^state 8, cause {LIMIT}, forces 0 0 N$")

    def test_a_second_host_is_refused(self):
        first = self.start("streaming", "first.slog", "--pace", "0.1")
        wait_for_state("measuring")
        for mode in ("streaming", "resident"):
            done = self.call("run", f"{mode}.yaml", "-o", f"second_{mode}.slog")
            self.assertEqual(done.returncode, 1, done.stderr)
            self.assertIn("another host", done.stderr)
        before = rejected()
        for run in range(256):
            send_setpoint(run, 1000)
        until = time.monotonic() + DELAY_S  # the next state may be older than the last of the frames
        while (now := rejected()) < before + 256 and time.monotonic() < until:
            pass
        self.assertEqual(now, before + 256)
        self.assertEqual(node_state(), ("measuring", "none"))
        self.assertIsNone(first.poll())
        first.kill()
        first.communicate()


if __name__ == "__main__":
    unittest.main(argv=["can_firmware_test.py", *sys.argv[3:]], verbosity=2)
