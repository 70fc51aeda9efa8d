#!/usr/bin/python3
"""Logs of other programs through maps: several runs in arrays, names and files; units; sample rates; advice.

    map_test.py PROGRAM WORK_DIR
"""


import h5py
import numpy as np
import scipy.io

from exchange_test import WORK, Case, content, run_tests
from import_test import uff_function

P, PERIODS = 50, 4
M, E = 3, 2  # realizations, experiments


def signals(seed=4, experiments=E):
    """r: realization x experiment x period x 2 channels; u, y: x samples x 2 and 3 channels."""
    g = np.random.default_rng(seed)
    r = g.normal(size=(M, experiments, P, 2))
    return r, g.normal(size=(M, experiments, P * PERIODS, 2)), g.normal(size=(M, experiments, P * PERIODS, 3))


HEAD = f"kind: log\nsample_rate_hz: 100\nperiod_samples: {P}\ntransient_periods: 1\n"
NAMES = ("names: [r1, r2], unit: N", "names: [a1, a2], unit: N", "names: [z1, z2, z3], unit: m")


def log_map(arrays, axes=("", "", ""), names=NAMES, more="", head=HEAD):
    text = head
    for key, array, axis, name in zip(("excitation", "actuators", "sensors"), arrays, axes, names):
        text += f"{key}: {{arrays: [{array}], {name}{', axes: [' + axis + ']' if axis else ''}}}\n"
    (WORK / "map.yaml").write_text(text + more)


def runs_of(name="run.h5"):
    """(realization, experiment) -> excitation, actuators, sensors."""
    with h5py.File(WORK / name) as f:
        return {(int(run.attrs["realization"]), int(run.attrs["experiment"])):
                tuple(run[key][()] for key in ("excitation", "actuators", "sensors")) for run in f["runs"].values()}


class SeveralRuns(Case):
    def expect(self, name, r, u, y, experiments=E):
        """A file, imported through map.yaml, has these runs."""
        self.imports(name, "run.h5")
        runs = runs_of()
        self.assertEqual(set(runs), {(m, e) for m in range(M) for e in range(experiments)})
        for (m, e), run in runs.items():
            for found, given in zip(run, (r[m, e], u[m, e], y[m, e])):
                np.testing.assert_array_equal(found, given)

    def test_arrays_of_three_axes_in_any_order(self):
        r, u, y = signals(experiments=1)
        for order in (("sample", "channel", "run"), ("run", "sample", "channel"), ("channel", "run", "sample")):
            with self.subTest(order):
                place = [("run", "sample", "channel").index(name) for name in order]
                arrays = [np.transpose(a[:, 0], place) for a in (r, u, y)]
                scipy.io.savemat(WORK / "x.mat", dict(zip("ruy", arrays)))
                np.savez(WORK / "x.npz", **dict(zip("ruy", arrays)))
                log_map("ruy", [", ".join(order)] * 3)
                for name in ("x.mat", "x.npz"):
                    self.expect(name, r, u, y, 1)

    def test_axes_of_realizations_and_experiments(self):
        r, u, y = signals()
        np.savez(WORK / "x.npz", r=np.transpose(r, (2, 3, 1, 0)), u=np.transpose(u, (2, 3, 1, 0)), y=y)
        log_map("ruy", ["sample, channel, experiment, realization"] * 2 + ["realization, experiment, sample, channel"])
        self.expect("x.npz", r, u, y)

    def test_one_excitation_for_all_runs_and_arrays_without_channels(self):
        r, u, y = signals(experiments=1)
        np.savez(WORK / "x.npz", r=r[0, 0, :, 0], u=u[:, 0, :, 0], y=y[:, 0, :, 0].T)
        log_map("ruy", ["", "run, sample", "sample, run"], ["unit: N", "unit: N", "unit: m"])
        self.expect("x.npz", np.broadcast_to(r[:1], r.shape)[..., :1], u[..., :1], y[..., :1], 1)

    def test_an_axis_of_runs_with_their_numbers(self):
        r, u, y = signals()
        flat = [a.reshape(M * E, *a.shape[2:]) for a in (r, u, y)]
        np.savez(WORK / "x.npz", **dict(zip("ruy", flat)))
        entries = ", ".join(f"{{realization: {m}, experiment: {e}}}" for m in range(M) for e in range(E))
        log_map("ruy", ["run, sample, channel"] * 3, more=f"runs: [{entries}]\n")
        self.expect("x.npz", r, u, y)
        log_map("ruy", ["run, sample, channel"] * 3, more="runs: [{realization: 0}]\n")
        self.refuses("runs: 1 entry; axis run has 6", "x.npz")

    def test_a_file_per_run(self):
        r, u, y = signals()
        for m in range(M):
            for e in range(E):
                scipy.io.savemat(WORK / f"run_{m + 1}_{e + 1:02}.mat", {"r": r[m, e], "u": u[m, e], "y": y[m, e]})
        scipy.io.savemat(WORK / "run_of_yesterday.mat", {"x": 1.0})
        log_map("ruy")
        self.expect("run_{realization}_{experiment}.mat", r, u, y)
        log_map("ruy", more="files: run_{realization}_{experiment}.mat\n")
        self.expect("", r, u, y)
        self.refuses("omit FILE or the key files", "run_1_01.mat")
        (WORK / "run_3_02.mat").unlink()
        shown = self.imports("", "run.h5")
        self.assertIn("missing: realization 3, experiment 2 (counted from 1)", shown)
        log_map("ruy", more="files: none_{realization}.mat\n")
        self.refuses("no file matches this pattern", "", code=1)
        log_map("ruy")
        self.refuses("no file to import", "")

    def test_folders_with_numbers_and_several_runs_in_a_file(self):
        r, u, y = signals()
        for m in range(M):
            (WORK / f"day{m + 10}").mkdir()
            np.savez(WORK / f"day{m + 10}" / "all.npz", r=r[m], u=u[m], y=y[m])
        log_map("ruy", ["experiment, sample, channel"] * 3)
        self.expect("day{realization}/all.npz", r, u, y)
        log_map("ruy", ["realization, sample, channel"] * 3)
        self.refuses("given by the name of its file and by axis realization; keep one", "day{realization}/all.npz")

    def test_an_array_per_run(self):
        r, u, y = signals()
        names = [f"{key}/{m + 1}_{e + 1}" for key in "ruy" for m in range(M) for e in range(E)]
        values = [a[m, e] for a in (r, u, y) for m in range(M) for e in range(E)]
        with h5py.File(WORK / "x.h5", "w") as f:
            for name, value in zip(names, values):
                f[name] = value
        log_map([f'"{key}/{{realization}}_{{experiment}}"' for key in "ruy"])
        self.expect("x.h5", r, u, y)
        with h5py.File(WORK / "x.h5", "a") as f:
            del f["u/2_1"]
        self.refuses("has no 'u/{realization}_{experiment}' of realization 2 experiment 1", "x.h5")

    def test_axes_that_are_missing_or_wrong(self):
        r, u, y = signals(experiments=1)
        np.savez(WORK / "x.npz", r=r[0, 0], u=u[:, 0], y=y[:, 0])
        log_map("ruy")
        self.refuses("u: has the shape 3 x 200 x 2. List its axes in the map: actuators: {arrays: [u], axes: [", "x.npz")
        for axes in ("sample, wurst", "channel, run", "sample, run, realization"):
            log_map("ruy", ["", axes, ""])
            self.refuses("write for example axes: [sample, channel, run]", "x.npz")
        log_map("ruy", ["", "run, sample, channel", "run, sample"])
        self.refuses("x 200 x 3; axes: [run, sample] lists 2 axes", "x.npz")


class Advice(Case):
    def test_runs_that_follow_one_another(self):
        """The excitation repeats piece by piece: the pieces are runs, and it was not measured."""
        r, u, y = signals()
        whole = [np.concatenate([np.tile(r[m, e], (PERIODS, 1)) for m in range(M) for e in range(E)])]
        whole += [a.reshape(-1, a.shape[-1]) for a in (u, y)]
        np.savez(WORK / "x.npz", **dict(zip("ruy", whole)))
        for more in ("", "excitation_period: mean\n"):
            log_map("ruy", more=more)
            error = self.refuses("changes at row 200 and repeats from there on; the file contains 6 runs in sequence. "
                                "Add the key runs: [{realization: ..., experiment: ..., first_row: 0, rows: 200}, "
                                "{realization: ..., experiment: ..., first_row: 200, rows: 200}", "x.npz")
            self.assertNotIn("excitation_period", error)
        entries = ", ".join(f"{{realization: {k // E}, experiment: {k % E}, first_row: {200 * k}, rows: 200}}"
                            for k in range(M * E))
        log_map("ruy", more=f"runs: [{entries}]\n")
        self.imports("x.npz", "run.h5")
        np.testing.assert_array_equal(runs_of()[2, 1][1], u[2, 1])

    def test_rows_that_are_not_whole_periods(self):
        r, u, y = signals()
        np.savez(WORK / "x.npz", r=r[0, 0], u=u[0, 0, :170], y=y[0, 0, :170])
        log_map("ruy")
        self.refuses("170 rows, not a multiple of period_samples: 50. Add the key runs with "
                    "{first_row: 0, rows: 150} to use 3 periods", "x.npz")
        np.savez(WORK / "x.npz", r=r[0, 0], u=u[0, 0, :50], y=y[0, 0, :50])
        error = self.refuses("1 whole period of period_samples: 50; expected 1 transient period and at least one more. "
                            "Correct transient_periods or period_samples", "x.npz")
        self.assertNotIn("runs", error)


class Units(Case):
    def one(self, units=("N", "N", "m"), more="", rate="sample_rate_hz: 100\n", **arrays):
        r, u, y = signals()
        np.savez(WORK / "x.npz", r=r[0, 0, :, 0], u=u[0, 0, :, 0], y=y[0, 0, :, 0], **arrays)
        log_map("ruy", names=[f"unit: {unit}" for unit in units], more=more, head=HEAD.replace("sample_rate_hz: 100\n", rate))
        return y[0, 0, :, :1]

    def test_prefixes_become_si_with_a_message(self):
        for unit, si, factor in (("um", "m", 1e-6), ("\u00b5m", "m", 1e-6), ("nm", "m", 1e-9), ("mm", "m", 1e-3),
                                 ("kN", "N", 1e3), ("mN", "N", 1e-3), ("mA", "A", 1e-3), ("mV", "V", 1e-3),
                                 ("mrad", "rad", 1e-3), ("deg", "rad", np.pi / 180), ("mm/s^2", "m/s^2", 1e-3),
                                 ("um/ms", "m/s", 1e-3), ("in", "m", 0.0254), ("cm^2", "m^2", 1e-4)):
            with self.subTest(unit):
                y = self.one(("N", "N", unit))
                shown = self.imports("x.npz", "run.h5")
                self.assertIn(f"sensors: {unit} converted to {si}, factor {factor:.10g}", shown)
                np.testing.assert_allclose(runs_of()[0, 0][2], y * factor, rtol=1e-15)
                self.assertEqual(content("run.h5")["channels/sensors@unit"], [si])

    def test_si_units_and_unknown_words_stay(self):
        for unit in ("m", "m/s^2", "Nm", "rad", "counts", "kg", "T", "m/s2"):
            y = self.one(("N", "N", unit))
            shown = self.imports("x.npz", "run.h5")
            self.assertNotIn("converted", shown)
            np.testing.assert_array_equal(runs_of()[0, 0][2], y)
            self.assertEqual(content("run.h5")["channels/sensors@unit"], [unit])
        self.one(("N", "N", "g"))
        self.refuses("sensors: unit 'g': 'g' is ambiguous: gram or acceleration of gravity. Write kg, or m/s^2", "x.npz")

    def test_of_a_frequency_response(self):
        G = np.arange(1, 13).reshape(3, 2, 2) * (1 + 2j)
        np.savez(WORK / "x.npz", f=[1.0, 2.0, 3.0], G=G, V=abs(G) ** 2)
        shown = self.imports("x.npz", map="kind: frf\nfrequency: f\nresponse: G\nnoise_variance: V\n"
                             "axes: [line, output, input]\noutput_unit: um mrad\ninput_unit: N kN\n")
        self.assertIn("outputs: um converted to m, factor 1e-06", shown)
        self.assertIn("inputs: kN converted to N, factor 1000", shown)
        factor = np.array([1e-6, 1e-3])[:, None] / np.array([1.0, 1e3])
        np.testing.assert_allclose(content()["response"], G * factor, rtol=1e-15)
        np.testing.assert_allclose(content()["noise_variance"], abs(G) ** 2 * factor**2, rtol=1e-15)
        self.assertEqual(content()["outputs@unit"], ["m", "rad"])
        (WORK / "x.unv").write_bytes(uff_function(G[:, 0, 0], (1, 3), (1, 3), np.arange(1.0, 4.0), binary="<")
                                     .replace(b"NONE                 NONE", b"NONE                 mm  ", 1))
        shown = self.succeed("import", "x.unv", "-o", "back.h5").stdout
        self.assertIn("outputs: mm converted to m, factor 0.001", shown)

    def test_the_rate_of_the_map_is_that_of_the_file(self):
        for name, value in (("fs", 65536.0), ("dt", 1 / 65536), ("sample_rate_hz", 65536.0), ("time", np.arange(200) / 65536)):
            with self.subTest(name):
                self.one(rate="sample_rate_hz: 1000\n", **{name: value})
                self.refuses(f"sample_rate_hz: 1000 contradicts 65536 Hz, from '{name}' of x.npz. Correct "
                            "sample_rate_hz, or write file_sample_rate: ignored", "x.npz")
                self.one(rate="sample_rate_hz: 1000\nfile_sample_rate: ignored\n", **{name: value})
                self.imports("x.npz", "run.h5")
                self.one(rate="", **{name: value})
                self.imports("x.npz", "run.h5")
                self.assertEqual(content("run.h5")["@sample_rate_hz"], 65536)
        self.one(rate="")
        self.refuses("needs sample_rate_hz", "x.npz")

    def test_pauses_of_a_time_axis(self):
        even = np.arange(200) / 65536
        pause = even + 0.1 * (np.arange(200) >= 100)
        restart = np.arange(200) % 120 / 65536
        rounded = np.round(np.arange(200) / 1500, 3)
        for time, rate in ((pause, 65536), (restart, 65536), (rounded, 1500)):
            self.one(rate="", time=time)
            self.imports("x.npz", "run.h5")
            self.assertAlmostEqual(content("run.h5")["@sample_rate_hz"] / rate, 1, delta=5e-3 if rate == 1500 else 1e-9)
        lost = even + 3 / 65536 * (np.arange(200) > 30)
        self.one(rate="", time=lost)
        self.refuses("'time' of x.npz jumps by 6.1e-05 s behind sample 31: samples are missing", "x.npz")

    def test_the_rate_of_a_universal_file(self):
        r, u, y = signals()
        time = np.arange(200) / 65536
        channels = [np.tile(r[0, 0, :, 0], PERIODS), u[0, 0, :, 0], y[0, 0, :, 0]]
        (WORK / "x.uff").write_bytes(b"".join(uff_function(c, (0, 0), (k + 1, 3), time, kind=1, binary="<")
                                              for k, c in enumerate(channels)))
        arrays = ['"1+Z"', '"2+Z"', '"3+Z"']
        log_map(arrays, names=["unit: N"] * 3, head=HEAD.replace("100", "1000"))
        self.refuses("contradicts 65536 Hz", "x.uff")
        log_map(arrays, names=["unit: N"] * 3, head=HEAD.replace("100", "65536"))
        self.imports("x.uff", "run.h5")


class Summaries(Case):
    def test_of_a_log(self):
        r, u, y = signals()
        r[:, 0, :, 1] = r[:, 1, :, 0] = 0.0
        np.savez(WORK / "x.npz", r=r, u=u, y=y)
        log_map("ruy", ["realization, experiment, sample, channel"] * 3)
        shown = self.imports("x.npz", "run.h5")
        for text in ("6 runs: 3 realizations of 2 experiments, 4 periods each (1 transient), 50 samples per period",
                     "sample rate 100 Hz, total duration 12 s", "experiment 1 excites r1", "experiment 2 excites r2",
                     f"a2 {np.sqrt(np.mean(u[..., 1] ** 2)):.4g} N", "wrote run.h5"):
            self.assertIn(text, shown)
        told = self.told("import", "x.npz", "-o", "run.h5", "--map", "map.yaml")
        self.assertEqual((told["runs"], told["realizations"], told["experiments"], told["periods"], told["sample_rate_hz"],
                          told["duration_s"], told["excited"][1]["excites"]), (6, 3, 2, 4, 100.0, 12.0, ["r2"]))
        np.testing.assert_allclose([c["rms"] for c in told["sensors"]], np.sqrt(np.mean(y**2, axis=(0, 1, 2))), rtol=1e-12)

    def test_of_a_frequency_response(self):
        told = self.told("import", self.frf(), "-o", "back.h5")
        frequency_hz = content("frf.h5")["frequency_hz"]
        self.assertEqual((told["lines"], told["band_hz"]), (len(frequency_hz), [frequency_hz[0], frequency_hz[-1]]))
        rms = np.sqrt(np.mean(abs(content("frf.h5")["response"]) ** 2, axis=0))
        np.testing.assert_allclose([c["rms"] for c in told["channels"]], rms.T.ravel(), rtol=1e-12)
        self.assertTrue(told["noise_variance"])


class Frequencies(Case):
    def test_an_even_axis_by_start_and_step(self):
        G = np.arange(1, 13).reshape(3, 2, 2) * (1 + 2j)
        np.savez(WORK / "x.npz", G=np.transpose(G, (1, 2, 0)), f0=0.5, df=0.25)
        for first, step in (("0.5", "0.25"), ("f0", "df"), ("0.5", "df")):
            self.imports("x.npz", map=f"kind: frf\nfirst_hz: {first}\nstep_hz: {step}\nresponse: G\n"
                         "axes: [output, input, line]\n")
            np.testing.assert_array_equal(content()["frequency_hz"], [0.5, 0.75, 1.0])
            np.testing.assert_array_equal(content()["response"], G)
        (WORK / "x.csv").write_text("re,im\n1,2\n3,4\n5,6\n")
        self.imports("x.csv", map="kind: frf\nfirst_hz: 1\nstep_hz: 2\n"
                     "channels: [{output: y, input: u, real: re, imaginary: im}]\n")
        np.testing.assert_array_equal(content()["frequency_hz"], [1, 3, 5])
        for keys, text in (("first_hz: 1\n", "only valid together"), ("", "frequency, or first_hz and step_hz; add it"),
                           ("frequency: f\nfirst_hz: 1\nstep_hz: 1\n", "remove one"),
                           ("first_hz: 1\nstep_hz: 0\n", "is not positive"), ("first_hz: none\nstep_hz: 1\n", "has no 'none'")):
            self.refuses(text, "x.npz", f"kind: frf\n{keys}response: G\naxes: [output, input, line]\n")


if __name__ == "__main__":
    run_tests()
