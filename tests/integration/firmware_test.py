#!/usr/bin/env python3
"""The example firmware, docs/examples/firmware: built outside the tree, measured over Modbus TCP, disturbed, and
compared request by request with `stageid node`.

firmware_test.py STAGEID SOURCE_DIR WORK_DIR [TEST ...]
"""

import ctypes
import json
import pathlib
import re
import struct
import subprocess
import sys
import time
import unittest

from example_firmware import CAN, MODBUS, ExampleFirmware
from peers import ModbusClient, number, words
from processes import ProcessTest

PROGRAM, SOURCE, WORK = sys.argv[1], *map(pathlib.Path, sys.argv[2:4])
WATCHDOG_S = 2.6
DELAY_S = 1.0  # of a busy machine

ENABLE, DISABLE, QUICK_STOP, RESET = 1, 2, 3, 4
BEGIN, END = 1, 2
DISABLED, ENABLED, MEASURING, FAULT = 1, 4, 5, 8
LIMIT = 2
BUSY = "exception 6"


class NodeHere(ModbusClient):
    """The logic of the node in this process, on a clock of its own, and the position of its stage."""

    def __init__(self, library):
        self.library = ctypes.CDLL(str(library))
        self.position_m = ctypes.c_double.in_dll(self.library, "offset_m")
        self.node, self.now_us = ctypes.create_string_buffer(1 << 16), 2 ** 32 - 5000
        self.library.stage_node_init(self.node, 4711, 1000000)
        self.tick(0)

    def tick(self, elapsed_us):
        self.now_us = (self.now_us + elapsed_us) % 2 ** 32
        self.library.stage_node_tick(self.node, ctypes.c_uint32(self.now_us), 1)

    def send(self, pdu, unit=1):
        reply = ctypes.create_string_buffer(253)
        size = self.library.stage_node_answer(self.node, 1, pdu, ctypes.c_size_t(len(pdu)), reply)
        return reply.raw[:size]


class Firmware(ProcessTest):
    program = PROGRAM

    @classmethod
    def setUpClass(cls):
        cls.work = WORK
        cls.example = ExampleFirmware(SOURCE, WORK)
        cls.stage_text = (WORK / "stage.yaml").read_text()
        cls.example.build("node", MODBUS)
        drifting = SOURCE / "tests/integration/drifting_plant.c"
        cls.example.build("drifting_node", MODBUS, plant=drifting)
        cls.example.build("node.so", MODBUS[1:], "-shared", "-fPIC", plant=drifting)

    def start(self, *command):
        """A node whose first lines contain its port."""
        node = self.spawn(*command, stderr=subprocess.STDOUT)
        for line in node.stdout:
            found = re.search(r"(?:port |127\.0\.0\.1:)(\d+)", line)
            if found:
                return node, int(found.group(1))
        self.fail("the node does not start")

    def firmware(self, name="node"):
        node, port = self.start(self.work / name, 0, int(1000 * WATCHDOG_S))
        text = self.stage_text
        for example, test in (("port: 1502", f"port: {port}"), ("response_s: 0.2", "response_s: 1"),
                              ("worst_reply_s: 0.5", "worst_reply_s: 1.5")):
            self.assertIn(example, text)
            text = text.replace(example, test)
        (self.work / "stage.yaml").write_text(text)
        return node, port

    def client(self, port):
        client = ModbusClient(port)
        self.addCleanup(client.close)
        return client

    def identify(self, name, *options, between=lambda process: None):
        """Frequencies of the modes, in Hz."""
        log, frf, model = (self.work / f"{name}.{kind}" for kind in ("slog", "h5", "json"))
        process = self.spawn_run(self.work / "experiment.yaml", "-o", log, *options)
        between(process)
        _, errors = process.communicate(timeout=50)
        self.assertEqual(process.returncode, 0, errors)
        self.succeed("frf", log, "-o", frf)
        done = self.succeed("--json", "fit", frf, "-o", model, "--rigid-body", "none")
        found_hz = [mode["natural_frequency_hz"] for mode in json.loads(done.stdout)["modes"]]
        self.example.check_modes(self, found_hz)
        return found_hz

    def wait_for(self, client, state, seconds):
        end = time.monotonic() + seconds
        while client.state() != state:
            self.assertLess(time.monotonic(), end, f"state {client.state()}; expected {state}")
            time.sleep(0.005)

    def check_forces_are_zero(self, node, state, cause):
        for line in node.stdout:
            if line.startswith(f"state {state}, cause {cause},"):
                self.assertRegex(line, r"forces 0 0 N$")
                return
        self.fail("the node ended")

    def test_the_can_node_compiles(self):
        # can_firmware_test.py runs it, in a machine with CAN.
        self.example.build("can_node", ["socketcan_node.c", *CAN])

    def test_measures_the_modes_and_refuses_a_second_host(self):
        _, port = self.firmware()
        undisturbed = self.identify("undisturbed")
        intruder = self.client(port)

        def intrude(process):
            self.wait_for(intruder, MEASURING, 10)
            while process.poll() is None:
                self.assertEqual(intruder.setpoint(1, 1000000, (1 << 24, 1 << 24)), BUSY)
                self.assertEqual(intruder.run_command(END, 77, 1), BUSY)
                self.assertEqual(intruder.write(28, [1, 2, 3]), BUSY)
                self.assertEqual(intruder.read(304, 2), [0, 0], "the key is secret")
                self.assertEqual(intruder.read(24, 2), [0, 0], "the key is secret")

        # The seed of the run is that of the noise: the same experiment gives the same numbers.
        self.assertEqual(self.identify("disturbed", between=intrude), undisturbed)

    def test_a_killed_host_leaves_the_stage_without_forces(self):
        node, port = self.firmware()
        client = self.client(port)
        host = self.spawn_run(self.work / "experiment.yaml", "-o", self.work / "killed.slog", "--pace", 0.1)
        self.wait_for(client, MEASURING, 10)
        while number(client.read(302, 2)) < 10 or not any(client.read(28, 4)):
            time.sleep(0.005)
        host.kill()
        killed = time.monotonic()
        host.communicate()
        self.wait_for(client, FAULT, WATCHDOG_S + DELAY_S)
        self.assertLess(time.monotonic() - killed, WATCHDOG_S + DELAY_S)
        self.assertEqual(number(client.read(210, 2)), 1)
        self.check_forces_are_zero(node, FAULT, 1)
        done = self.call("run", self.work / "experiment.yaml", "-o", self.work / "refused.slog")
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("--reset-fault", done.stderr)
        self.identify("after", "--reset-fault")

    def test_the_limits_hold_without_setpoints(self):
        """A host that is silent for less than the watchdog, and a stage that moves meanwhile."""
        for seed, motion, longest_s in ((1, "out of the window", 0.25 + DELAY_S), (2, "too fast", DELAY_S)):
            with self.subTest(motion):
                node, port = self.firmware("drifting_node")
                host = self.client(port)
                self.assertEqual(host.command(ENABLE), 1)
                key = number(host.run_command(BEGIN, 5, seed=seed), 4)
                host.setpoint(key, 1, (1 << 20, 1 << 20))
                self.wait_for(host, FAULT, longest_s)
                self.check_forces_are_zero(node, FAULT, LIMIT)
                self.assertEqual(number(host.setpoint(key, 2), 6), 8 | FAULT << 8 | LIMIT << 16)

    def test_the_speed_limit_is_exact(self):
        # 0.2 m/s by ticks of 1 ms, and noise of 0.1 um between ticks of 10 us.
        for step_m, tick_us, ticks, state in ((0.19e-3, 1000, 20, MEASURING), (0.21e-3, 1000, 1, FAULT),
                                              (0.1e-6, 10, 1000, MEASURING)):
            with self.subTest(step_m=step_m):
                node = NodeHere(self.work / "node.so")
                self.assertEqual(node.command(ENABLE), 1)
                node.run_command(BEGIN, 5)
                for n in range(ticks):
                    node.position_m.value = step_m * (n + 1 if tick_us == 1000 else n % 2)
                    node.tick(tick_us)
                self.assertEqual(node.state(), state)
                node.position_m.value = 0

    def test_a_lost_heartbeat_stops_the_stage(self):
        node, port = self.firmware()
        client, other = self.client(port), self.client(port)
        self.assertEqual(client.command(ENABLE), 1)
        self.assertEqual(client.write(0, words(5)), [])
        self.assertEqual(other.write(0, words(6)), BUSY)
        began = time.monotonic()
        self.wait_for(client, FAULT, 1.0 + DELAY_S)
        self.assertGreater(time.monotonic() - began, 0.9)
        self.assertEqual(number(client.read(210, 2)), 9)
        self.check_forces_are_zero(node, FAULT, 9)

    def test_a_host_is_refused_while_another_measures(self):
        _, port = self.firmware()
        owner = self.client(port)
        self.assertEqual(owner.command(ENABLE), 1)
        key = number(owner.run_command(BEGIN, 5), 4)
        second = self.spawn_run(self.work / "experiment.yaml", "-o", self.work / "second.slog")
        n = 0
        while second.poll() is None:
            n += 1
            reply = owner.setpoint(key, n)
            self.assertEqual((number(reply, 2), number(reply, 6)), (n, MEASURING << 8))
            time.sleep(0.01)
        self.assertEqual(second.returncode, 1)
        self.assertIn("another host", second.communicate()[1])
        self.assertEqual(number(owner.run_command(END, 6, key), 4), key)
        self.assertEqual(owner.state(), ENABLED)

    def conversation(self, port):
        """Requests, most of them wrong, and what a node answers to them."""
        one, two = self.client(port), self.client(port)
        said = []

        def note(what, reply, part=slice(None)):
            said.append((what, reply[part] if isinstance(reply, list) else reply))

        note("identity", one.read(200, 4))
        note("description", [one.read(first, 58) for first in range(500, 732, 58)])
        note("end of the map", one.read(731, 2))
        note("unused registers", one.read(732 - 100, 90))
        note("read 126", one.read(0, 126))
        note("read 0", one.read(0, 0))
        note("function 4", one.ask(struct.pack(">BHH", 4, 200, 2)))
        note("function 5", one.ask(struct.pack(">BHH", 5, 0, 0)))
        note("unit 2", one.ask(struct.pack(">BHH", 3, 200, 2), unit=2))
        note("short", one.ask(struct.pack(">BH", 3, 200)))
        note("byte count", one.ask(struct.pack(">BHHBH", 16, 28, 1, 4, 0)))
        note("read only", one.write(208, words(4)))
        note("across the end", one.write(138, words(0, 0)))
        note("setpoint without a run", one.setpoint(0, 1))
        note("end without a run", one.run_command(END, 9))
        note("begin before enable", one.run_command(BEGIN, 10))
        note("unknown command", one.command(5))
        note("reset", one.command(RESET))
        note("quick stop", one.command(QUICK_STOP))
        note("disable", one.command(DISABLE))
        note("enable", [one.command(ENABLE), one.command(ENABLE), one.state(), two.command(RESET)])
        note("unknown run command", one.run_command(3, 11))
        begun = one.run_command(BEGIN, 12)
        key = number(begun, 4)
        note("begin", [key != 0, begun[2:4], begun[6:12], one.state()])
        note("begin again", one.run_command(BEGIN, 12) == begun)
        note("begin again with the key", one.run_command(BEGIN, 12, key) == begun)
        note("new begin", [one.run_command(BEGIN, 13), one.run_command(BEGIN, 14, key), two.run_command(BEGIN, 15)])
        note("the same sequence, foreign", two.run_command(BEGIN, 12))
        first = one.setpoint(key, 1, (1000, 2000))
        note("setpoint 1", first, slice(2, 4))
        note("status 1", first, slice(6, 12))
        note("setpoint again", one.setpoint(key, 1, (9, 9)) == first)
        note("older", one.setpoint(key, 0, (9, 9)) == first)
        note("much older", one.setpoint(key, 0x80000001, (9, 9)) == first)
        note("wrong key", [one.setpoint(key ^ 1, 2), two.setpoint(key, 2), two.run_command(END, 16, key)])
        note("seen by others", [two.read(304, 2), one.read(24, 2), two.read(302, 2)])
        gap = one.setpoint(key, 5)
        note("three missed", gap[2:4] + gap[6:8])
        note("disable while measuring", two.command(DISABLE))
        note("enable while measuring", two.command(ENABLE))
        ended = one.run_command(END, 17, key)
        note("end", [number(ended, 4) == key, ended[2:4], ended[6:16], one.state()])
        note("end again", one.run_command(END, 17, key) == ended)
        note("setpoint after the end", one.setpoint(key, 1), slice(2, 4))
        late = one.setpoint(key, 2)
        note("status after the end", [late[6:12], number(late, 4) == key])
        note("foreign setpoint after the end", two.setpoint(key, 3))
        again = number(two.run_command(BEGIN, 18), 4)
        note("another host", [again != 0, again != key, one.setpoint(key, 3), one.read(304, 2)])
        note("quick stop while measuring", one.command(QUICK_STOP))
        self.wait_for(one, DISABLED, 2)
        stopped = two.setpoint(again, 1)
        note("status after a quick stop", [stopped[2:4], stopped[6:12], number(stopped, 4) == again])
        note("enable", two.command(ENABLE))
        begun = two.run_command(BEGIN, 19)
        note("silent", begun[6:8])
        self.wait_for(one, FAULT, WATCHDOG_S + DELAY_S)
        failed = two.setpoint(number(begun, 4), 1)
        note("status after silence", [failed[2:4], failed[6:12], failed[4:6] == begun[4:6]])
        note("end after silence", two.run_command(END, 20, number(begun, 4)), slice(6, 12))
        note("in fault", [one.command(ENABLE), one.command(DISABLE), one.command(QUICK_STOP), one.state()])
        note("begin in fault", one.run_command(BEGIN, 21))
        note("reset", [one.command(RESET), one.state(), number(one.read(210, 2))])
        return said

    def test_answers_as_the_reference_node(self):
        _, port = self.firmware()
        _, reference = self.start(PROGRAM, "node", self.work / "stage.yaml", "--modbus-tcp", 0, "--watchdog", WATCHDOG_S)
        for ours, theirs in zip(self.conversation(port), self.conversation(reference), strict=True):
            with self.subTest(ours[0]):
                self.assertEqual(ours, theirs)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[4:]], verbosity=2)
