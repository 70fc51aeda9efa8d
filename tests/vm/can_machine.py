"""What the CAN tests inside the machine share: the program, a node beside it, configurations, raw frames."""

import contextlib
import os
import pathlib
import re
import signal
import socket
import struct
import subprocess
import sys
import time
import unittest

ERROR_FLAG = 0x20000000
FRAME = struct.Struct("=IBBBB64s")
STATES = ["not ready", "switch on disabled", "ready", "switched on", "operation enabled",
          "measuring", "quick stop", "fault reaction", "fault"]
CAUSES = ["none", "watchdog", "limit", "not finite", "interlock", "amplifier", "gravity",
          "temperature", "bus off", "host heartbeat"]

SHORT = (("realizations: 3", "realizations: 2"), ("realization: 3", "realization: 2"))  # of the experiment


class Machine:
    """Runs the program on copies of the small configurations in an empty directory."""

    def __init__(self, program, source, directory):
        self.program = str(pathlib.Path(program).resolve())
        self.at = pathlib.Path(directory)
        self.at.mkdir(parents=True, exist_ok=True)
        configs = pathlib.Path(source) / "configs"
        self.stage_text = (configs / "stage/small_stage.yaml").read_text()
        self.experiment_text = (configs / "experiment/small_stage.yaml").read_text()

    def configure(self, name="a", interfaces=("vcan0",), group="", stage=(), experiment=(),
                  mode="streaming", axes="[a1]"):
        """Writes a stage behind CAN and its experiment; pairs (from, to) change the texts."""
        text = self.stage_text.replace("backend: sim", "backend: can")
        for old, new in stage:
            assert old in text, old
            text = text.replace(old, new)
        buses = ", ".join("{interface: %s}" % i for i in interfaces)
        if len(interfaces) == 2:
            buses = ("{interface: %s, actuators: [a1, a2], sensors: [s2]},"
                     "{interface: %s, actuators: [a3], sensors: [s1]}" % interfaces)
        # More than the usual 20 and 5 ms, because all processes share one processor.
        text += ("\ncan: {mode: %s, buses: [%s], watchdog_s: 0.2,"
                 " reply_timeout_s: 0.02%s}\n" % (mode, buses, group))
        (self.at / f"{name}_stage.yaml").write_text(text)
        text = self.experiment_text.replace("../stage/small_stage.yaml", f"{name}_stage.yaml")
        for old, new in [("axes: [a1, a2, a3]", f"axes: {axes}"), *experiment]:
            assert old in text, old
            text = text.replace(old, new)
        (self.at / f"{name}.yaml").write_text(text)
        return name

    @contextlib.contextmanager
    def node(self, name="a", *arguments, interface="vcan0", prefix=()):
        process = self.start_node(name, *arguments, interface=interface, prefix=prefix)
        try:
            yield process
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGCONT)
                process.terminate()
            process.wait(10)
            process.stdout.close()

    def start_node(self, name="a", *arguments, interface="vcan0", prefix=()):
        process = subprocess.Popen(
            [*prefix, self.program, "node", f"{name}_stage.yaml", "--can", interface, *arguments],
            cwd=self.at, stdout=subprocess.PIPE, text=True)
        line = process.stdout.readline()
        assert "ends it" in line, f"the node says: {line}"
        return process

    def start(self, name="a", log="run", *arguments):
        with contextlib.suppress(FileNotFoundError):
            (self.at / f"{log}.slog").unlink()
        return subprocess.Popen([self.program, "run", f"{name}.yaml", "-o", f"{log}.slog",
                                 *arguments], cwd=self.at, stdout=subprocess.PIPE,
                                stderr=subprocess.PIPE, text=True)

    def finish(self, process):
        out, err = process.communicate(timeout=600)
        lines = [line for line in err.splitlines() if not line.startswith("run:")]
        return process.returncode, out, "\n".join(lines)

    def run(self, name="a", log="run", *arguments):
        return self.finish(self.start(name, log, *arguments))

    def wait_until_running(self, process, log="run"):
        """The log has samples."""
        until = time.monotonic() + 30
        while time.monotonic() < until:
            with contextlib.suppress(FileNotFoundError):
                if (self.at / f"{log}.slog").stat().st_size > 20000:
                    return
            if process.poll() is not None:
                raise AssertionError(f"the run ends before it begins: {self.finish(process)}")
            time.sleep(0.02)
        raise AssertionError("the run does not begin")

    def call(self, *arguments):
        return subprocess.run([self.program, *arguments], cwd=self.at, capture_output=True,
                              text=True, timeout=120)


def counts(text):
    """cycles, late, missing, marked of the result's second line."""
    found = re.search(r"(\d+) cycles, (\d+) late, (\d+) missing, (\d+) marked", text)
    return dict(zip(["cycles", "late", "missing", "marked"], map(int, found.groups())))


def raw_socket(interface):
    raw = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    raw.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
    raw.bind((interface,))
    raw.settimeout(5)
    return raw


def send_error(interface, error_class, controller=0):
    """What the driver of a controller would say; vcan hands it to everybody who listens."""
    with raw_socket(interface) as raw:
        raw.send(struct.pack("=IBBBB8s", ERROR_FLAG | error_class, 8, 0, 0, 0,
                             bytes([0, controller, 0, 0, 0, 0, 0, 0])))


def node_state(interface="vcan0"):
    """(state, cause) of the next heartbeat."""
    with raw_socket(interface) as raw:
        while True:
            data = raw.recv(FRAME.size)
            if len(data) < FRAME.size:
                continue
            identifier, _, _, _, _, payload = FRAME.unpack(data)
            if identifier == 0x200:
                return STATES[payload[2] & 0x0F], CAUSES[payload[9]]


def wait_for_state(wanted, interface="vcan0"):
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        state = node_state(interface)
        if state[0] == wanted:
            return state
    raise AssertionError(f"the node is in state {state}, not {wanted}")


def shell(command):
    return subprocess.run(["/bin/sh", "-c", command], check=True, capture_output=True, text=True,
                          timeout=60, env={**os.environ, "PATH": "/usr/sbin:/sbin:/usr/bin:/bin"})


class CanTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.machine = Machine(*sys.argv[1:3], "/tmp/can")

    def ends(self, process, code, *texts):
        """The run ends with this code and one line that says these words; its log is intact."""
        result, out, err = self.machine.finish(process)
        self.assertEqual(result, code, f"{out}\n{err}")
        for text in texts:
            self.assertIn(text, err)
        if code:
            self.assertEqual(len(err.splitlines()), 1, err)
        verified = self.machine.call("log", "verify", "run.slog")
        self.assertEqual(verified.returncode, 0, verified.stdout + verified.stderr)
        return out
