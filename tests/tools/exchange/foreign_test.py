#!/usr/bin/python3
"""Files of other programs that hold more than plain arrays, or less than they should: sparse matrices and objects
of MATLAB, damaged files, Touchstone parameters, tables that stageid wrote.

    foreign_test.py PROGRAM WORK_DIR
"""

import io
import json
import struct
import unittest.mock
import zipfile
import zlib

import h5py
import numpy as np
import scipy.io
import scipy.sparse

from exchange_test import WORK, Case, content, everything, run, run_tests
from import_test import write_s2p

SPARSE = np.array([[0, 1.5, 0], [2, 0, -3.0]])


def element(kind, data):
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def opaque(name, kind):
    """A variable of class 17 as MATLAB writes tables in version 5: MAT-File Format, mxOPAQUE_CLASS."""
    numbers = element(14, element(6, struct.pack("<II", 13, 0)) + element(5, struct.pack("<ii", 6, 1)) + element(1, b"")
                      + element(6, struct.pack("<6I", 0xDD000000, 2, 1, 1, 1, 1)))
    return element(14, element(6, struct.pack("<II", 17, 0)) + element(1, name) + element(1, b"MCOS")
                   + element(1, kind) + numbers)


HEAD_V5 = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"


def compressed(data):
    packed = zlib.compress(data)
    return struct.pack("<II", 15, len(packed)) + packed


def npy(array):
    content = io.BytesIO()
    np.save(content, array)
    return content.getvalue()


def write_damaged(name, whole, *changes):
    """Changes: (place, format of struct, number); the number None turns some bits of a byte."""
    damaged = bytearray(whole)
    for place, format, number in changes:
        struct.pack_into(format, damaged, place, whole[place] ^ 0x5A if number is None else number)
    (WORK / name).write_bytes(damaged)


def set_class(item, name):
    kind = h5py.h5t.C_S1.copy()
    kind.set_size(len(name))
    attribute = h5py.h5a.create(item.id, b"MATLAB_class", kind, h5py.h5s.create(h5py.h5s.SCALAR))
    attribute.write(np.array(name.encode(), dtype=f"S{len(name)}"), mtype=kind)


def number(group, name, values):
    item = group.create_dataset(name, data=np.asarray(values, float).T)
    set_class(item, "double")
    return item


def write_v73(path, fill):
    """HDF5 behind MATLAB's head, as save -v7.3 makes it."""
    with h5py.File(path, "w", userblock_size=512) as f:
        fill(f)
    with open(path, "r+b") as f:
        f.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64 HDF5 schema 1.00 .".ljust(116) + bytes(8) + b"\x00\x02IM")


def everything_in_v73(f):
    number(f, "x", np.arange(6.0).reshape(2, 3))
    sparse = scipy.sparse.csc_matrix(SPARSE)
    group = f.create_group("S")
    set_class(group, "double")
    group.attrs["MATLAB_sparse"] = np.uint64(2)
    group["data"], group["ir"], group["jc"] = sparse.data, sparse.indices.astype("u8"), sparse.indptr.astype("u8")
    table = f.create_dataset("T", data=np.array([[0xDD000000, 2, 1, 1, 1, 1]], dtype="u4").T)
    set_class(table, "table")
    table.attrs["MATLAB_object_decode"] = np.int32(3)
    struct_group = f.create_group("st")
    set_class(struct_group, "struct")
    letters = np.empty(2, dtype=object)
    letters[:] = [np.array([name], dtype="S1") for name in ("a", "b")]
    struct_group.attrs.create("MATLAB_fields", letters, dtype=h5py.vlen_dtype(np.dtype("S1")))
    number(struct_group, "a", [[1.0, 2.0]])
    number(struct_group, "b", [[5.0]])
    refs = f.create_group("#refs#")
    number(refs, "a", [[1.0, 2.0, 3.0]])
    number(refs, "b", [[4.0]])
    cell = f.create_dataset("c", data=np.array([[refs["a"].ref], [refs["b"].ref]], dtype=h5py.ref_dtype))
    set_class(cell, "cell")
    empty = f.create_dataset("emp", data=np.array([0, 0], dtype="u8"))
    set_class(empty, "double")
    empty.attrs["MATLAB_empty"] = np.uint8(1)


class Matlab(Case):
    def test_sparse_matrices_are_read(self):
        sparse = scipy.sparse.csc_matrix(SPARSE)
        for name, values, kind in (("x.mat", SPARSE, "real"), ("y.mat", SPARSE * 1j, "complex")):
            scipy.io.savemat(WORK / name, {"S": scipy.sparse.csc_matrix(values)})
            self.assertEqual(self.listed(name), {"S": {"name": "S", "size": [2, 3], "holds": kind}})
        scipy.io.savemat(WORK / "z.mat", {"G": sparse.astype(complex), "f": np.arange(1.0, 4.0)}, do_compression=True)
        self.imports("z.mat", map="kind: frf\nfrequency: f\nresponse: G\naxes: [output, line, input]\n")
        np.testing.assert_array_equal(content()["response"][:, :, 0], SPARSE.T)
        scipy.io.savemat(WORK / "big.mat", {"S": scipy.sparse.csc_matrix((10**6, 10**6))})
        self.refuse("S: is a sparse matrix of 1000000 x 1000000, too large", "import", "big.mat", "--json")

    def test_objects_are_named_with_a_remedy(self):
        plain = WORK / "plain.mat"
        scipy.io.savemat(plain, {"x": np.arange(3.0)})
        rest = plain.read_bytes()[128:]
        for data in (opaque(b"T", b"table"), compressed(opaque(b"T", b"table"))):
            for behind in (b"", rest):
                (WORK / "x.mat").write_bytes(HEAD_V5 + data + behind)
                listed = self.listed("x.mat")
                self.assertEqual(set(listed), {"T", "x"} if behind else {"T"})
                self.assertEqual(listed["T"]["holds"], "MATLAB object (table)")
                shown = self.succeed("import", "x.mat").stdout
                self.assertIn("T: MATLAB object (table) cannot be read. Save its contents as arrays in MATLAB", shown)
                self.refuses("T: MATLAB object (table) cannot be read. Save its contents", "x.mat",
                             "kind: frf\nfrequency: T.f\nresponse: x\n")

    def test_version_73_with_all_of_it(self):
        write_v73(WORK / "x.mat", everything_in_v73)
        listed = self.listed("x.mat")
        self.assertEqual({name: a["holds"] for name, a in listed.items()},
                         {"x": "real", "S": "real", "T": "MATLAB object (table)", "st/a": "real", "st/b": "real",
                          "c/0": "real", "c/1": "real", "emp": "real"})
        self.assertEqual(listed["S"]["size"], [2, 3])

    def test_a_damaged_version_73_file_is_refused(self):
        """A byte of the head of every object in turn: what can no longer be read must not be left out."""
        def fill(f):
            for name in ("alpha", "beta", "gamma"):
                number(f, name, np.arange(40.0).reshape(8, 5))

        write_v73(WORK / "x.mat", fill)
        whole = (WORK / "x.mat").read_bytes()
        with h5py.File(WORK / "x.mat") as f:
            places = [h5py.h5o.get_info(f[name].id).addr + 512 for name in f]
        lost = 0
        for place in places:
            for offset in range(0, 96, 3):
                write_damaged("x.mat", whole, (place + offset, "B", None))
                result = run("import", "x.mat", "--json")
                self.assertIn(result.returncode, (0, 2), result.stderr)
                if result.returncode == 2:
                    self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
                    lost += 1
                else:
                    names = {a["name"] for a in json.loads(result.stdout)["arrays"]}
                    self.assertEqual(names, {"alpha", "beta", "gamma"}, (place, offset))
        self.assertGreater(lost, 0)


class Numpy(Case):
    def test_checksums_of_members(self):
        for save in (np.savez, np.savez_compressed):
            save(WORK / "x.npz", w=np.arange(64.0), G=np.arange(64.0) + 1j)
            whole = (WORK / "x.npz").read_bytes()
            self.succeed("import", "x.npz")
            place = whole.index(np.arange(64.0).tobytes()[256:264]) if save is np.savez else len(whole) // 4
            write_damaged("x.npz", whole, (place, "B", whole[place] ^ 0x01))
            error = self.refuse("the file is damaged", "import", "x.npz")
            if save is np.savez:
                self.assertIn("x.npz:w.npy: its checksum (CRC-32) does not match", error)

    def test_hostile_archives(self):
        """Of the one member w.npy; offsets as in PKWARE's APPNOTE.TXT, 4.3.7 and 4.3.12."""
        with zipfile.ZipFile(WORK / "x.npz", "w") as archive:
            archive.writestr("w.npy", npy(np.arange(8.0)))
        whole = (WORK / "x.npz").read_bytes()
        self.succeed("import", "x.npz")
        directory = whole.index(b"PK\x01\x02")
        for local, central, format, number, text in (
                (6, 8, "<H", 1, "is encrypted; save it without a password"),
                (8, 10, "<H", 12, "unsupported compression method"),
                (22, 24, "<I", 0xFFFFFFF0, "its size is damaged"),
                (18, 20, "<I", 0xFFFFFFF0, "unexpected end of file")):
            write_damaged("x.npz", whole, (local, format, number), (directory + central, format, number))
            self.refuse(f"x.npz:w.npy: {text}", "import", "x.npz")
        for length in (0, 1, 30, len(whole) // 2, len(whole) - 1):
            (WORK / "x.npz").write_bytes(whole[:length])
            self.refuse("x.npz: is not an .npz file, or is truncated", "import", "x.npz")
        for place in range(0, len(whole), 3):
            write_damaged("x.npz", whole, (place, "B", None))
            result = run("import", "x.npz", "--json")
            self.assertIn(result.returncode, (0, 2), (place, result.stderr))

    def test_more_than_memory(self):
        """A stream that inflates to more than its directory entry: no more than the entry is read."""
        with zipfile.ZipFile(WORK / "x.npz", "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("w.npy", npy(np.zeros(1 << 20)))
        whole = (WORK / "x.npz").read_bytes()
        write_damaged("x.npz", whole, (22, "<I", 4096), (whole.index(b"PK\x01\x02") + 24, "<I", 4096))
        self.refuse("x.npz:w.npy: cannot be decompressed; the file is damaged", "import", "x.npz")

    def test_sizes_of_64_bits(self):
        """As numpy writes arrays of 4 GiB and more."""
        with unittest.mock.patch("zipfile.ZIP64_LIMIT", 100):
            np.savez(WORK / "x.npz", w=np.arange(64.0))
        whole = (WORK / "x.npz").read_bytes()
        self.assertEqual(struct.unpack_from("<II", whole, whole.index(b"PK\x01\x02") + 20), (0xFFFFFFFF, 0xFFFFFFFF))
        self.assertRegex(self.succeed("import", "x.npz").stdout, r"w +64 +real")

    def test_what_is_written(self):
        """Stored members without a time: the same content is the same bytes."""
        self.exports(self.frf(), "a.npz")
        with zipfile.ZipFile(WORK / "a.npz") as archive:
            for info in archive.infolist():
                self.assertEqual((info.compress_type, info.date_time), (zipfile.ZIP_STORED, (1980, 1, 1, 0, 0, 0)))
            self.assertIsNone(archive.testzip())


class Touchstone(Case):
    def test_parameters_that_are_normalised(self):
        """Version 1.1: Z over R, Y times R; H and G element by element."""
        g = np.random.default_rng(3)
        true = g.normal(size=(4, 2, 2)) + 1j * g.normal(size=(4, 2, 2))
        R = 75.0
        scale = {"Z": [[1 / R, 1 / R], [1 / R, 1 / R]], "Y": [[R, R], [R, R]], "H": [[1 / R, 1], [1, R]],
                 "G": [[R, 1], [1, 1 / R]], "S": [[1, 1], [1, 1]]}
        units = {"Z": ("VV", "AA"), "Y": ("AA", "VV"), "H": ("VA", "AV"), "G": ("AV", "VA"), "S": ("11", "11")}
        for kind, factor in scale.items():
            write_s2p(f"# HZ {kind} RI R {R:g}\n", true * np.array(factor), "# HZ S RI R 1\n")
            shown = self.succeed("import", "x.s2p", "-o", "back.h5").stdout
            back = content()
            np.testing.assert_allclose(back["response"], true, rtol=1e-14)
            found = tuple("".join(np.broadcast_to(back[f"{side}@unit"], 2)) for side in ("outputs", "inputs"))
            self.assertEqual(found, units[kind])
            self.assertEqual("reference resistance 75 ohm" in shown, kind != "S", shown)
        (WORK / "x.s1p").write_text("# HZ Z RI\n1 2 0\n2 2 0\n")
        self.succeed("import", "x.s1p", "-o", "back.h5")  # 50 ohm where nothing is said
        np.testing.assert_array_equal(content()["response"][:, 0, 0], [100, 100])
        for head, text in (("# HZ H RI", "H parameters need two ports, the file name declares 1"),
                           ("# HZ Z RI R 0", "'0' is not a reference resistance")):
            (WORK / "x.s1p").write_text(f"{head}\n1 2 0\n")
            self.refuse(text, "import", "x.s1p", "-o", "n.h5")


class Tables(Case):
    def test_a_response_comes_back_without_a_map(self):
        frf = self.frf()
        with h5py.File(frf, "r+") as f:
            f["outputs"][0] = "a/b [c], d"
            f["outputs"].attrs["unit"] = ["m/s^2", "rad"]
        self.round_trip(frf, "f.csv")
        back, given = everything("back.h5"), everything(frf)
        for name in given:
            if not name.startswith("@provenance"):
                self.assertEqual(back.get(name), given[name], name)
        with h5py.File(frf, "r+") as f:
            del f["total_variance"], f["noise_variance"]
        self.assertNotIn("noise_variance", self.round_trip(frf, "f.csv"))

    def test_tables_without_the_description(self):
        """As exports were before: names and units from the titles of the columns."""
        frf = self.frf()
        with h5py.File(frf, "r+") as f:
            f["outputs"].attrs["unit"] = ["m/s^2", "rad"]
        self.exports(frf, "f.csv")
        lines = (WORK / "f.csv").read_text().splitlines(keepends=True)
        (WORK / "f.csv").write_text("".join(line for line in lines if not line.startswith("# {")))
        self.succeed("import", "f.csv", "-o", "back.h5")
        given, back = content(frf), content()
        for name in ("frequency_hz", "response", "noise_variance", "total_variance", "outputs", "inputs"):
            np.testing.assert_array_equal(given[name], back[name])
        self.assertEqual(back["outputs@unit"], ["m/s^2", "rad"])
        head = lines[3]
        for begin, text in (([head.replace("real z1/", "real z/1/")], "contain slashes and cannot be separated. Write a map"),
                            (lines[:2] + [lines[2][:-8] + "\n", head], "is damaged"),
                            (lines[:3] + [head.replace("imaginary z1/", "imaginary q1/", 1)], "has no 'imaginary z1/")):
            (WORK / "f.csv").write_text("".join(begin + lines[4:]))
            self.refuse(text, "import", "f.csv", "-o", "n.h5")


if __name__ == "__main__":
    run_tests()
