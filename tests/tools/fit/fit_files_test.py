#!/usr/bin/python3
"""What `fit` takes and gives beside the model: covariance, lines at 0 Hz, weights of zero, coarse lines.
References are computed here, with numpy.

    fit_files_test.py PROGRAM WORK_DIR
"""

import json
import subprocess
import sys
import unittest
from pathlib import Path

import h5py
import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[2] / "support"))
from frf_file import write_frf  # noqa: E402

PROGRAM = Path(sys.argv[1]).resolve()
WORK = Path(sys.argv[2])
F = np.linspace(20.0, 400.0, 300)
MODES = ((120.0, 0.012), (250.0, 0.008))
N_Y, N_U = 2, 2


def residues(seed=5):
    random = np.random.default_rng(seed)
    modal = [np.outer(random.standard_normal(N_Y), random.standard_normal(N_U)) / (2 * np.pi * f) ** 2
             for f, _ in MODES]
    return modal, random.standard_normal((N_Y, N_U))


def plant(f, rigid=True):
    s = 2j * np.pi * f[:, None, None]
    modal, body = residues()
    P = sum(B / (1 + 2 * z * s / (2 * np.pi * fn) + (s / (2 * np.pi * fn)) ** 2) for (fn, z), B in zip(MODES, modal))
    return P + body / s**2 if rigid else P


def circular(random, shape):
    return (random.standard_normal(shape) + 1j * random.standard_normal(shape)) / np.sqrt(2)


def program(*arguments):
    return subprocess.run([PROGRAM, *map(str, arguments)], cwd=WORK, capture_output=True, text=True)


def fit(*arguments, code=0):
    done = program("fit", *arguments)
    if done.returncode != code:
        raise AssertionError(f"exit code {done.returncode}: {done.stdout}{done.stderr}")
    return done


def model(name="model.json"):
    return json.loads((WORK / name).read_text())


def modes_of(m):
    return [s for s in m["submodels"] if "damping_ratio" in s]


class Covariance(unittest.TestCase):
    sd = 1e-2 * np.median(abs(plant(F)), axis=0) * np.ones((len(F), 1, 1))
    arguments = ("--modes", "120,250", "--covariance", "c.h5")

    def measure(self, seed):
        write_frf(WORK / "frf.h5", F, plant(F) + self.sd * circular(np.random.default_rng(seed), self.sd.shape), self.sd**2)

    def test_names_units_and_matrices(self):
        self.measure(1)
        fit("frf.h5", "-o", "model.json", *self.arguments)
        m = model()
        with h5py.File(WORK / "c.h5") as h:
            self.assertEqual(h.attrs["format"], b"stageid-covariance" if isinstance(h.attrs["format"], bytes) else "stageid-covariance")
            names = [n.decode() for n in h["parameters/name"]]
            units = dict(zip(names, [u.decode() for u in h["parameters/unit"]]))
            values = dict(zip(names, h["parameters/value"]))
            sandwich, likelihood = h["covariance/sandwich"][:], h["covariance/likelihood"][:]
            P, variance, radius = h["response"][:], h["response_variance"][:], h["confidence_radius"][:]
            np.testing.assert_array_equal(h["frequency_hz"][:], F)
        self.assertEqual(len(names), 2 * 2 + 3 * 4)
        self.assertEqual(units["submodels[0].numerator[0][1][0]"], "(m)/(N) s^-2")
        self.assertEqual(units["submodels[2].denominator[2]"], "s^2")
        std = np.sqrt(np.diag(sandwich))
        for i, s in enumerate(m["submodels"]):
            for y in range(N_Y):
                for u in range(N_U):
                    at = names.index(f"submodels[{i}].numerator[0][{y}][{u}]")
                    self.assertEqual(values[names[at]], s["numerator"][0][y][u])
                    self.assertAlmostEqual(std[at] / s["numerator_std"][0][y][u], 1.0, 6)
        # Weights are the inverse variance, channels independent: both kinds are the inverse Fisher matrix.
        np.testing.assert_allclose(likelihood / np.outer(std, std), sandwich / np.outer(std, std), atol=1e-6)
        # The Fisher matrix from columns by differences, in units of the deviations.
        def response(parameters):
            s = 2j * np.pi * F[:, None, None]
            total = 0
            for i in range(3):
                B = np.array([[parameters[f"submodels[{i}].numerator[0][{y}][{u}]"] for u in range(N_U)]
                              for y in range(N_Y)])
                a = [parameters.get(f"submodels[{i}].denominator[{q}]", 0.0) for q in (1, 2)]
                total = total + B / (s**2 if i == 0 else 1 + a[0] * s + a[1] * s**2)
            return total
        np.testing.assert_allclose(response(values), P, rtol=1e-9)
        J = np.stack([(response({**values, n: values[n] + 1e-3 * d}) - response({**values, n: values[n] - 1e-3 * d}))
                      / 2e-3 for n, d in zip(names, std)])
        W = J / self.sd
        fisher = 2 * np.einsum("pkyu,qkyu->pq", W.conj(), W).real
        C = np.linalg.inv(fisher)
        np.testing.assert_allclose(C, sandwich / np.outer(std, std), atol=2e-3)
        expected = np.einsum("pkyu,pq,qkyu->kyu", J.conj(), C, J).real
        np.testing.assert_allclose(variance, expected, rtol=5e-3)
        ratio = radius / np.sqrt(variance)
        self.assertTrue(1.73 < ratio.min() and ratio.max() < 1.961)

    def test_repeated_measurements(self):
        runs = 200
        quantities, inside = [], []
        for seed in range(runs):
            self.measure(100 + seed)
            fit("frf.h5", "-o", "model.json", *self.arguments)
            with h5py.File(WORK / "c.h5") as h:
                inside.append(abs(h["response"][:] - plant(F)) < h["confidence_radius"][:])
            quantities.append([[(m["modal_mass"], m["modal_mass_std"]),
                                *zip(m["output_shape"], m["output_shape_std"]),
                                *zip(m["input_shape"], m["input_shape_std"])] for m in modes_of(model())])
        q = np.array(quantities)  # runs x modes x quantities x (value, deviation)
        ratio = q[..., 0].std(axis=0, ddof=1) / q[..., 1].mean(axis=0)
        # A deviation of 200 runs scatters by 5 %: all in 1 +- 4 of that, their mean in the promised range.
        self.assertTrue(0.8 < ratio.min() and ratio.max() < 1.2, ratio)
        self.assertTrue(0.9 < ratio.mean() < 1.1, ratio)
        self.assertAlmostEqual(np.mean(inside), 0.95, delta=0.015)

    def test_delays_with_their_deviations(self):
        """In the model, in --json and on the terminal: those of the covariance file."""
        inputs, outputs = np.array([1.3002e-4, 0.9e-4]), np.array([2e-5, 0.0])
        for kind, delays in (("estimate", np.full((N_Y, N_U), 1.3002e-4)), ("per_channel", outputs[:, None] + inputs)):
            G = plant(F) * np.exp(-2j * np.pi * F[:, None, None] * delays)
            write_frf(WORK / "frf.h5", F, G + self.sd * circular(np.random.default_rng(8), self.sd.shape), self.sd**2)
            shown = fit("frf.h5", "-o", "model.json", "--delay", kind, *self.arguments).stdout
            told = json.loads(program("--json", "fit", "frf.h5", "-o", "m2.json", "--delay", kind, *self.arguments).stdout)
            m = model()
            for key in ("input_delay_s", "output_delay_s", "input_delay_std_s", "output_delay_std_s"):
                self.assertEqual(told["delays"][key], m[key])
            with h5py.File(WORK / "c.h5") as h:
                std = dict(zip((n.decode() for n in h["parameters/name"]), np.sqrt(np.diag(h["covariance/sandwich"][:]))))
            if kind == "estimate":
                np.testing.assert_allclose(m["input_delay_std_s"], [std["input_delay_s"]] * 2, rtol=1e-6)
                self.assertEqual(m["output_delay_std_s"], [0, 0])
                self.assertRegex(shown, r"(?m)^delay \d+\.\d+ \+- \d+\.\d+ us$")
                self.assertLess(abs(m["input_delay_s"][0] - 1.3002e-4), 4 * m["input_delay_std_s"][0])
            else:
                np.testing.assert_allclose(m["input_delay_std_s"], [std[f"input_delay_s[{u}]"] for u in range(2)], rtol=1e-6)
                np.testing.assert_allclose(m["output_delay_std_s"], [std["output_delay_s[0]"], 0], rtol=1e-6)
                self.assertRegex(shown, r"(?m)^delay of input i0 \d+\.\d+ \+- \d+\.\d+ us$")
                self.assertRegex(shown, r"(?m)^delay of output o1 0 us, the reference$")
                for side, truth in (("input", inputs), ("output", outputs)):
                    error = abs(np.array(m[f"{side}_delay_s"]) - truth)
                    self.assertTrue((error <= 4 * np.array(m[f"{side}_delay_std_s"])).all(), error)
        write_frf(WORK / "frf.h5", F, plant(F))
        shown = fit("frf.h5", "-o", "model.json", "--modes", "120,250").stdout
        self.assertNotIn("\ndelay ", shown)
        self.assertNotIn("input_delay_std_s", model())

    def test_an_unstable_mode_is_told_at_the_export(self):
        write_frf(WORK / "frf.h5", F, plant(F))
        fit("frf.h5", "-o", "model.json", "--modes", "120,250")
        self.assertEqual(program("export", "model.json", "-o", "plant.csv").stderr, "")
        m = model()
        unstable = modes_of(m)[0]
        unstable["denominator"][1] *= -1.0
        unstable["damping_ratio"] *= -1.0
        (WORK / "unstable.json").write_text(json.dumps(m))
        done = program("export", "unstable.json", "-o", "plant.csv")
        self.assertEqual(done.returncode, 0)
        self.assertIn("unstable.json: the mode at 120 Hz is unstable", done.stderr)

    def test_another_ending_is_refused(self):
        self.measure(1)
        done = fit("frf.h5", "-o", "model.json", "--covariance", "c.csv", code=2)
        self.assertIn("c.csv: a covariance is written as .h5", done.stderr)
        self.assertFalse((WORK / "c.csv").exists())

    def test_without_deviations_the_model_stands_and_the_code_says_so(self):
        write_frf(WORK / "one.h5", F[:100], plant(F[:100]))
        (WORK / "c.h5").unlink(missing_ok=True)
        done = program("fit", "one.h5", "-o", "model.json", "--modes", "none", "--rigid-body", "full",
                       "--max-iterations", "1", "--covariance", "c.h5")
        self.assertEqual((WORK / "c.h5").exists(), done.returncode != 3 or "c.h5: not written" not in done.stderr)


class LineAtZero(unittest.TestCase):
    f = np.linspace(0.0, 400.0, 401)

    def setUp(self):
        random = np.random.default_rng(3)
        G = np.empty((len(self.f), N_Y, N_U), complex)
        G[1:] = plant(self.f[1:])
        G[0] = G[1].real
        self.G = G * (1 + 1e-3 * circular(random, G.shape))
        write_frf(WORK / "dc.h5", self.f, self.G)
        write_frf(WORK / "ac.h5", self.f[1:], self.G[1:])

    def test_it_is_left_out_and_told(self):
        for structure in ((), ("--rigid-body", "none")):
            done = fit("dc.h5", "-o", "dc.json", "--modes", "120,250", *structure, code=program(
                "fit", "ac.h5", "-o", "ac.json", "--modes", "120,250", *structure).returncode)
            self.assertIn("dc.h5: the line at 0 Hz is ignored", done.stderr)
            dc, ac = model("dc.json"), model("ac.json")
            self.assertEqual(dc["submodels"], ac["submodels"])
            self.assertTrue(any("0 Hz is ignored" in d for d in dc["provenance"]["decisions"]))

    def test_modes_are_those_of_the_other_lines(self):
        with_dc = program("modes", "dc.h5")
        self.assertEqual(with_dc.stdout, program("modes", "ac.h5").stdout)
        self.assertIn("0 Hz is ignored", with_dc.stderr)

    def test_nothing_but_it_is_refused(self):
        for command in (("fit", "dc.h5", "-o", "n.json"), ("modes", "dc.h5")):
            done = program(*command, "--band", "0", "0.5")
            self.assertEqual(done.returncode, 2)
            self.assertIn("use a wider --band", done.stderr)

    def test_weights_of_the_whole_response_are_taken(self):
        W = 1 / abs(self.G) ** 2
        for name, weights in (("w.h5", W), ("wb.h5", W[1:])):
            with h5py.File(WORK / name, "w") as h:
                h["weights"] = weights
        fit("dc.h5", "-o", "a.json", "--modes", "120,250", "--weighting", "w.h5")
        fit("dc.h5", "-o", "b.json", "--modes", "120,250", "--weighting", "wb.h5")
        self.assertEqual(model("a.json")["submodels"], model("b.json")["submodels"])


class WeightOfZero(unittest.TestCase):
    def setUp(self):
        random = np.random.default_rng(8)
        self.sd = 1e-2 * abs(plant(F))
        write_frf(WORK / "frf.h5", F, plant(F) + self.sd * circular(random, self.sd.shape), self.sd**2)
        W = 1 / self.sd**2
        W[:, 1, 0] = 0
        with h5py.File(WORK / "w.h5", "w") as h:
            h["weights"] = W

    def test_the_rest_keeps_its_deviations(self):
        done = fit("frf.h5", "-o", "model.json", "--modes", "120,250", "--weighting", "w.h5")
        self.assertIn("(o1, i0) (output, input) has zero weight", done.stderr)
        m = model()
        self.assertTrue(any("has zero weight" in d for d in m["provenance"]["decisions"]))
        for s in m["submodels"]:
            std = s["numerator_std"][0]
            self.assertIsNone(std[1][0])
            self.assertTrue(all(std[y][u] > 0 for y, u in ((0, 0), (0, 1), (1, 1))))
            self.assertNotIn("modal_mass_std", s)  # a shape that lacks an entry has none
        for s, (f, z) in zip(modes_of(m), MODES):
            self.assertLess(abs(s["natural_frequency_hz"] - f), 4 * s["natural_frequency_std_hz"])
            self.assertLess(abs(s["damping_ratio"] - z), 4 * s["damping_ratio_std"])
        self.assertEqual(program("export", "model.json", "-o", "back.json").returncode, 0)
        self.assertIsNone(model("back.json")["submodels"][0]["numerator_std"][0][1][0])

    def test_deviations_are_those_of_the_other_entries(self):
        fit("frf.h5", "-o", "model.json", "--modes", "120,250", "--weighting", "w.h5")
        left = modes_of(model())
        # Three channels' Fisher matrix, poles and numerators, by differences.
        names = [(i, p) for i in range(2) for p in (0, 1)]
        a = [[2 * z / (2 * np.pi * f), 1 / (2 * np.pi * f) ** 2] for f, z in MODES]
        modal, body = residues()
        s = 2j * np.pi * F
        columns = []
        for i, p in names:
            A = 1 + a[i][0] * s + a[i][1] * s**2
            J = -modal[i][None] * (s ** (p + 1) / A**2)[:, None, None] * a[i][p]
            columns.append(np.delete((J / self.sd).reshape(len(F), 4), 2, axis=1).ravel())
        for c in (0, 1, 3):
            for basis in (1 / s**2, *(1 / (1 + q[0] * s + q[1] * s**2) for q in a)):
                J = np.zeros((len(F), 4), complex)
                J[:, c] = basis / self.sd.reshape(len(F), 4)[:, c]
                columns.append(np.delete(J, 2, axis=1).ravel())
        J = np.array(columns)
        J /= np.linalg.norm(J, axis=1)[:, None]
        norms = np.linalg.norm(np.array(columns), axis=1)
        C = np.linalg.inv(2 * (J.conj() @ J.T).real) / np.outer(norms, norms)
        for i, mode in enumerate(left):
            f_std = 0.5 * MODES[i][0] * np.sqrt(C[2 * i + 1, 2 * i + 1])
            self.assertAlmostEqual(mode["natural_frequency_std_hz"] / f_std, 1.0, delta=0.1)


class CoarseLines(unittest.TestCase):
    def weights(self, f, relative):
        random = np.random.default_rng(4)
        G = plant(f)
        noise = relative * np.median(abs(G), axis=0)
        write_frf(WORK / "coarse.h5", f, G + noise * circular(random, G.shape), noise**2 * np.ones_like(abs(G)), realizations=1)
        done = program("fit", "coarse.h5", "-o", "model.json", "--modes", "120,250")
        return model()["fit"]["weighting"], done.stderr

    def test_scatter_of_coarse_lines_is_not_taken_for_distortion(self):
        for lines in (12, 20, 30, 40):
            with self.subTest(lines=lines):
                weighting, said = self.weights(np.linspace(20, 400, lines), 1e-4)
                self.assertEqual(weighting, "noise_variance", said)

    def test_distortion_on_fine_lines_is(self):
        random = np.random.default_rng(4)
        f = np.linspace(20, 400, 800)
        G = plant(f)
        sd = 1e-3 * np.median(abs(G), axis=0) * np.ones_like(abs(G))
        write_frf(WORK / "fine.h5", f, G + 10 * sd * circular(random, G.shape), sd**2, realizations=1)
        fit("fine.h5", "-o", "model.json", "--modes", "120,250")
        self.assertEqual(model()["fit"]["weighting"], "total_variance")


class FilesOfOthers(unittest.TestCase):
    """Structures that the defaults do not describe, without any flag: the search ends by itself, with the true modes."""

    def found(self, seed, first_hz, last_hz, step_hz, measure, units):
        """The modes of what measure(random, s) describes: natural frequencies in the band, response and deviation."""
        random = np.random.default_rng(seed)
        f = np.arange(first_hz, last_hz, step_hz)
        true_hz, G, sd = measure(random, 2j * np.pi * f[:, None, None])
        write_frf(WORK / "others.h5", f, G + sd * circular(np.random.default_rng(seed), G.shape), sd**2,
                  units=units)
        fit("others.h5", "-o", "model.json")
        modes = [m for m in modes_of(model()) if f[0] < m["natural_frequency_hz"] < f[-1]]
        np.testing.assert_equal(len(modes), len(true_hz))
        for mode, hz in zip(sorted(modes, key=lambda m: m["natural_frequency_hz"]), true_hz):
            self.assertLess(abs(mode["natural_frequency_hz"] - hz), 4.5 * mode["natural_frequency_std_hz"], mode)

    def test_an_impact_test_of_five_accelerometers(self):
        def measure(random, s):
            true_hz = np.sort(random.uniform(20.0, 780.0, 14))
            G = 0.0
            for w in 2.0 * np.pi * true_hz:
                zeta = random.uniform(0.002, 0.02)
                G = G + random.standard_normal((5, 1)) * w * s**2 / (s**2 + 2.0 * zeta * w * s + w**2)
            return true_hz, G, 0.02 * np.abs(G).mean() * (1.0 + 40.0 * np.pi / np.abs(s)) * np.ones(G.shape)
        for seed in (11, 12, 13):
            with self.subTest(seed=seed):
                self.found(seed, 5.0, 800.0, 0.5, measure, ("N", "m/s^2"))

    def test_a_beam_with_complex_modes_and_a_delay(self):
        def measure(random, s):
            true_hz = np.array([31.0, 86.0, 169.0, 279.0, 417.0, 582.0, 775.0])
            G = 0.0
            for hz in (*true_hz, 1094.5):
                zeta = random.uniform(0.004, 0.01)
                pole = 2.0 * np.pi * hz * (-zeta + 1j * np.sqrt(1.0 - zeta**2))
                residue = 1j * np.outer(random.standard_normal(2), random.standard_normal(2)) \
                    * np.exp(0.2j * random.standard_normal((2, 2)))
                G = G + residue / (s - pole) + residue.conj() / (s - np.conj(pole))
            G = G * s**2 * np.exp(-3e-4 * s)
            return true_hz, G, 0.01 * np.abs(G).mean() * np.ones(G.shape)
        for seed in (21, 22, 23):
            with self.subTest(seed=seed):
                self.found(seed, 10.0, 1000.0, 0.625, measure, ("N", "m/s^2"))

    def test_an_actuator_that_was_not_excited(self):
        def measure(random, s):
            true_hz = np.array([60.0, 140.0, 230.0, 310.0])
            G = 0.0
            for w in 2.0 * np.pi * true_hz:
                G = G + np.outer(random.standard_normal(3), random.standard_normal(3)) * w / (s**2 + 0.02 * w * s + w**2)
            G[:, :, 2] = 0.0
            return true_hz, G, 1e-3 * np.abs(G).mean() * np.array([1.0, 1.0, 3e3]) * np.ones(G.shape)
        self.found(31, 10.0, 500.0, 0.5, measure, ("N", "m"))


if __name__ == "__main__":
    WORK.mkdir(parents=True, exist_ok=True)
    sys.argv = sys.argv[:1] + sys.argv[3:]
    unittest.main()
