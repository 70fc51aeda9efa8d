"""What goes over a real CAN bus is what the simulator measures here, and what other programs read there."""

import csv
import re
import signal
import subprocess

from can_machine import SHORT, CanTest, counts, shell


class Equality(CanTest):
    def frf(self, log):
        import h5py
        made = self.machine.call("frf", f"{log}.slog", "-o", f"{log}.h5")
        self.assertEqual(made.returncode, 0, made.stderr)
        with h5py.File(self.machine.at / f"{log}.h5") as file:
            return file["response"][:]

    def compare(self, mode, tolerance):
        name = self.machine.configure(mode, mode=mode, axes="[a1, a2, a3]", experiment=SHORT)
        with self.machine.node(name):
            code, out, err = self.machine.run(name, mode)
            self.assertEqual(code, 0, err)
        self.assertEqual(counts(out), {"cycles": 15000, "late": 0, "missing": 0, "marked": 0})
        code, out, err = self.machine.run(name, "sim", "--backend", "sim")
        self.assertEqual(code, 0, err)
        wire, here = self.frf(mode), self.frf("sim")
        error = abs(wire - here).max() / abs(here).max()
        print(f"{mode}: FRF differs by {error:.2e} of its largest entry")
        self.assertLess(error, tolerance)
        self.assertGreater(error, 0.0, "the same bytes would mean that nothing went over the wire")

    # A count is 40 N 1.25 / 2^23 = 6e-6 N against 1 N rms on 197 lines (0.1 N per line), and 1.5e-10 m
    # against 1e-7 m: rounding of 1e-4 per sample, white, reduced by sqrt(500 samples 3 periods 2 times).
    def test_streaming_gives_the_frf_of_the_simulator(self):
        self.compare("streaming", 1e-5)

    # float32: 6e-8 per sample.
    def test_resident_gives_the_frf_of_the_simulator(self):
        self.compare("resident", 1e-7)

    def test_two_buses(self):
        shell("ip link add dev vcan1 type vcan && ip link set dev vcan1 mtu 72 up")
        name = self.machine.configure("two", interfaces=("vcan0", "vcan1"), experiment=SHORT)
        with self.machine.node(name, interface="vcan0,vcan1"):
            code, out, err = self.machine.run(name)
        shell("ip link del vcan1")
        self.assertEqual(code, 0, err)
        self.assertEqual(counts(out)["missing"], 0)

    def test_a_resumed_experiment_is_complete(self):
        name = self.machine.configure("resume")
        with self.machine.node(name):
            process = self.machine.start(name)
            self.machine.wait_until_running(process)
            process.send_signal(signal.SIGINT)
            self.assertEqual(self.machine.finish(process)[0], 130)
            process = subprocess.run(
                [self.machine.program, "run", f"{name}.yaml", "-o", "run.slog", "--resume"],
                cwd=self.machine.at, capture_output=True, text=True, timeout=120)
        self.assertEqual(process.returncode, 0, process.stderr)
        self.assertIn("3 of 3 runs complete", process.stdout)


class Decoding(CanTest):
    """What candump records, read with nothing but the DBC file, is what the log says."""

    SIGNAL = re.compile(r' SG_ (\w+) : (\d+)\|(\d+)@1([+-]) \(([^,]+),([^)]+)\)')

    def signals(self, file):
        message, found = None, {}
        for line in file.read_text().splitlines():
            if line.startswith("BO_ "):
                message = int(line.split()[1])
            elif match := self.SIGNAL.match(line):
                name, start, length, sign, scale, offset = match.groups()
                found[message, name] = (int(start), int(length), sign == "-", float(scale),
                                        float(offset))
        return found

    def value(self, data, start, length, signed, scale, offset):
        raw = int.from_bytes(data, "little") >> start & (1 << length) - 1
        if signed and raw >> length - 1:
            raw -= 1 << length
        return scale * raw + offset

    def test_candump_and_dbc_give_the_log(self):
        import numpy as np
        name = self.machine.configure("decode", experiment=SHORT)
        written = self.machine.call("config", "dbc", f"{name}_stage.yaml", "-o", "stage.dbc")
        self.assertEqual(written.returncode, 0, written.stderr)
        with self.machine.node(name), open(self.machine.at / "dump", "w") as dump:
            candump = subprocess.Popen(["candump", "-L", "-r", "8000000", "vcan0"], stdout=dump)
            self.ends(self.machine.start(name), 0)
            candump.terminate()
            candump.wait()
        converted = self.machine.call("log", "convert", "run.slog", "-o", "run.csv")
        self.assertEqual(converted.returncode, 0, converted.stderr)
        with open(self.machine.at / "run.csv", newline="") as file:
            head, *rows = csv.reader(file)
        signals = self.signals(self.machine.at / "stage.dbc")
        columns = {0x100: ["a1", "a2", "a3"], 0x180: ["s1", "s2"]}
        decoded = {0x100: [], 0x180: []}
        for line in (self.machine.at / "dump").read_text().splitlines():
            identifier, _, data = line.split()[2].partition("##")
            if int(identifier, 16) in decoded:
                decoded[int(identifier, 16)].append(bytes.fromhex(data[1:]))
        samples = 2500  # of the first run
        for identifier, names in columns.items():
            # Setpoint n is sent as number n + 1, measurement n as n. On a busy machine, candump may miss
            # some frames, and some may be repeated.
            frames = {}
            first_run = self.value(decoded[identifier][0], *signals[identifier, "run"])
            for data in decoded[identifier]:
                run, number = (self.value(data, *signals[identifier, s]) for s in ("run", "sequence"))
                row = int(number) - (identifier == 0x100)
                if run != first_run:  # a later run may have drawn the same number
                    break
                if row < samples:
                    frames[row] = data
            self.assertGreater(len(frames), 0.9 * samples)
            for column in names:
                signal_ = signals[identifier, column]
                wire = np.array([self.value(data, *signal_) for data in frames.values()])
                title = f"actuator {column} [N]" if identifier == 0x100 else f"sensor {column} [m]"
                index = head.index(title)
                logged = np.array([float(rows[row][index]) for row in frames])
                # Measurements are logged as received, commands before rounding.
                tolerance = 0.5001 * signal_[3] if identifier == 0x100 else 1e-6 * signal_[3]
                self.assertLess(abs(wire - logged).max(), tolerance, column)
