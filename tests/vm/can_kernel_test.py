#!/usr/bin/env python3
"""The stage behind a real CAN kernel: `stageid run` against `stageid node` in another process.

    can_kernel_test.py PROGRAM SOURCE_DIR [unittest arguments]

To be run inside the machine of vmrun.sh, which has vcan0. Every row of the fault matrix says what
happens, the exit code and the words that the user reads; the outputs must be safe afterwards and
the log intact. The times within which faults are detected are exact in tests/hal/can/can_fault_test.cpp,
where the clock is the bus'; here everything must only end.
"""

import signal
import subprocess
import sys
import unittest

from can_equality_test import Decoding, Equality  # noqa: F401, found by unittest
from can_machine import SHORT, CanTest, counts, node_state, send_error, shell, wait_for_state

ERROR_CONTROLLER, ERROR_BUS_OFF, TX_PASSIVE = 0x4, 0x40, 0x20
FOREVER = "x1000000000"


class FrameFaults(CanTest):
    """Faults of measurement frames, as the node is asked to make them."""

    ROWS = [
        ("lost", "lost@3000", 0, ""),
        ("repeated", "repeated@3000x500", 0, ""),
        ("swapped", "swapped@3000x1", 0, ""),
        ("late", "late@3000:0.004", 0, ""),
        ("corrupt", "corrupt@3000x2", 0, ""),
        ("short", "shortened@3000x2", 0, ""),
        ("foreign", "foreign@3000x2", 0, ""),
        ("four lost", "lost@3000x4", 3, "1 cycle is missing, 2 samples are marked"),
        ("four corrupt", "corrupt@3000x4", 3, "1 cycle is missing, 2 samples are marked"),
        ("all lost", "lost@3000" + FOREVER, 1, "too many bad cycles; the last one: stale"),
        ("all corrupt", "corrupt@3000" + FOREVER, 1, "the last one: corrupt"),
        ("all short", "shortened@3000" + FOREVER, 1, "the last one: corrupt"),
        ("all foreign", "foreign@3000" + FOREVER, 1, "the last one: stale"),
        ("all late", "late@3000" + FOREVER + ":0.5", 1, "the last one: stale"),
    ]

    def test_rows(self):
        name = self.machine.configure("frames", experiment=SHORT)
        for label, fault, code, text in self.ROWS:
            with self.subTest(label), self.machine.node(name, "--can-fault", fault):
                out = self.ends(self.machine.start(name), code, text)
                if code == 0:
                    self.assertEqual(counts(out)["marked"], 0)
                self.assertIn(wait_for_rest(), ("switch on disabled", "fault"))


def wait_for_rest():
    """The state in which no force acts; fails if none comes."""
    for _ in range(40):
        state = node_state()[0]
        if state in ("switch on disabled", "fault"):
            return state
    raise AssertionError(f"forces still act: {state}")


class Interventions(CanTest):
    """Something happens to a process or an interface in the middle of a run."""

    def setUp(self):
        self.name = self.machine.configure("b")

    def begin(self, *arguments):
        process = self.machine.start(self.name, "run", *arguments)
        self.machine.wait_until_running(process)
        return process

    def test_node_killed(self):
        with self.machine.node(self.name) as node:
            process = self.begin()
            node.kill()
            self.ends(process, 1, "too many bad cycles; the last one: stale", "did not answer")

    def test_node_frozen(self):
        with self.machine.node(self.name) as node:
            process = self.begin()
            node.send_signal(signal.SIGSTOP)
            self.ends(process, 1, "stale")
            node.send_signal(signal.SIGCONT)
            self.assertIn(wait_for_rest(), ("switch on disabled", "fault"))

    def test_node_restarted(self):
        with self.machine.node(self.name) as node:
            process = self.begin()
            process.send_signal(signal.SIGSTOP)  # the host must detect the new node, not the gap
            node.kill()
            node.wait()
            with self.machine.node(self.name):
                process.send_signal(signal.SIGCONT)
                self.ends(process, 1, "the node was restarted")

    def test_node_told_to_end(self):
        with self.machine.node(self.name) as node:
            process = self.begin()
            node.terminate()
            self.assertEqual(node.wait(10), 0)
            self.assertIn("at rest: switch on disabled", node.stdout.read())
            self.ends(process, 1, "stage 'small stage' reports: fault", "quick stop")

    def test_host_killed(self):
        with self.machine.node(self.name):
            process = self.begin()
            process.kill()
            process.communicate()
            self.assertEqual(wait_for_state("fault"), ("fault", "watchdog"))
            code, _, err = self.machine.run(self.name)
            self.assertEqual(code, 1)
            self.assertRegex(err, r"in fault \(the host stopped sending.*\); remove the cause and add --reset-fault")
            self.ends(self.machine.start(self.name, "run", "--reset-fault"), 0)

    def test_host_interrupted(self):
        for number in (signal.SIGINT, signal.SIGTERM):
            with self.subTest(number.name), self.machine.node(self.name):
                process = self.begin()
                process.send_signal(number)
                self.ends(process, 130, "interrupted; the measured data are kept")
                wait_for_state("switch on disabled")

    def test_bus_off(self):
        with self.machine.node(self.name):
            process = self.begin()
            send_error("vcan0", ERROR_BUS_OFF)
            self.ends(process, 1, "reports: bus off", "vcan0: bus off")
            self.assertEqual(wait_for_state("fault"), ("fault", "bus off"))

    def test_error_passive(self):
        with self.machine.node(self.name):
            process = self.begin()
            send_error("vcan0", ERROR_CONTROLLER, TX_PASSIVE)
            self.ends(process, 1, "the last one: bus passive", "vcan0: error passive")
            self.assertIn(wait_for_rest(), ("switch on disabled", "fault"))

    def test_interface_down(self):
        with self.machine.node(self.name):
            process = self.begin()
            shell("ip link set vcan0 down")
            try:
                self.ends(process, 1, "vcan0: interface down")
            finally:
                shell("ip link set vcan0 up")
            self.assertEqual(wait_for_state("fault")[0], "fault")

    def test_garbage_of_others_does_no_harm(self):
        with self.machine.node(self.name):
            garbage = [subprocess.Popen(["cangen", "vcan0", "-f", "-g", "20", "-I", i, "-L", "r"])
                       for i in ("080", "100", "180", "200", "r")]
            try:
                out = self.ends(self.machine.start(self.name), 0)
            finally:
                for sender in garbage:
                    sender.kill()
                    sender.wait()
        self.assertEqual(counts(out)["marked"], 0)


class StageFaults(CanTest):
    """What the stage itself does wrong, seen through the wire."""

    ROWS = [
        ("sensor no number", "kind: nan_sensor, channel: s1", 4,
         "sensor s1: the measurement is not finite"),
        ("sensor stuck", "kind: stuck_sensor, channel: s1", 4, "sensor s1: has repeated"),
        ("sensor dead", "kind: dead_sensor, channel: s2", 1, "the last one: incomplete"),
        ("samples missed", "kind: missed_cycle, cycles: 100", 1, "the last one: stale"),
        ("interlock", "kind: interlock", 1, "the stage reported a fault"),
        # A stuck force is not visible on the bus, only in the FRF.
        ("actuator stuck", "kind: stuck_actuator, channel: a1", 0, ""),
    ]

    def test_rows(self):
        for label, fault, code, text in self.ROWS:
            name = self.machine.configure(
                "faults", stage=[("noise:", "faults: [{%s, from_cycle: 700}]\nnoise:" % fault)])
            with self.subTest(label), self.machine.node(name):
                self.ends(self.machine.start(name), code, text)
                self.assertIn(wait_for_rest(), ("switch on disabled", "fault"))

    def test_limits(self):
        for mode in ("streaming", "resident"):
            name = self.machine.configure("limits", mode=mode,
                                          experiment=[("rms_n: 1.0", "rms_n: 30")])
            with self.subTest(mode), self.machine.node(name):
                self.ends(self.machine.start(name), 4, "actuator a", "limit")
                self.assertIn(wait_for_rest(), ("switch on disabled", "fault"))

    def test_no_node(self):
        name = self.machine.configure("alone")
        code, _, err = self.machine.run(name)
        self.assertEqual(code, 1)
        self.assertIn("can: vcan0: no node answered", err)
        self.assertFalse((self.machine.at / "run.slog").exists(), "nothing was measured: no log")

    def test_no_interface(self):
        name = self.machine.configure("nowhere", interfaces=("vcan9",))
        code, _, err = self.machine.run(name)
        self.assertEqual(code, 1)
        self.assertIn("can: vcan9: unknown interface", err)

    def test_another_stage_file(self):
        self.machine.configure("mine")
        self.machine.configure("yours", group=", actuator_range_n: [60]")
        with self.machine.node("yours"):
            code, _, err = self.machine.run("mine")
        self.assertEqual(code, 1)
        self.assertIn("started with a different stage file", err)


class Resident(CanTest):
    def setUp(self):
        self.name = self.machine.configure("r", mode="resident")

    def test_node_killed(self):
        with self.machine.node(self.name, "--pace", "1") as node:
            process = self.machine.start(self.name)
            self.machine.wait_until_running(process)
            node.kill()
            self.ends(process, 1, "no node answered")

    def test_host_killed(self):
        with self.machine.node(self.name, "--pace", "0.2"):
            process = self.machine.start(self.name)
            wait_for_state("measuring")
            process.kill()
            process.communicate()
            self.assertEqual(wait_for_state("fault"), ("fault", "watchdog"))

    def test_host_interrupted(self):
        with self.machine.node(self.name, "--pace", "0.2"):
            process = self.machine.start(self.name)
            wait_for_state("measuring")
            process.send_signal(signal.SIGTERM)
            self.ends(process, 130, "interrupted; the measured data are kept")
            wait_for_state("switch on disabled")


class Netem(CanTest):
    """Loss, delay and a bus that is too slow: a vxcan pair, the node in a network of its own."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        shell("ip netns add node; ip link add vxa type vxcan peer name vxb; ip link set vxb netns node;"
              "ip link set vxa mtu 72 up; ip -n node link set vxb mtu 72 up;"
              "insmod /usr/lib/uml/modules/$(uname -r)/kernel/net/sched/sch_netem.ko")

    def disturbed(self, disturbance, code, *texts, mode="streaming", arguments=()):
        stage = self.machine.configure("vx", interfaces=("vxa",), mode=mode)
        prefix = ("ip", "netns", "exec", "node")
        shell(f"tc qdisc replace dev vxa root netem {disturbance}")
        try:
            with self.machine.node(stage, interface="vxb", prefix=prefix):
                return self.ends(self.machine.start(stage, "run", *arguments), code, *texts)
        finally:
            shell("tc qdisc del dev vxa root")

    def test_loss_heals_in_virtual_time(self):
        out = self.disturbed("loss 2%", 0)
        self.assertEqual(counts(out)["marked"], 0)

    def test_loss_of_half_ends_a_run_by_the_wall_clock(self):
        self.disturbed("loss 50%", 1, "too many bad cycles", arguments=("--pace", "0.1"))

    def test_delay_is_nothing_in_virtual_time(self):
        self.disturbed("delay 1ms", 0)

    def test_delay_of_many_samples_ends_a_run_by_the_wall_clock(self):
        self.disturbed("delay 20ms", 1, "too many bad cycles", arguments=("--pace", "1"))

    def test_a_bus_that_is_too_slow(self):
        self.disturbed("rate 200kbit limit 2", 1, "the bus is too slow", arguments=("--pace", "1"))

    def test_resident_transfers_heal(self):
        self.disturbed("loss 20%", 0, mode="resident")


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]], verbosity=2)
