#!/usr/bin/python3
"""Exchange of files with other programs: what ours writes is read by scipy, numpy, h5py and a reader of
universal files of its own; what they write is imported; every malformed file is a one-line error.

    exchange_test.py PROGRAM WORK_DIR
"""

import json
import os
import pathlib
import shutil
import subprocess
import sys
import unittest

import h5py
import numpy as np
import scipy.io

import uff_reader

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2] / "support"))
from frf_file import write_frf  # noqa: E402

PROGRAM, WORK = sys.argv[1], pathlib.Path(sys.argv[2]).resolve()
N, N_Y, N_U = 23, 2, 3
# Uneven, and of no grid that single precision or six digits hold.
FREQUENCY_HZ = np.cumsum(np.random.default_rng(1).uniform(0.1, 3.0, N))


def run(*arguments):
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, cwd=WORK)


def random_frf(frequency_hz=FREQUENCY_HZ):
    g = np.random.default_rng(2)
    shape = (len(frequency_hz), N_Y, N_U)
    return {
        "frequency_hz": frequency_hz,
        "response": (g.normal(size=shape) + 1j * g.normal(size=shape)) * 1e-7,
        "noise_variance": g.uniform(1e-20, 2e-20, shape),
        "total_variance": g.uniform(2e-20, 3e-20, shape),
    }


def write_foreign(arrays):
    rest = {name: values for name, values in arrays.items() if name not in ("frequency_hz", "response")}
    write_frf(WORK / "foreign.h5", arrays["frequency_hz"], arrays["response"], datasets=rest,
              inputs=["a1", "a,2", "a3"], outputs=["z1", "x\u00b52"], units=("N", ["m", "rad"]),
              sample_rate_hz=1000 / 3, hold="zoh", compensated="delay", delay_s=1.3e-4, noise_dof=7.0)


def content(path="back.h5"):
    """Datasets, and attributes ("outputs@unit"), of an HDF5 file: arrays, and texts."""
    found = {}

    def add(name, item):
        found.update({f"{name}@{key}": np.asarray(value).tolist() for key, value in item.attrs.items()})
        if isinstance(item, h5py.Dataset):
            found[name] = item.asstr()[()].tolist() if item.dtype.kind in "OS" else item[()]

    with h5py.File(WORK / path) as f:
        add("", f)
        f.visititems(add)
    return found


def everything(path):
    """The same as bytes and texts; provenance apart."""
    return {name: value.tobytes() if isinstance(value, np.ndarray) else value
            for name, value in content(path).items() if name != "provenance"}


class Case(unittest.TestCase):
    def setUp(self):
        shutil.rmtree(WORK, ignore_errors=True)
        WORK.mkdir(parents=True)

    def succeed(self, *arguments):
        result = run(*arguments)
        self.assertEqual((result.returncode, result.stderr), (0, ""), arguments)
        return result

    def refuse(self, text, *arguments, code=2):
        before = sorted(WORK.iterdir())
        result = run(*arguments)
        self.assertEqual(result.returncode, code, (arguments, result.stderr))
        self.assertIn(text, result.stderr)
        self.assertTrue(result.stderr.startswith("stageid: "), result.stderr)
        self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        self.assertEqual(sorted(WORK.iterdir()), before, "a file was left")
        return result.stderr

    def exports(self, what, *names, flags=()):
        for name in names:
            self.succeed("export", what, "-o", name, *flags)

    def round_trip(self, what, name, flags=()):
        """Exports, and imports again without a map; returns the content of back.h5."""
        self.exports(what, name, flags=flags)
        self.succeed("import", name, "-o", "back.h5")
        return content()

    def told(self, *arguments):
        return json.loads(self.succeed(*arguments, "--json").stdout)

    def listed(self, name):
        """The arrays in a file, by name."""
        return {a["name"]: a for a in self.told("import", name)["arrays"]}

    def imports(self, name, to="back.h5", map=None):
        """Imports through map.yaml, which is written if its text is given; returns what is printed."""
        if map is not None:
            (WORK / "map.yaml").write_text(map)
        return self.succeed("import", *name.split(), "-o", to, "--map", "map.yaml").stdout

    def refuses(self, text, name, map=None, code=2):
        """The same of an import that fails; returns the error."""
        if map is not None:
            (WORK / "map.yaml").write_text(map)
        return self.refuse(text, "import", *name.split(), "-o", "n.h5", "--map", "map.yaml", code=code)

    def frf(self, arrays=None):
        """The program's own writing of a foreign frf.h5."""
        write_foreign(arrays or random_frf())
        self.succeed("import", "foreign.h5", "-o", "frf.h5")
        return WORK / "frf.h5"


class RoundTrips(Case):
    def come_back(self, frf):
        for name, flags in (("a.mat", []), ("b.mat", ["--mat-version", "7.3"]), ("c.npz", [])):
            with self.subTest(name):
                self.round_trip(frf, name, flags)
                self.assertEqual(everything("back.h5"), everything(frf))

    def test_mat_npz_and_binary_uff_come_back_to_the_bit(self):
        frf = self.frf()
        self.come_back(frf)
        self.round_trip(frf, "d.uff")
        back, given = everything("back.h5"), everything(frf)
        # Data without a place in a universal file, and the radii, which follow from the degrees of freedom.
        lost = ("@noise_dof", "@provenance", "confidence_radius")
        for name in given:
            if not name.startswith(lost):
                self.assertEqual(back.get(name), given[name], name)

    def test_what_a_measurement_says_of_itself_comes_back_to_the_bit(self):
        for lines, groups, bands in ((9, ["a1", "a,2"], 3), (1, ["all"], 1)):
            g = np.random.default_rng(5)
            arrays = random_frf() | {
                "detection_frequency_hz": np.cumsum(g.uniform(0.1, 1.0, lines)),
                "detection_line": np.arange(3, 3 + lines),
                "detection_groups": groups,
                "detection_runs": g.uniform(1, 9, len(groups)),
                "detection_power": g.uniform(size=(lines, N_Y, len(groups))),
                "detection_noise": g.uniform(size=(lines, N_Y)),
                "detection_linear_power": g.uniform(size=(N, N_Y, len(groups))),
                "nonlinearity_band_hz": np.cumsum(g.uniform(1.0, 2.0, (bands, 2)).ravel()).reshape(bands, 2),
                "dropped_periods": g.integers(0, 9, (bands, 3)),
                "dropped_reasons": [f"reason \u00b5{k}" for k in range(bands)],
                "replaced_samples": g.integers(0, 9, (bands, 5)),
                "replaced_reasons": [f"glitch {k}" for k in range(bands)],
                "left_out_realizations": np.arange(bands),
                "left_out_reasons": [f"run {k}" for k in range(bands)],
            }
            for name, columns in (("p_value", N_U), ("distortion", N_U), ("even_p_value", len(groups)),
                                  ("even_level", len(groups)), ("odd_p_value", len(groups)), ("odd_level", len(groups))):
                arrays[f"nonlinearity_{name}"] = g.uniform(size=(bands, N_Y, columns))
            write_foreign(arrays)
            with h5py.File(WORK / "foreign.h5", "a") as file:
                file["detection_noise"].attrs["dof"] = 12.0
            self.succeed("import", "foreign.h5", "-o", "frf.h5")
            given = everything("frf.h5")
            self.assertEqual(set(arrays) - set(given), set())
            self.assertEqual(given["detection_noise@dof"], 12.0)
            self.come_back("frf.h5")

    def test_one_line_and_one_channel_keep_their_axes(self):
        for shape in ((1, 2, 3), (5, 1, 1), (1, 1, 1)):
            f = np.arange(1.0, 1.0 + shape[0])
            write_frf(WORK / "one.h5", f, np.full(shape, 1 + 2j))
            for name in ("a.mat", "a.npz", "a.uff"):
                with self.subTest(shape=shape, name=name):
                    self.assertEqual(self.round_trip("one.h5", name)["response"].shape, shape)

    def test_text_uff_keeps_thirteen_digits(self):
        frf = self.frf()
        given, back = content(frf), self.round_trip(frf, "a.unv")
        for name in ("frequency_hz", "response", "noise_variance"):
            x, y = given[name], back[name]
            # 1PE20.12: half a unit of the thirteenth digit, of each part.
            self.assertLess(np.max(np.abs(x - y) / np.abs(x)), 1e-12)
            self.assertFalse(np.array_equal(x, y))

    def test_the_same_file_has_the_same_bytes(self):
        frf = self.frf()
        for ending in ("mat", "npz", "unv", "uff"):
            self.exports(frf, f"a.{ending}", f"b.{ending}")
            self.assertEqual((WORK / f"a.{ending}").read_bytes(), (WORK / f"b.{ending}").read_bytes())


class ReadByOthers(Case):
    def test_scipy_and_numpy(self):
        given = random_frf()
        frf = self.frf(given)
        self.exports(frf, "a.mat", "a.npz")
        mat = scipy.io.loadmat(WORK / "a.mat", squeeze_me=True, uint16_codec="utf-16-le")
        np.testing.assert_array_equal(mat["response"], np.moveaxis(given["response"], 0, -1))
        np.testing.assert_array_equal(mat["frequency_hz"], given["frequency_hz"])
        self.assertEqual(list(mat["outputs"]), ["z1", "x\u00b52"])
        self.assertEqual(mat["hold"], "zoh")
        with np.load(WORK / "a.npz") as npz:
            np.testing.assert_array_equal(npz["response"], given["response"])
            self.assertEqual(list(npz["outputs"]), ["z1", "x\u00b52"])
            self.assertEqual(npz["@delay_s"], 1.3e-4)

    def test_universal_files(self):
        given = random_frf(0.5 * np.arange(1, 41))  # six digits hold this grid: even abscissas
        frf = self.frf(given)
        for name, tolerance in (("a.unv", 1e-12), ("a.uff", 0.0)):
            self.exports(frf, name)
            datasets = uff_reader.read(WORK / name)
            self.assertEqual([d["dataset"] for d in datasets[:2]], [151, 164])
            self.assertEqual((datasets[1]["code"], datasets[1]["factors"][:2]), (1, [1.0, 1.0]))
            functions = [d for d in datasets if d.get("type") == 4]
            self.assertEqual(len(functions), N_Y * N_U)
            for k, function in enumerate(functions):
                i, j = k % N_Y, k // N_Y
                np.testing.assert_array_equal(function["x"], given["frequency_hz"])
                np.testing.assert_allclose(function["y"], given["response"][:, i, j], rtol=tolerance)
                self.assertEqual(function["response"], [["z1", "1", "3"], ["x_2", "2", "1"]][i])
                self.assertEqual(function["reference"][1], str(1001 + j))
                self.assertEqual((function["axes"][0][0], function["axes"][0][-1]), ("18", "Hz"))
                self.assertEqual((function["axes"][1][-1], function["axes"][2][-1]), (("m", "rad")[i], "N"))

    def test_uneven_binary_abscissas_are_exact(self):
        self.exports(self.frf(), "a.uff")
        for function in uff_reader.read(WORK / "a.uff"):
            if function.get("type") == 4:
                np.testing.assert_array_equal(function["x"], FREQUENCY_HZ)


MODEL = {
    "format": "stageid-model", "format_version": 1, "inputs": ["a1", "a2"], "outputs": ["z1", "z'2"],
    "sample_rate_hz": 1000.0, "hold": "exact", "input_delay_s": [0.0013, 0.0004],
    "output_delay_s": [0.0, 0.0002],
    "submodels": [
        {"integrators": 2, "denominator": [1], "numerator": [[[0.1, 0.2], [0.3, -0.4]]]},
        {"integrators": 0, "denominator": [1, 1e-4, 1e-5],
         "numerator": [[[1e-6, 2e-6], [3e-6, 6e-6]]]}],
    "fit": {"cost": 1.0, "weighting": "unit", "iterations": 1, "status": "gradient_small",
            "relative_rms_error": 0.1, "band_hz": [5.0, 200.0], "seconds": 0}}


def transfer(frequency_hz):
    """The continuous model without delays, from the coefficients as they stand in the file."""
    total = 0
    s = 2j * np.pi * np.asarray(frequency_hz)
    for sub in MODEL["submodels"]:
        b = sum(np.multiply.outer(s**k, np.array(m)) for k, m in enumerate(sub["numerator"]))
        a = s ** sub["integrators"] * sum(c * s**k for k, c in enumerate(sub["denominator"]))
        total = total + b / a[:, None, None]
    return total


class Models(Case):
    def setUp(self):
        super().setUp()
        (WORK / "model.json").write_text(json.dumps(MODEL))

    def test_mat_and_npz_hold_what_h5_holds(self):
        self.exports("model.json", "m.h5", "m.mat", "m.npz", flags=("--driving-point", "z1", "a1"))
        mat = scipy.io.loadmat(WORK / "m.mat", squeeze_me=True, struct_as_record=False)
        h5, npz = content("m.h5"), dict(np.load(WORK / "m.npz"))
        np.testing.assert_array_equal(mat["response"], np.moveaxis(h5["response"], 0, -1))
        for system in ("continuous", "discrete"):
            for name in "ABCD":
                path = f"state_space/{system}/{name}"
                np.testing.assert_array_equal(getattr(getattr(mat["state_space"], system), name), h5[path])
                np.testing.assert_array_equal(npz[path], h5[path])
        self.assertEqual(mat["modes"].modal_mass, h5["modes/modal_mass"][0])
        self.assertEqual(mat["modes"].driving_point_mass_output, "z1")
        self.assertEqual(json.loads(str(npz["model_json"][0]))["submodels"][1]["integrators"], 0)

    def test_the_python_script_rebuilds_the_model(self):
        f = [5.0, 40.0, 50.3, 180.0, 470.0]
        self.exports("model.json", "m.py", "m.h5")
        space = {"__name__": "model"}
        exec((WORK / "m.py").read_text(), space)
        s = 2j * np.pi * np.array(f)
        delays = np.exp(-np.multiply.outer(s, np.add.outer([0.0, 0.0002], [0.0013, 0.0004])))
        np.testing.assert_allclose(space["continuous_response"](f), transfer(f) * delays, rtol=1e-9)
        h5 = content("m.h5")
        # A sum of a rigid body and modes loses digits by cancellation: measured 3e-12, margin 100.
        np.testing.assert_allclose(space["response"](h5["frequency_hz"]), h5["response"], rtol=3e-10)
        self.assertEqual(space["OUTPUTS"], ["z1", "z'2"])

    def test_the_python_script_says_what_its_plot_needs(self):
        self.exports("model.json", "m.py")
        (WORK / "without").mkdir(exist_ok=True)
        (WORK / "without/matplotlib.py").write_text("raise ImportError\n")
        done = subprocess.run([sys.executable, "m.py"], cwd=WORK, capture_output=True, text=True,
                              env={**os.environ, "PYTHONPATH": str(WORK / "without")})
        self.assertEqual((done.returncode, done.stderr.count("\n")), (1, 1), done.stderr)
        self.assertRegex(done.stderr, r"^\S*m\.py: the plot needs matplotlib; install python3-matplotlib, or ")

    def test_universal_files_hold_response_and_modes(self):
        self.exports("model.json", "m.h5")
        back = self.round_trip("model.json", "m.unv")
        mode = next(d for d in uff_reader.read(WORK / "m.unv") if d["dataset"] == 55)
        h5 = content("m.h5")
        expected = [h5[f"modes/{name}"][0] for name in ("natural_frequency_hz", "modal_mass", "damping_ratio")]
        np.testing.assert_allclose(mode["reals"][:3], expected, rtol=1e-5)
        shape = h5["modes/output_shape"][0].real
        self.assertEqual((mode["analysis"], mode["data_type"], mode["nodes"]), (2, 2, [1, 2]))
        np.testing.assert_allclose(mode["values"], [[0, 0, shape[0]], [0, 0, shape[1]]], rtol=1e-5)
        np.testing.assert_allclose(back["response"], h5["response"], rtol=1e-12)

    def test_shapes_of_outputs_without_a_direction_stand_in_x(self):
        (WORK / "model.json").write_text(json.dumps(MODEL | {"outputs": ["s1", "z2"]}))
        self.exports("model.json", "m.unv")
        mode = next(d for d in uff_reader.read(WORK / "m.unv") if d["dataset"] == 55)
        s1, z2 = mode["values"]
        self.assertEqual((s1[1:], z2[:2]), ([0, 0], [0, 0]))
        np.testing.assert_allclose(z2[2] / s1[0], 3.0, rtol=1e-5)  # rows of the numerator of MODEL
        found = self.told("validate", "model.json", "m.unv")["modes"]
        self.assertEqual(found["outputs"], ["s1", "z2"])
        self.assertAlmostEqual(found["pairs"][0]["mac"], 1.0, places=9)

    def test_mode_shapes_of_others_are_paired_with_the_models(self):
        """Normal modes and a complex eigenvalue, nodes in no order, one that the model does not know."""
        self.write_shapes("fe.unv", [(2, [0.0], {7: (-3.1, 0, 0), 3: (9, 9, 9), 12: (0, 0, 1.0)}),
                                     (2, [51.0, 1.0, 0.0], {7: (-3.1, 0, 0), 3: (9, 9, 9), 12: (0, 0, 1.0)}),
                                     (7, [-1.0, 2 * np.pi * 80.0, 0.0, 1.0],
                                      {7: (1.0, 0, 0), 3: (0, 0, 0), 12: (0, 0, 1.0)})])
        (WORK / "model.json").write_text(json.dumps(MODEL | {"outputs": ["12+Z", "7-X"]}))
        found = self.told("validate", "model.json", "fe.unv")["modes"]
        (pair,) = found["pairs"]
        own, other = np.array([1.0, 3.0]), np.array([1.0, 3.1])
        self.assertAlmostEqual(pair["mac"], (own @ other) ** 2 / (own @ own) / (other @ other), places=12)
        self.assertAlmostEqual(pair["frequency_hz"], 1 / np.sqrt(1e-5) / (2 * np.pi), places=9)
        self.assertEqual((pair["other_frequency_hz"], pair["other_damping_ratio"]), (51.0, 0.0))
        eigenvalue = np.hypot(1.0, 2 * np.pi * 80.0)
        self.assertEqual(len(found["other_alone_hz"]), 2)
        self.assertAlmostEqual(found["other_alone_hz"][1], eigenvalue / (2 * np.pi), places=3)
        self.assertIn("MAC over 2 outputs: 12+Z, 7-X", self.succeed("validate", "model.json", "fe.unv").stdout)

        self.succeed("import", "fe.unv", "-o", "modes.json")
        modes = json.loads((WORK / "modes.json").read_text())["modes"]
        self.assertEqual([modes[0]["frequency_hz"], modes[0]["damping_ratio"]], [51.0, 1e-4])
        self.assertAlmostEqual(modes[1]["damping_ratio"], 1.0 / eigenvalue, places=6)
        self.assertEqual(len(modes), 2, "a rigid body is no place to start from")

    def test_mode_shapes_that_do_not_fit_are_refused(self):
        self.write_shapes("fe.unv", [(2, [51.0, 1.0, 0.0], {5: (1.0, 0, 0)})])
        self.refuse("contain no output of the model (z1, z'2)", "validate", "model.json", "fe.unv")
        self.write_shapes("rigid.unv", [(2, [0.0, 1.0, 0.0], {5: (1.0, 0, 0)})])
        self.refuse("contains no mode with a frequency above zero", "import", "rigid.unv", "-o", "modes.json")
        self.exports(self.frf(), "response.unv")
        self.refuse("contains no mode shapes (dataset 55)", "validate", "model.json", "response.unv")
        self.refuse("contains no mode shapes (dataset 55)", "import", "response.unv", "-o", "modes.json")

    @staticmethod
    def write_shapes(name, modes):
        """Datasets 55 to the letter of the format: analysis 2 (normal mode), 3 or 7 (complex eigenvalue), three values a node."""
        def numbers(values):
            return "".join(f"{value:13.5E}" for value in values) + "\n"

        text = ""
        for number, (analysis, reals, nodes) in enumerate(modes, 1):
            reals = (list(reals) + [1.0, 0.0, 0.0])[:3] + [0.0] if analysis == 2 else reals
            kind = 5 if analysis == 3 else 2
            text += "    -1\n    55\n" + "NONE\n" * 5
            text += f"{1:10d}{analysis:10d}{2:10d}{8:10d}{kind:10d}{3:10d}\n"
            text += f"{2:10d}{len(reals):10d}{0:10d}{number:10d}\n" + numbers(reals)
            for node, values in nodes.items():
                parts = [part for value in values for part in ((value, 0.0) if kind == 5 else (value,))]
                text += f"{node:10d}\n" + numbers(parts)
            text += "    -1\n"
        (WORK / name).write_text(text)


def run_tests():
    sys.argv = sys.argv[:1] + sys.argv[3:]
    unittest.main()


if __name__ == "__main__":
    run_tests()
