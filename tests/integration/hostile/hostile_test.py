#!/usr/bin/python3
"""Damaged and malicious inputs: each ends in a result or in one line with exit code 2 (1 for the operating system's
errors), within 3 GiB and 20 seconds of processor time, and no input is overwritten.

    hostile_test.py PROGRAM CONFIGS WORK_DIR
"""

import json
import os
import pathlib
import resource
import shutil
import signal
import struct
import subprocess
import sys
import unittest
import zipfile

import h5py
import numpy as np

PROGRAM, CONFIGS, WORK = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
DEEP = "[" * 100_000 + "]" * 100_000
MAT_HEAD = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"


def limits():
    resource.setrlimit(resource.RLIMIT_AS, (3 << 30, 3 << 30))
    resource.setrlimit(resource.RLIMIT_CPU, (20, 20))


def run(*arguments, before=limits):
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, errors="replace",
                          cwd=WORK, preexec_fn=before, check=False, timeout=60)


def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


def blocks_of(log):
    """Header and payload of each block of a native log."""
    blocks, at = [], 0
    while at < len(log):
        size = 64 + -(-struct.unpack_from("<I", log, at + 44)[0] // 64) * 64
        blocks.append(log[at:at + size])
        at += size
    return blocks


def changed(block, form, offset, value):
    """The block with another number in its header, and the checksum of that."""
    head = bytearray(block[:64])
    struct.pack_into(form, head, offset, value)
    struct.pack_into("<I", head, 60, crc32c(head[:60]))
    return bytes(head) + block[64:]


def element(kind, data):
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def matrix(kind, shape, name, *parts):
    return element(14, element(6, struct.pack("<II", kind, 0)) + element(5, struct.pack(f"<{len(shape)}i", *shape))
                   + element(1, name) + b"".join(parts))


# What only a library or a bug would say.
LIBRARY_TEXT = r"json\.exception|basic_|vector::|std::|a bug in stageid"


class Case(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        shutil.rmtree(WORK, ignore_errors=True)
        WORK.mkdir(parents=True)
        shutil.copytree(CONFIGS, WORK / "configs")
        done = run("identify", "configs/experiment/small_stage_pilot.yaml", "-o", ".")
        assert done.returncode in (0, 3), done.stderr
        run("log", "convert", "run.slog", "-o", "log.h5")

    def refused(self, *arguments, code=2, says=""):
        done = run(*arguments)
        self.assertEqual(done.returncode, code, (arguments, done.stderr[-300:]))
        self.assertRegex(done.stderr.strip().splitlines()[-1], r"^stageid: .*" + says)
        self.assertNotRegex(done.stderr, LIBRARY_TEXT)
        return done

    def ends(self, *arguments):
        """Whatever the answer, it is one, and not a crash."""
        done = run(*arguments)
        self.assertIn(done.returncode, (0, 1, 2, 3), (arguments, done.returncode, done.stderr[-300:]))
        self.assertNotRegex(done.stderr, LIBRARY_TEXT)
        return done

    def flipped(self, name, to, places, bytes_each):
        """The file with some bytes changed at random, 25 times."""
        good = (WORK / name).read_bytes()
        for seed in range(25):
            random = np.random.default_rng(seed)
            bad = bytearray(good)
            for at in random.integers(places.start, min(len(bad), places.stop), bytes_each):
                bad[at] = random.integers(256)
            (WORK / to).write_bytes(bad)
            self.ends("import", to)

    def copy(self, name, to):
        shutil.copy(WORK / name, WORK / to)
        return h5py.File(WORK / to, "r+")


class Texts(Case):
    def test_keys_that_are_no_words(self):
        for text in (": x", "null: 1", "? ", "a: {: 1}"):
            (WORK / "x.yaml").write_text(text)
            self.refused("config", "check", "x.yaml")
            self.refused("import", "frf.h5", "-o", "o.h5", "--map", "x.yaml")

    def test_many_keys_and_merges(self):
        (WORK / "x.yaml").write_text("".join(f"k{k}: 1\n" for k in range(120_000)))
        self.refused("config", "check", "x.yaml")
        (WORK / "x.yaml").write_text("a0: &a0 {x: 1}\n" + "".join(
            f"a{k}: &a{k} {{<<: *a{k - 1}, k{k}: 1}}\n" for k in range(1, 20_000)))
        self.refused("config", "check", "x.yaml")

    def test_deep_json(self):
        model = json.loads((WORK / "model.json").read_text())
        model["provenance"]["x"] = 0
        text = json.dumps(model).replace('"x": 0', '"x": ' + DEEP)
        (WORK / "deep.json").write_text(text)
        self.refused("validate", "deep.json", "frf.h5", says="nested deeper")
        self.refused("report", "deep.json", "frf.h5", "-o", "o.html")
        with self.copy("log.h5", "deep.h5") as log:
            del log.attrs["metadata_json"]
            log.create_dataset("x", data=0)
            log.attrs["metadata_json"] = '{"a":%s}' % ("[" * 15_000 + "]" * 15_000)
        for command in (["log", "info", "deep.h5", "--json"], ["frf", "deep.h5", "-o", "o.h5"],
                        ["log", "convert", "deep.h5", "-o", "o.slog"]):
            self.ends(*command)
        with self.copy("frf.h5", "deep.h5") as frf:
            old = frf["provenance"]
            values = np.array([('{"a":%s}' % DEEP).encode()]) if old.shape else np.bytes_('{"a":%s}' % DEEP)
            del frf["provenance"]
            frf["provenance"] = values
        for command in (["fit", "deep.h5", "-o", "o.json"], ["report", "deep.h5", "-o", "o.html"]):
            self.ends(*command)
        directory = WORK / "deep"
        directory.mkdir()
        for name in ("frf.h5", "model.json"):
            shutil.copy(WORK / name, directory)
        (directory / "summary.json").write_text('{"format":"stageid-summary","steps":%s}' % DEEP)
        self.ends("report", "deep", "-o", "o.html")

    def test_many_keys_of_json(self):
        (WORK / "x.json").write_text('{"format":"stageid-model",' + ",".join(f'"k{k}":1' for k in range(60_000)) + "}")
        self.refused("validate", "x.json", "frf.h5", says="more than 4000 keys")

    def test_blank_lines_and_wide_tables(self):
        (WORK / "x.h5").write_text("\n" * 2048)
        self.refused("frf", "x.h5", "-o", "o.h5")
        (WORK / "x.csv").write_text("time," + ",".join(f"c{k}" for k in range(200_000)) + "\n" + "1," * 200_000 + "1\n")
        self.ends("import", "x.csv")

    def test_control_characters_stay_out_of_terminals_and_scripts(self):
        (WORK / "x.csv").write_text("time,\x1b]0;title\x07\u009bname\n0,1\n1,2\n")
        done = self.ends("import", "x.csv")
        self.assertIn("title", done.stdout)
        self.assertNotRegex(done.stdout, "[\x1b\x07\u009b]")
        text = (WORK / "model.json").read_text()
        (WORK / "named.json").write_text(text.replace('"s1"', '"s1\\nsystem(1)"'))
        self.assertEqual(run("export", "named.json", "-o", "o.m").returncode, 0)
        self.assertNotRegex((WORK / "o.m").read_text(), r"(?m)^system")


class Hdf5(Case):
    def imported(self, name):
        return self.refused("import", name, "-o", "o.h5")

    def test_links_to_other_files(self):
        (WORK / "secret").write_bytes(np.arange(8.0).tobytes())
        with h5py.File(WORK / "other.h5", "w") as other:
            other["x"] = np.arange(8.0)
        if not (WORK / "pipe.h5").exists():
            os.mkfifo(WORK / "pipe.h5")
        with h5py.File(WORK / "x.h5", "w") as file:
            file["x"] = h5py.ExternalLink("pipe.h5", "/x")
        self.refused("import", "x.h5", says="is a link to another file")
        with h5py.File(WORK / "x.h5", "w") as file:
            file.create_dataset("x", shape=8, dtype="<f8", external=[("secret", 0, 64)])
        self.refused("import", "x.h5", says="is stored in another file")
        layout = h5py.VirtualLayout(shape=(8,), dtype="<f8")
        layout[:] = h5py.VirtualSource("other.h5", "x", shape=(8,))
        with h5py.File(WORK / "x.h5", "w", libver="latest") as file:
            file.create_virtual_dataset("x", layout)
        self.refused("import", "x.h5", says="is a view of another file")

    def test_own_files_with_another_files_data(self):
        with self.copy("frf.h5", "x.h5") as frf:
            shape, kind = frf["response"].shape, frf["response"].dtype
            (WORK / "secret").write_bytes(bytes(int(np.prod(shape)) * kind.itemsize))
            del frf["response"]
            frf.create_dataset("response", shape=shape, dtype=kind, external=[("secret", 0, h5py.h5f.UNLIMITED)])
        self.refused("fit", "x.h5", "-o", "o.json", says="is stored in another file")

    def test_groups_that_contain_each_other(self):
        with h5py.File(WORK / "x.h5", "w") as file:
            file["a"] = file["/"]
            file["b"] = file["/"]
        self.refused("import", "x.h5", says="contains itself")
        with h5py.File(WORK / "x.h5", "w") as file:
            group = file
            for _ in range(40):
                group, above = group.create_group("a"), group
                above["b"] = group
        self.refused("import", "x.h5", says="more than 20000 objects")

    def test_a_chunk_of_two_gibibytes(self):
        with h5py.File(WORK / "x.h5", "w") as file:
            file.create_dataset("x", shape=(8,), maxshape=(None,), chunks=(1 << 28,), dtype="<f8", fillvalue=1.0)
        self.refused("import", "x.h5", says="exceeds the size of the file")

    def test_flipped_bytes(self):
        self.flipped("frf.h5", "x.h5", range(6000), 8)


class Matlab(Case):
    def test_a_struct_without_data(self):
        for parts in ([], [element(5, struct.pack("<i", 8))], [element(5, struct.pack("<i", 0)), element(1, b"a" * 8)],
                      [element(5, struct.pack("<i", 8)), element(1, b"a".ljust(8, b"\0"))]):
            (WORK / "x.mat").write_bytes(MAT_HEAD + matrix(2, (1, 1), b"s", *parts))
            self.ends("import", "x.mat")

    def test_flipped_bytes(self):
        self.assertEqual(run("export", "model.json", "-o", "good.mat").returncode, 0)
        self.assertEqual(run("export", "model.json", "-o", "good73.mat", "--mat-version", "7.3").returncode, 0)
        for name in ("good.mat", "good73.mat"):
            self.flipped(name, "x.mat", range(128, 40_000), 30)

    def test_files_that_crashed_libmatio(self):
        files = sorted((pathlib.Path(__file__).parents[2] / "fuzz/corpus/mat").iterdir())
        self.assertGreater(len(files), 3)
        for file in files:
            shutil.copy(file, WORK / "x.mat")
            self.ends("import", "x.mat")


class Archives(Case):
    def test_members_that_overlap(self):
        with zipfile.ZipFile(WORK / "x.npz", "w", zipfile.ZIP_DEFLATED) as archive:
            with archive.open("a0000.npy", "w") as member:
                np.save(member, np.zeros(1 << 21))
        data = (WORK / "x.npz").read_bytes()
        start, = struct.unpack_from("<I", data, len(data) - 6)
        entry = data[start:len(data) - 22]
        many = b"".join(entry.replace(b"a0000", b"a%04d" % k) for k in range(500))
        end = struct.pack("<IHHHHIIH", 0x06054B50, 0, 0, 500, 500, len(many), start, 0)
        (WORK / "x.npz").write_bytes(data[:start] + many + end)
        self.refused("import", "x.npz")

    def test_a_million_axes(self):
        header = b"{'descr': '<f8', 'fortran_order': True, 'shape': (%s), }\n" % (b"1, " * 10**6)
        with zipfile.ZipFile(WORK / "x.npz", "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("a.npy", b"\x93NUMPY\x02\x00" + struct.pack("<I", len(header)) + header + bytes(8))
        self.ends("import", "x.npz")

    def test_a_flipped_byte(self):
        self.assertEqual(run("export", "frf.h5", "-o", "good.npz").returncode, 0)
        bad = bytearray((WORK / "good.npz").read_bytes())
        bad[len(bad) // 2] ^= 4
        (WORK / "x.npz").write_bytes(bad)
        self.refused("import", "x.npz", says="checksum")


class Logs(Case):
    def setUp(self):
        self.blocks = blocks_of((WORK / "run.slog").read_bytes())

    def recover(self, blocks):
        (WORK / "x.slog").write_bytes(b"".join(blocks))
        (WORK / "r.slog").unlink(missing_ok=True)
        done = run("log", "recover", "x.slog", "-o", "r.slog")
        self.assertEqual(done.returncode, 0, done.stderr)
        verified = run("log", "verify", "r.slog")
        self.assertEqual(verified.returncode, 0, verified.stdout + verified.stderr)
        return blocks_of((WORK / "r.slog").read_bytes())

    def of_type(self, kind):
        return [k for k, block in enumerate(self.blocks) if struct.unpack_from("<H", block, 8)[0] == kind]

    def test_a_late_block_in_front_costs_only_itself(self):
        late = self.of_type(4)[-1]
        kept = self.recover([self.blocks[0], self.blocks[late], *self.blocks[1:late], *self.blocks[late + 1:]])
        self.assertGreaterEqual(len(kept), len(self.blocks) - 1)

    def test_the_recovered_log_does_not_explode(self):
        last = self.of_type(4)[-1]
        self.blocks[last] = changed(self.blocks[last], "<Q", 32, 90_000)
        self.recover(self.blocks)
        self.assertLess((WORK / "r.slog").stat().st_size, 4 * (WORK / "x.slog").stat().st_size)
        begin = self.blocks[self.of_type(2)[0]]
        starts = [changed(begin, "<Q", 16, 1 + k) for k in range(1000)]
        self.recover([self.blocks[0], *(changed(block, "<I", 24, k) for k, block in enumerate(starts))])
        self.assertLess((WORK / "r.slog").stat().st_size, 5 * (WORK / "x.slog").stat().st_size)

    def test_what_the_reader_refuses_is_not_copied(self):
        samples, excitation = self.of_type(4)[0], self.of_type(3)[0]
        for which, offset in ((samples, 40), (excitation, 40)):
            blocks = list(self.blocks)
            blocks[which] = changed(blocks[which], "<I", offset, 7)  # rows that the payload does not have
            self.recover(blocks)


class Outputs(Case):
    def test_inputs_are_not_overwritten(self):
        def kept(name, *arguments):
            before = (WORK / name).read_bytes()
            self.refused(*arguments, says="would be overwritten")
            self.assertEqual((WORK / name).read_bytes(), before)

        experiment = "configs/experiment/small_stage.yaml"
        kept("configs/stage/small_stage.yaml", "design", experiment, "-o", "configs/stage/small_stage.yaml")
        kept("modes.json", "fit", "frf.h5", "--modes", "modes.json", "-o", "modes.json")
        lines, outputs, inputs = h5py.File(WORK / "frf.h5")["response"].shape
        with h5py.File(WORK / "w.h5", "w") as weights:
            weights["weights"] = np.ones((lines, outputs, inputs))
        kept("w.h5", "fit", "frf.h5", "--weighting", "w.h5", "--covariance", "w.h5", "-o", "o.json")

    def test_resumed_results_are_replaced(self):
        again = run("identify", "configs/experiment/small_stage_pilot.yaml", "-o", ".", "--resume")
        self.assertIn(again.returncode, (0, 3), again.stderr)
        again = run("identify", "configs/experiment/small_stage_pilot.yaml", "-o", ".")
        self.assertNotIn("overwritten; choose", again.stderr)

    def test_closed_standard_streams(self):
        done = subprocess.run(f"exec '{PROGRAM}' run configs/experiment/small_stage_pilot.yaml -o c.slog 0<&- 1>&- 2>&-",
                              shell=True, cwd=WORK, check=False)
        self.assertEqual(done.returncode, 0)
        self.assertEqual(run("log", "verify", "c.slog").returncode, 0)
        self.assertEqual((WORK / "c.slog").read_bytes()[:8], b"\x89SLOG\r\n\x1a")

    def test_a_full_disk_does_not_hide_why_the_stage_was_stopped(self):
        loud = WORK / "configs/experiment/loud.yaml"
        loud.write_text((CONFIGS / "experiment/small_stage_pilot.yaml").read_text().replace("rms_n: 0.2", "rms_n: 25"))
        measure = ["run", loud, "--force", "-o"]
        self.assertEqual(run(*measure, "whole.slog").returncode, 4)
        whole = (WORK / "whole.slog").stat().st_size
        for missing in (60, 900, whole - 1000):  # the end of the log, rows, everything
            def disk(full=whole - missing):
                signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
                resource.setrlimit(resource.RLIMIT_FSIZE, (full, full))

            (WORK / "part.slog").unlink(missing_ok=True)
            done = run(*measure, "part.slog", before=disk)
            self.assertIn("cannot be written", done.stderr)
            self.assertEqual((done.returncode, "limit 40 N" in done.stderr.splitlines()[-1]),
                             (4, True) if missing < 1000 else (1, False), done.stderr)

    def test_no_name(self):
        for arguments in (["export", "model.json"], ["frf", "run.slog"], ["fit", "frf.h5"],
                          ["report", "model.json", "frf.h5"], ["log", "convert", "run.slog"], ["import", "frf.h5"],
                          ["run", "configs/experiment/small_stage_pilot.yaml"], ["modes", "frf.h5"]):
            done = run(*arguments, "-o", "")
            self.assertIn(done.returncode, (1, 2), (arguments, done.stderr))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[4:])
