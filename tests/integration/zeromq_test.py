#!/usr/bin/env python3
"""The example node behind ZeroMQ, docs/examples/firmware/zeromq_node.c, in a process of its own: measured, killed,
started again, with a second host, under garbage.

    zeromq_test.py STAGEID SOURCE_DIR WORK_DIR
"""

import contextlib
import csv
import ctypes
import json
import pathlib
import random
import re
import resource
import signal
import socket
import struct
import subprocess
import sys
import time

from example_firmware import CAN, ExampleFirmware
from peers import (ARM, CAN_COMMAND, CAN_STATE, DOWNLOAD, HELLO, START, STOP, TRIGGER, UPLOAD, ZeroMqHub, ZeroMqPeer,
                   can_command, resident_bytes, sealed)
from processes import ProcessTest, run_side_by_side

PROGRAM, SOURCE, WORK = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
UPLOAD_CHUNK = 0x300
MEASURING = "state 5,"
CONTROLLER = "  memset(u_n, 0, STAGE_ACTUATORS * sizeof *u_n);\n"
FEED_FORWARD = ("  static unsigned n;\n  u_n[0] = 0.05 + 0.02 * sin(0.0157079632679489662 * n++) - 10.0 * y_m[0];\n"
                "  u_n[1] = -10.0 * y_m[1];\n")


def message(identifier, data):
    """A frame in its 72 bytes."""
    return struct.pack("<HHI", identifier, len(data), 0) + data.ljust(64, b"\0")


def command(*words, **more):
    return message(CAN_COMMAND, can_command(*words, **more))


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Peer(ZeroMqPeer):
    def state_after(self, text):
        """The answer to a command: (answer, rejected)."""
        self.send(text)
        while True:
            got = self.frame()
            if struct.unpack_from("<H", got)[0] == CAN_STATE and got[8:10] == text[8:10]:
                return got[8 + 10], struct.unpack_from("<I", got, 8 + 20)[0]


class ZeroMq(ProcessTest):
    program, folder = PROGRAM, WORK

    @classmethod
    def setUpClass(cls):
        cls.example = ExampleFirmware(SOURCE, WORK)
        subprocess.run([PROGRAM, "config", "header", "stage_zeromq.yaml", "-o", "stage.h"], cwd=WORK, check=True,
                       stdout=subprocess.DEVNULL)
        sources = ["zeromq_node.c", *CAN]
        cls.example.build("node", sources, "-lzmq")
        cls.example.build("slow_node", sources, "-lzmq", "-DSAMPLES_PER_TICK=1")
        # A loop of the node with a feed-forward: a constant, and a sine of 0.5 Hz, which is a line of the excitation.
        text = (WORK / "can_resident.c").read_text()
        assert CONTROLLER in text
        (WORK / "feed_forward.c").write_text("#include <math.h>\n" + text.replace(CONTROLLER, FEED_FORWARD))
        cls.example.build("forward_node", [s.replace("can_resident", "feed_forward") for s in sources], "-lzmq")

    def setUp(self):
        self.port = free_port()
        stage = (WORK / "stage_zeromq.yaml").read_text().replace("5555", str(self.port))
        (self.folder / "stage.yaml").write_text(stage)
        short = (WORK / "experiment.yaml").read_text()
        (self.folder / "experiment.yaml").write_text(short)
        for old, new in (("axes: [z1, z2]", "axes: [z1]"), ("period_s: 10", "period_s: 4"), ("band_hz: [0.4", "band_hz: [0.5"),
                         ("transient_periods: 3", "transient_periods: 1")):
            self.assertIn(old, short)
            short = short.replace(old, new)
        (self.folder / "short.yaml").write_text(short)

    def node(self, name="node"):
        node = self.spawn(WORK / name, f"tcp://127.0.0.1:{self.port}")
        self.wait_for(node, "state 1,")
        return node

    def wait_for(self, node, state):
        while not (line := node.stdout.readline()).startswith(state):
            self.assertNotEqual(line, "", "the node has ended")
        return line

    def start(self, experiment="short", log="run.slog", *options):
        return self.spawn_run(f"{experiment}.yaml", "-o", log, *options)

    def measuring(self, experiment="short"):
        """A node and a host that measures with it."""
        node = self.node("slow_node")
        host = self.start(experiment)
        self.wait_for(node, MEASURING)
        return node, host

    def ends(self, process, code, text="", warnings=0):
        _, err = process.communicate(timeout=120)
        said = [line for line in err.splitlines() if line.startswith("stageid:")]
        self.assertEqual(process.returncode, code, err)
        if text:
            self.assertRegex(err, text)
        self.assertEqual(len(said), int(code != 0) + warnings, err)
        if (self.folder / "run.slog").exists():
            self.succeed("log", "verify", "run.slog")

    def test_the_modes_are_those_of_the_stage(self):
        self.node()
        self.check_modes()

    def test_a_feed_forward_of_the_node_is_in_the_record(self):
        stage = (self.folder / "stage.yaml").read_text()
        self.assertIn("controller: {}", stage)
        (self.folder / "stage.yaml").write_text(re.sub(r"controller: \{\}.*", "controller: peer", stage))
        self.node("forward_node")
        self.check_modes(warnings=2)  # that the loop of the node is not tested, and its signals not predicted
        self.succeed("log", "convert", "run.slog", "-o", "run.csv")
        with open(self.folder / "run.csv", newline="") as file:
            forces = [float(row["actuator z1 [N]"]) for row in csv.DictReader(file)]
        self.assertAlmostEqual(sum(forces) / len(forces), 0.05, delta=0.01)

    def check_modes(self, warnings=0):
        self.ends(self.start("experiment"), 0, warnings=warnings)
        self.succeed("frf", "run.slog", "-o", "frf.h5")
        done = self.succeed("--json", "fit", "frf.h5", "-o", "model.json", "--rigid-body", "none")
        found = sorted(mode["natural_frequency_hz"] for mode in json.loads(done.stdout)["modes"])
        self.example.check_modes(self, found)

    def test_nobody_is_there(self):
        self.ends(self.start(), 1, "no node answered")
        self.assertFalse((self.folder / "run.slog").exists(), "nothing was measured: no log")

    def test_a_killed_node(self):
        node, host = self.measuring()
        node.kill()
        self.ends(host, 1, f"127.0.0.1:{self.port}: no node answered")

    def test_a_node_that_was_started_again(self):
        node, host = self.measuring()
        node.kill()
        node.wait()
        self.node("slow_node")
        self.ends(host, 1, "restarted")
        (self.folder / "run.slog").unlink()
        self.ends(self.start(), 0)

    def test_a_killed_host_leaves_the_stage_without_forces(self):
        node, host = self.measuring()
        host.kill()
        host.communicate()
        killed = time.monotonic()
        self.assertRegex(self.wait_for(node, "state 8,"), "cause 1, forces 0 0 N")
        self.assertLess(time.monotonic() - killed, 3.0)
        (self.folder / "run.slog").unlink(missing_ok=True)
        self.ends(self.start(), 1, "in fault .*--reset-fault")
        self.ends(self.start("short", "run.slog", "--reset-fault"), 0)

    def test_ctrl_c_stops_the_stage(self):
        node, host = self.measuring()
        host.send_signal(2)
        self.ends(host, 130, "interrupted; the measured data are kept")
        self.wait_for(node, "state 1,")

    def test_a_second_host_is_refused_and_the_first_one_completes(self):
        _, first = self.measuring()
        second = self.start("short", "second.slog")
        _, err = second.communicate(timeout=60)
        self.assertEqual(second.returncode, 1, err)
        self.assertIn("another host", err)
        self.ends(first, 0)

    # 10 000 commands and 20 000 chunks that are sealed but forged, 100 000 random messages, 20 connections of no ZeroMQ.
    def test_forged_and_random_messages_change_nothing(self):
        (self.folder / "long.yaml").write_text((self.folder / "short.yaml").read_text().replace("  periods: 3", "  periods: 16"))
        quiet = self.node()
        self.ends(self.start("long"), 0)
        self.succeed("log", "convert", "run.slog", "-o", "quiet.csv")
        self.end(quiet)
        (self.folder / "run.slog").unlink()
        node, host = self.measuring("long")
        dice, sizes = random.Random(5), (0, 1, 8, 71, 72, 72, 73, 300)
        peer = Peer(self.port)
        before = peer.state_after(command(HELLO, 1))[1]
        memory = resident_bytes(node.pid)
        forged = [command(code, 7, 3, 0, 800, 0, session=dice.getrandbits(32))
                  for code in (START, STOP, UPLOAD, ARM, TRIGGER, DOWNLOAD)]
        chunk = message(UPLOAD_CHUNK, sealed(UPLOAD_CHUNK, struct.pack("<HBBH", 0, 0, 4, 56), bytes(56), 64))
        for i in range(10_000):
            burst = [(forged[i % len(forged)],), (chunk,), (chunk,)]
            for _ in range(10):
                burst.append([dice.randbytes(dice.choice(sizes)) for _ in range(dice.choice((1, 1, 2)))])
            peer.socket.sendall(b"".join(peer.encode(*parts) for parts in burst))
            if i % 500 == 0:
                with socket.create_connection(("127.0.0.1", self.port)) as other:
                    other.sendall(dice.randbytes(200))
            if i % 100 == 0:  # what the node answered must not fill its queue for this peer
                answer, rejected = peer.state_after(command(HELLO, 1000 + i // 100))
                self.assertEqual(answer, 1)
        self.assertGreater(rejected - before, 100_000)
        self.assertLess(resident_bytes(node.pid) - memory, 8 << 20)
        self.assertIsNone(host.poll(), "the run lasts longer than the attack")
        peer.close()
        self.ends(host, 0)
        self.succeed("log", "convert", "run.slog", "-o", "loud.csv")
        self.assertEqual((self.folder / "quiet.csv").read_bytes(), (self.folder / "loud.csv").read_bytes(), "a sample differs")

    def test_a_thousand_idle_and_a_hundred_slow_clients_change_nothing(self):
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, 4096), hard))  # the node inherits it
        self.addCleanup(resource.setrlimit, resource.RLIMIT_NOFILE, (soft, hard))
        node = self.node("slow_node")
        before = resident_bytes(node.pid)
        host = self.start()
        self.wait_for(node, MEASURING)
        with contextlib.ExitStack() as clients:
            for _ in range(1000):
                clients.enter_context(socket.create_connection(("127.0.0.1", self.port), timeout=10))
            slow = [Peer(self.port) for _ in range(100)]  # they never read what the node sends to those who gave a command
            for peer in slow:
                clients.callback(peer.close)
                peer.send(command(HELLO, 1))
            self.ends(host, 0)
            (self.folder / "run.slog").unlink()
            self.ends(self.start(), 0)
            self.assertLess(resident_bytes(node.pid) - before, 64 << 20)

    @contextlib.contextmanager
    def behind_a_hub(self, nodes, name="node"):
        """The last of the nodes, a run of a host, and the hub between them."""
        ports = []
        hub_port = self.port
        for _ in range(nodes):
            self.port = free_port()
            ports.append(self.port)
            node = self.node(name)
        with socket.create_server(("127.0.0.1", hub_port)) as server:
            server.settimeout(10)
            host = self.start()
            with contextlib.closing(ZeroMqHub(server, ports)) as hub:
                yield node, host, hub

    def test_two_nodes_behind_one_address_are_refused(self):
        with self.behind_a_hub(2) as (_, host, _):
            self.ends(host, 1, "two nodes answer")
        self.assertFalse((self.folder / "run.slog").exists(), "nothing was measured: no log")

    def end_under_a_flood(self, code, text, number=None):
        with self.behind_a_hub(1, "slow_node") as (node, host, hub):
            self.wait_for(node, MEASURING)
            node.send_signal(signal.SIGSTOP)
            if number:
                host.send_signal(number)
            hub.flooded.set()
            began = time.monotonic()
            self.ends(host, code, text)
            self.assertLess(time.monotonic() - began, 10.0)

    def test_a_frozen_node_is_noticed_on_a_wire_that_is_never_silent(self):
        self.end_under_a_flood(1, "no node answered")

    def test_ctrl_c_ends_a_run_on_a_wire_that_is_never_silent(self):
        self.end_under_a_flood(130, "interrupted", signal.SIGINT)

    def test_garbage_instead_of_a_node(self):
        with socket.create_server(("127.0.0.1", self.port)) as server:
            server.settimeout(10)
            host = self.start()
            peer = Peer(accepted=server.accept()[0], kind=b"ROUTER")
            dice = random.Random(6)
            for _ in range(2000):
                peer.send(dice.randbytes(dice.choice((0, 8, 71, 72, 72, 72, 73, 3000))))
            self.ends(host, 1, "no node answered")
            peer.close()

    def test_streaming_is_refused(self):
        stage = (self.folder / "stage.yaml").read_text()
        (self.folder / "stage.yaml").write_text(stage.replace("mode: resident ", "mode: streaming "))
        self.ends(self.start(), 2, "ZeroMQ carries resident experiments over a single bus; set mode: resident")

    def test_the_header_describes_the_messages(self):
        """Only structures of numbers and arrays, with names and without padding: what importers of C types support."""
        for compiler in (["cc", "-std=c99"], ["c++", "-x", "c++"]):
            subprocess.run([*compiler, "-Wall", "-Wpedantic", "-Wpadded", "-Werror", "-fsyntax-only", "stage.h"], cwd=WORK,
                           check=True)
        text = subprocess.run(["cc", "-E", "-P", "stage.h"], cwd=WORK, check=True, capture_output=True, text=True).stdout
        text = text[text.rindex("typedef struct", 0, text.index("stageid_message")):]  # without the system's
        structure, member = r"typedef struct \{([^{}]*)\} (stageid_\w+);", r"(\w+) (\w+)(?:\[(\d+)\])?;"
        numbers = {f"uint{bits}_t": getattr(ctypes, f"c_uint{bits}") for bits in (8, 16, 32, 64)} | {"float": ctypes.c_float}
        types = {}
        for members, name in re.findall(structure, text):
            self.assertEqual(re.sub(member, "", members).split(), [], name)
            fields = [(field, numbers[kind] * int(size) if size else numbers[kind])
                      for kind, field, size in re.findall(member, members)]
            types[name] = type(name, (ctypes.LittleEndianStructure,), {"_fields_": fields})
        rest = re.sub(structure, "", text).split(";")
        self.assertEqual([declaration.split()[:2] for declaration in rest if declaration.strip()], [["extern", "char"]])

        order = types["stageid_command"](a=1, b=2, c=3, d=4, host=5, session=6, version=2)
        self.assertEqual(can_command(HELLO, 7, 1, 2, 3, 4, 5, 6), sealed(CAN_COMMAND, bytes(
            types["stageid_header"](sequence=7, kind=HELLO))[:6], bytes(order), 48))
        self.node()
        with contextlib.closing(Peer(self.port)) as peer:
            for data in (b"?", command(HELLO, 1, host=77)):
                peer.send(data)
            got = types["stageid_message"].from_buffer_copy(peer.frame())
        state = types["stageid_state"].from_buffer_copy(bytes(got.data)[8:])
        fingerprint = int(re.search(r"FINGERPRINT 0x(\w+)u", (WORK / "stage.h").read_text())[1], 16)
        self.assertEqual((got.id, got.length, state.version, state.answer, state.rejected, state.fingerprint, state.host),
                         (CAN_STATE, 48, 2, 1, 1, fingerprint, 77))

    def test_a_header_of_another_stage_is_refused(self):
        other = ExampleFirmware(SOURCE, WORK / "other")
        header = (WORK / "stage.h").read_text()
        (other.folder / "stage.h").write_text(re.sub(r"FINGERPRINT 0x\w+", "FINGERPRINT 0x1u", header))
        other.build("node", ["zeromq_node.c", *CAN], "-lzmq")
        done = subprocess.run([other.folder / "node"], capture_output=True, text=True, timeout=10)
        self.assertEqual(done.returncode, 1)
        self.assertIn("another stage", done.stderr)


if __name__ == "__main__":
    sys.exit(run_side_by_side(ZeroMq, 3, alone=["test_forged_and_random_messages_change_nothing"]))
