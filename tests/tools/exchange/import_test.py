#!/usr/bin/python3
"""Files of other programs come in: by themselves, with a map, or with an error that says what is missing.

    import_test.py PROGRAM WORK_DIR
"""

import csv
import json

import h5py
import numpy as np
import scipy.io

from exchange_test import FREQUENCY_HZ, WORK, Case, content, random_frf, run_tests, write_frf

G = random_frf()["response"]  # lines x 2 x 3


def uff_function(y, reference, response, x=None, kind=4, double=True, binary=None):
    """A dataset 58 as other programs write it: no names, uneven abscissas, 1PE20.11."""
    complex_data = np.iscomplexobj(y)
    x = FREQUENCY_HZ if x is None else x
    table = np.column_stack([x, y.real, y.imag] if complex_data else [x, y])
    type_code = {(False, False): 2, (False, True): 4, (True, False): 5, (True, True): 6}[complex_data, double]
    head = ["NONE"] * 5 + [
        f"{kind:5}{1:10}{0:5}{0:10} {'NONE':10}{response[0]:10}{response[1]:4} {'NONE':10}{reference[0]:10}{reference[1]:4}",
        f"{type_code:10}{len(x):10}{0:10}{0:13.5e}{0:13.5e}{0:13.5e}",
        f"{18:10}{0:5}{0:5}{0:5} {'Frequency':20} {'Hz':20}",
        f"{12:10}{0:5}{0:5}{0:5} {'NONE':20} {'NONE':20}",
        f"{13:10}{0:5}{0:5}{0:5} {'NONE':20} {'NONE':20}",
        f"{0:10}{0:5}{0:5}{0:5} {'NONE':20} {'NONE':20}"]
    head = "".join(line + "\n" for line in head).encode()
    edge = b"    -1\n"
    if binary is not None:
        order = 1 if binary == "<" else 2
        # pyuff counts 8 bytes a value here, whatever they are: readers cannot trust it.
        line = f"    58b{order:6}{2:6}{11:12}{8 * len(x):12}{0:6}{0:6}{0:12}{0:12}\n".encode()
        return edge + line + head + table.astype(binary + "f8").tobytes() + edge
    rows = "".join(f"{row[0]:13.5e}" + "".join(f"{v:20.11e}" for v in row[1:]) + "\n" for row in table)
    return edge + b"    58\n" + head + rows.encode() + edge


def write_s2p(head, values, tail="", numbers=lambda v: (v.real, v.imag), comment=""):
    """Touchstone of two ports, in the order 11, 21, 12, 22, at 1, 2, ..."""
    rows = (" ".join(f"{x:.17g}" for i, j in ((0, 0), (1, 0), (0, 1), (1, 1)) for x in numbers(v[i, j])) for v in values)
    (WORK / "x.s2p").write_text(head + "".join(f"{k} {row}{comment}\n" for k, row in enumerate(rows, 1)) + tail)


class ByThemselves(Case):
    def test_a_file_without_output_is_listed(self):
        np.savez(WORK / "x.npz", w=np.arange(4.0), G=G)
        shown = self.succeed("import", "x.npz").stdout
        self.assertRegex(shown, r"w +4 +real")
        self.assertRegex(shown, rf"G +{' x '.join(map(str, G.shape))} +complex")

    def test_universal_files_of_others(self):
        for binary, tolerance in ((None, 1e-11), ("<", 0.0), (">", 0.0)):
            with self.subTest(binary):
                (WORK / "x.uff").write_bytes(b"".join(
                    uff_function(G[:, i, j], (101 + j, -3), (i + 1, 3), binary=binary)
                    for i in range(2) for j in range(3)))
                self.succeed("import", "x.uff", "-o", "back.h5")
                back = content()
                np.testing.assert_allclose(back["frequency_hz"], FREQUENCY_HZ, rtol=1e-5 if binary is None else 0)
                np.testing.assert_allclose(back["response"], G, rtol=tolerance)
                self.assertEqual((back["outputs"], back["inputs"], back["outputs@unit"]),
                                 (["1+Z", "2+Z"], ["101-Z", "102-Z", "103-Z"], "m/s^2"))

    def test_universal_files_of_programs_that_number_no_node(self):
        """Latin-1, channels named by the label of the ordinate or the first line, several without any name."""
        def channel(title, label, unit="m/s\u00b2"):
            head = uff_function(np.sin(np.arange(8.0)), (0, 0), (0, 0), np.arange(8.0), kind=1)
            head = head.replace(b"NONE", title.ljust(4).encode("latin-1"), 1)
            lines = head.split(b"\n")
            lines[10] = f"{1:10}{0:5}{0:5}{0:5} {label:20} {unit:20}".encode("latin-1")
            return b"\n".join(lines)

        (WORK / "x.uff").write_bytes(channel("NONE", "z\u00b5") + channel("1x : m", "NONE")
                                     + channel("NONE", "NONE") + channel("NONE", "NONE"))
        self.assertEqual(list(self.listed("x.uff"))[::2], ["z\u00b5", "1x : m", "0", "0 (2)"])
        self.refuse("4 x time response; import time responses with a map", "import", "x.uff", "-o", "n.h5")
        (WORK / "x.uff").write_bytes(uff_function(abs(G[:, 0, 0]), (0, 0), (0, 0), kind=9))
        self.refuse("1 x power spectral density; export frequency responses", "import", "x.uff", "-o", "n.h5")

    def test_tables_of_windows_programs(self):
        """A byte order mark before the names of the columns, and letters of Latin-1."""
        for head in (b"\xef\xbb\xbft,z\xc2\xb5\r\n", b"t,z\xb5\r\n"):
            (WORK / "x.csv").write_bytes(head + b"1,2\r\n3,4\r\n")
            self.assertEqual(list(self.listed("x.csv")), ["t", "z\u00b5"])

    def test_units_of_a_universal_file_become_si(self):
        units = (f"    -1\n   164\n{5:10}{'mm (milli newton)':20}{2:10}\n"
                 + "".join(f"{v:25.16e}".replace("e", "D") for v in (1000.0, 1000.0, 1.0)) + f"\n{0:25.16e}\n    -1\n")
        inches = units.replace(f"{1000.0:25.16e}".replace("e", "D"), f"{40.0:25.16e}".replace("e", "D"), 1)
        # mm/s^2 over mN are m/s^2 over N; length alone counts for the ordinate, force for the reference.
        for given, factor in ((units, 1), (inches, 1000 / 40)):
            (WORK / "x.unv").write_bytes(given.encode() + uff_function(G[:, 0, 0], (1, 3), (2, 3), binary="<"))
            self.succeed("import", "x.unv", "-o", "back.h5")
            np.testing.assert_allclose(content()["response"][:, 0, 0], G[:, 0, 0] * factor, rtol=1e-15)

    def test_touchstone(self):
        s = G[:4, :2, :2] * 1e7
        for form, numbers in (("RI", lambda v: (v.real, v.imag)),
                              ("MA", lambda v: (abs(v), np.degrees(np.angle(v)))),
                              ("DB", lambda v: (20 * np.log10(abs(v)), np.degrees(np.angle(v))))):
            write_s2p(f"! two ports\n# MHz S {form} R 50\n", s, numbers=numbers, comment=" ! here")
            self.succeed("import", "x.s2p", "-o", "back.h5")
            np.testing.assert_array_equal(content()["frequency_hz"], [1e6, 2e6, 3e6, 4e6])
            np.testing.assert_allclose(content()["response"], s, rtol=1e-13)
        for name, text, error in (("y.s1p", "[Version] 2.0\n", "Touchstone 2"), ("y.s1p", "1 2 x\n", "'x'"),
                                  ("y.s3p", "# Hz S RI\n1 2 3\n", "are not complete lines of")):
            (WORK / name).write_text(text)
            self.refuse(error, "import", name, "-o", "n.h5")


class WithAMap(Case):
    def test_arrays_of_every_format_and_order(self):
        turned = np.transpose(G, (1, 2, 0))  # output, input, line
        scipy.io.savemat(WORK / "x.mat", {"s": {"w": 2 * np.pi * FREQUENCY_HZ, "G": turned}})
        np.savez_compressed(WORK / "x.npz", w=2 * np.pi * FREQUENCY_HZ, G=np.asfortranarray(turned))
        with h5py.File(WORK / "x.h5", "w") as f:
            f["s/w"], f["s/G"] = 2 * np.pi * FREQUENCY_HZ, turned
        for name, prefix in (("x.mat", "s."), ("x.npz", ""), ("x.h5", "s/")):
            with self.subTest(name):
                self.imports(name, map=f"kind: frf\nfrequency: {prefix}w\nfrequency_unit: rad/s\n"
                             f"response: {prefix}G\naxes: [output, input, line]\noutputs: [p, q]\n"
                             "output_unit: m rad\ninput_unit: N\n")
                back = content()
                np.testing.assert_allclose(back["frequency_hz"], FREQUENCY_HZ, rtol=1e-15)
                np.testing.assert_array_equal(back["response"], G)
                self.assertEqual((back["outputs"], back["inputs"], back["outputs@unit"]),
                                 (["p", "q"], ["u1", "u2", "u3"], ["m", "rad"]))
        self.refuse("write a map", "import", "x.npz", "-o", "n.h5")
        self.refuses("key 'axes' is missing", "x.npz", "kind: frf\nfrequency: w\nresponse: G\n")
        self.refuses("has no 'v'; it contains w, G", "x.npz", "kind: frf\nfrequency: v\nresponse: G\n")
        self.refuses("map.yaml:1:", "x.npz", "kind: frf\nfrequency: w\n")

    def test_columns_of_a_table(self):
        y = G[:, 0, 0]
        rows = np.column_stack([FREQUENCY_HZ, abs(y), np.degrees(np.angle(y)), y.real, y.imag])
        text = "f;mag;deg;re;im;\n" + "".join(
            ";".join(repr(float(v)).replace(".", ",") for v in row) + ";\n" for row in rows)
        (WORK / "x.csv").write_text(text)
        self.imports("x.csv", map="kind: frf\nfrequency: f\nchannels:\n"
                     "- {output: y, input: a, magnitude: mag, phase_deg: deg}\n"
                     "- {output: y, input: b, real: re, imaginary: im}\n")
        back = content()
        np.testing.assert_array_equal(back["frequency_hz"], FREQUENCY_HZ)
        np.testing.assert_allclose(back["response"][:, 0, 0], y, rtol=1e-14)
        np.testing.assert_array_equal(back["response"][:, 0, 1], y)
        for wrong, error in ((text.replace(";deg;", ";mag;"), "x.csv:1: duplicate column name"),
                             (text + "1;2;nonsense;4;5;\n", "got 'nonsense' in column 3"),
                             (text + "9;-40;0;4;5;\n", "x.csv:mag: a magnitude is -40"),
                             (text + "1;2;" + "nonsense" * 9 + ";4;5;\n",
                              "'" + ("nonsense" * 9)[:37] + "...' in column 3")):
            (WORK / "x.csv").write_text(wrong)
            self.refuses(error, "x.csv")

    def test_names_that_hold_what_stands_between_fields(self):
        names = ["f", "a;b", "c\td", 'say "x;y", z']
        with open(WORK / "x.csv", "w", encoding="utf-8", newline="") as file:
            csv.writer(file, quoting=csv.QUOTE_NONNUMERIC).writerows([names, [1, 2.5, 3, 4], [2, 3.5, 4, 5]])
        self.assertEqual(list(self.listed("x.csv")), names)
        frf = self.frf()
        with h5py.File(WORK / frf, "r+") as f:
            f["outputs"][0] = "x;y"
        self.exports(frf, "f.csv")
        listed = self.listed("f.csv")
        self.assertEqual(len(listed), 1 + 4 * 6)
        self.assertTrue(any("x;y" in name for name in listed))

    def test_a_frequency_response_written_as_a_table(self):
        frf = self.frf()
        self.exports(frf, "f.csv")
        with open(WORK / "f.csv", encoding="utf-8") as file:
            head, *rows = csv.reader(line for line in file if not line.startswith("#"))
        columns = dict(zip(head, np.array(rows, dtype=float).T))
        given = content(frf)
        response, noise, total = (given[name] for name in ("response", "noise_variance", "total_variance"))
        np.testing.assert_array_equal(columns["frequency_hz"], FREQUENCY_HZ)
        channels = []
        for i, output in enumerate(given["outputs"]):
            for j, input in enumerate(given["inputs"]):
                unit = f"{given['outputs@unit'][i]}/{given['inputs@unit']}"
                called = {part: f"{part} {output}/{input} [{unit}]" for part in ("real", "imaginary")}
                called |= {part: f"{part} {output}/{input} [({unit})^2]" for part in ("noise_variance", "total_variance")}
                for part, values in (("real", response.real), ("imaginary", response.imag),
                                     ("noise_variance", noise), ("total_variance", total)):  # fmt: skip
                    np.testing.assert_array_equal(columns[called[part]], values[:, i, j])
                channels.append({"output": output, "input": input} | called)
        self.assertEqual(len(head), 1 + 4 * len(channels))
        head = "kind: frf\nfrequency: frequency_hz\nchannels: "
        self.imports("f.csv", map=head + json.dumps(channels))
        for name in ("response", "noise_variance", "total_variance"):
            np.testing.assert_array_equal(content()[name], given[name])
        del channels[2]["noise_variance"]
        self.refuses("for all channels or for none", "f.csv", head + json.dumps(channels))

    def test_a_log(self):
        g = np.random.default_rng(4)
        r = np.tile(g.normal(size=(50, 1)), (4, 1))
        u, y = g.normal(size=(200, 1)), g.normal(size=(200, 2))
        scipy.io.savemat(WORK / "x.mat", {"r": r, "u": u, "y": y})
        text = ("kind: log\nsample_rate_hz: 100\nperiod_samples: 50\ntransient_periods: 1\n"
                "excitation: {arrays: [r], unit: N}\nactuators: {arrays: [u], unit: N}\n"
                "sensors: {arrays: [y], names: [y1, y2], unit: m rad, scale: [0.001, 1]}\n")
        for name in ("run.h5", "run.slog"):
            self.imports("x.mat", name, text)
            self.succeed("log", "verify", name)
        h5 = content("run.h5")
        for name, values in (("excitation", r[:50]), ("actuators", u), ("sensors", y * [0.001, 1])):
            np.testing.assert_array_equal(h5[f"runs/0000/{name}"], values)
        self.assertEqual(h5["channels/sensors"], ["y1", "y2"])
        self.refuses("write names", "x.mat", text.replace("names: [y1, y2], ", ""))
        self.refuses("needs sample_rate_hz", "x.mat", text.replace("sample_rate_hz: 100\n", ""))
        self.refuses("not a multiple of period_samples", "x.mat", text.replace("period_samples: 50", "period_samples: 60"))
        scipy.io.savemat(WORK / "x.mat", {"r": r + 1e-3 * g.normal(size=r.shape), "u": u, "y": y})
        self.refuses("excitation_period: mean", "x.mat", text)
        text += "excitation_period: mean\n"
        for second in ("{first_row: 100}", "{realization: 0, experiment: 0}"):
            error = self.refuses("entries 1 and 3 of runs are both realization: 0, experiment: 0", "x.mat",
                                 f"{text}runs: [{{first_row: 0, rows: 100}}, {{experiment: 1}}, {second}]\n")
            self.assertRegex(error, r"map.yaml:9:\d+: ")
        self.imports("x.mat", "run.h5", text + "runs: [{experiment: 2, first_row: 100, rows: 100}]\n")
        self.assertEqual(content("run.h5")["runs/0000@experiment"], 2)
        np.testing.assert_array_equal(content("run.h5")["runs/0000/actuators"], u[100:])


class Logs(Case):
    """What `log convert` writes of a log, against the arrays that the log was made of."""

    def setUp(self):
        super().setUp()
        g = np.random.default_rng(6)
        self.r, self.u, self.y = g.normal(size=(50, 1)), g.normal(size=(2, 150, 1)), g.normal(size=(2, 150, 2))
        self.marked = (np.arange(150) == 77).astype("u1")
        with h5py.File(WORK / "log.h5", "w") as f:
            f.attrs["format"], f.attrs["format_version"] = "stageid-log", 1
            f.attrs["sample_rate_hz"], f.attrs["period_samples"], f.attrs["transient_periods"] = 100.0, 50, 1
            for name, names in (("excitation", ["r"]), ("actuators", ["a"]), ("sensors", ["z1", "\u00b52"])):
                f[f"channels/{name}"] = names
                f[f"channels/{name}"].attrs["unit"] = "m" if name == "sensors" else "N"
            for m in range(2):
                run = f.create_group(f"runs/{m:04}")
                run.attrs["realization"], run.attrs["experiment"], run.attrs["complete"] = m, 0, 1 - m
                run["excitation"], run["actuators"], run["sensors"] = self.r, self.u[m], self.y[m]
                run["marked"] = self.marked

    def test_matlab_holds_every_run_to_the_bit(self):
        self.succeed("log", "convert", "log.h5", "-o", "log.mat")
        read = scipy.io.loadmat(WORK / "log.mat", squeeze_me=True, struct_as_record=False,
                                uint16_codec="utf-16-le")
        self.assertEqual((read["sample_rate_hz"], read["period_samples"], read["transient_periods"]), (100, 50, 1))
        self.assertEqual(list(read["channels"].sensors), ["z1", "\u00b52"])
        self.assertEqual(list(read["channels"].sensors_unit), ["m", "m"])
        for m in range(2):
            run = read[f"run{m:04}"]
            self.assertEqual((run.realization, run.experiment, run.complete), (m, 0, 1 - m))
            np.testing.assert_array_equal(run.excitation, self.r[:, 0])
            np.testing.assert_array_equal(run.actuators, self.u[m, :, 0])
            np.testing.assert_array_equal(run.sensors, self.y[m])
            np.testing.assert_array_equal(run.marked, self.marked)
        self.succeed("log", "convert", "log.h5", "-o", "part.mat", "--complete-only", "--mat-version", "7.3")
        with h5py.File(WORK / "part.mat") as f:
            np.testing.assert_array_equal(f["run0000/sensors"][()].T, self.y[0])
            self.assertNotIn("run0001", f)

    def test_matlab_comes_back_through_a_map(self):
        self.succeed("log", "convert", "log.h5", "-o", "log.mat")
        self.imports("log.mat", map="kind: log\nsample_rate_hz: 100\nperiod_samples: 50\ntransient_periods: 1\n"
                     "excitation: {arrays: [run0000/excitation], names: [r], unit: N}\n"
                     "actuators: {arrays: [run0000/actuators], names: [a], unit: N}\n"
                     "sensors: {arrays: [run0000/sensors], names: [z1, z2], unit: m}\n")
        np.testing.assert_array_equal(content()["runs/0000/sensors"], self.y[0])
        np.testing.assert_array_equal(content()["runs/0000/actuators"], self.u[0])

    def test_native_and_back_to_the_bit(self):
        self.succeed("log", "convert", "log.h5", "-o", "log.slog")
        self.succeed("log", "verify", "log.slog")
        self.refuse("is already a native log", "log", "convert", "log.slog", "-o", "twice.slog")
        self.succeed("log", "convert", "log.slog", "-o", "again.h5")
        again = content("again.h5")
        for m in range(2):
            run = f"runs/{m:04}"
            self.assertEqual((again[f"{run}@realization"], again[f"{run}@complete"]), (m, 1 - m))
            for name, given in (("excitation", self.r), ("actuators", self.u[m]), ("sensors", self.y[m]),
                                ("marked", self.marked)):
                np.testing.assert_array_equal(again[f"{run}/{name}"], given)


class Damaged(Case):
    def test_files_of_another_kind_are_named(self):
        for name, data, text in (
                ("run.slog", b"\x89SLOG\r\n\x1a" + bytes(100),
                 "is a native log, not an HDF5 file; use it with 'stageid frf'"),
                ("model.json", b"{}", "is JSON, not an HDF5 file"), ("run.txt", b"words", "is not an HDF5 file")):
            (WORK / name).write_bytes(data)
            self.refuse(text, "fit", name, "-o", "n.json")

    def test_names_that_do_not_end_as_their_kind(self):
        frf = self.frf()
        self.refuse("n.h5: a model is written as .json", "fit", frf, "-o", "n.h5")
        self.refuse("n.h5: a list of modes is written as .json", "modes", frf, "-o", "n.h5")
        self.refuse("n.json: a frequency response is written as .h5, .hdf5", "frf", "run.slog", "-o", "n.json")
        self.assertFalse((WORK / "n.h5").exists() or (WORK / "n.json").exists())

    def test_every_file_cut_short_is_one_line(self):
        frf = self.frf()
        for ending in ("mat", "npz", "unv", "uff"):
            self.exports(frf, "a." + ending)
            whole = (WORK / f"a.{ending}").read_bytes()
            for part in (0.03, 0.4, 0.77, 0.98):
                (WORK / f"cut.{ending}").write_bytes(whole[:int(part * len(whole))])
                with self.subTest(ending=ending, part=part):
                    self.refuse("cut." + ending, "import", "cut." + ending, "-o", "n.h5")

    def test_what_is_no_such_file(self):
        for ending in ("mat", "npz", "unv", "h5", "s2p"):
            (WORK / ("text." + ending)).write_text("hello\n")
            self.refuse("text." + ending, "import", "text." + ending, "-o", "n.h5")
            self.refuse("none." + ending, "import", "none." + ending, "-o", "n.h5", code=1)
        (WORK / "x.doc").write_text("")
        self.refuse("unsupported file type '.doc'", "import", "x.doc", "-o", "n.h5")
        self.refuse("a frequency response is written as .h5", "import", "text.unv", "-o", "n.csv")
        frf = self.frf()
        self.refuse("frf.h5 is written as .mat, .npz, .csv", "export", frf, "-o", "n.h5")
        self.refuse("--mat-version", "export", frf, "-o", "n.mat", "--mat-version", "6")

    def test_what_a_universal_file_cannot_hold(self):
        for name, unit, text in (("y" * 73, "m", "at most 72 characters"), ("y", "m" * 21, "20 characters")):
            write_frf(WORK / "long.h5", [1.0], np.ones((1, 1, 1), complex), inputs=["a"], outputs=[name],
                      units=("N", unit))
            self.refuse(text, "export", "long.h5", "-o", "n.unv")

    def test_channels_that_do_not_match(self):
        one = uff_function(G[:, 0, 0], (1, 3), (1, 3))
        for data, text in ((one + one, "duplicate frequency response"),
                           (one + uff_function(G[:, 0, 0], (2, 3), (2, 3)), "every pair"),
                           (one + uff_function(G[:, 0, 0], (2, 3), (1, 3), FREQUENCY_HZ + 1), "its frequencies differ"),
                           (one.replace(b"         6        23", b"         7        23"), "ordinate data type"),
                           (one.replace(b"    4         1", b"    1         1"), "no frequency response"),
                           (one.replace(b"e-0", b"x-0", 3), "finite number")):
            (WORK / "x.unv").write_bytes(data)
            self.refuse(text, "import", "x.unv", "-o", "n.h5")


if __name__ == "__main__":
    run_tests()
