#!/usr/bin/python3
"""The Python package gives what the program gives, to the bit. Arguments: experiment.py."""

import dataclasses
import json
import shutil
import subprocess

from experiment import CONFIG, PROGRAM, WORK, Case, file_bytes, program, run_tests, setUpModule

import h5py
import numpy as np

import stageid

BAND = (120.0, 800.0)


def read_run():
    """The log, its arrays, and what a log of arrays also needs."""
    log = stageid.read_log(WORK / "run.slog")
    return log, log.arrays(), dict(sample_rate_hz=log.sample_rate_hz, transient_periods=log.transient_periods)


def as_json(result, without=None):
    """As the program writes it: an empty text for what is absent."""
    return {key: "" if value is None else value for key, value in vars(result).items() if key != without}


class SameAsTheProgram(Case):
    def assert_same_frf(self, frf, file):
        with h5py.File(WORK / file) as h5:
            for name in ("frequency_hz", "response", "noise_variance", "total_variance"):
                np.testing.assert_array_equal(getattr(frf, name), h5[name][()])

    def assert_same_file(self, result, file):
        self.assertEqual(file_bytes(result), (WORK / file).read_bytes())

    def test_commands_write_the_same_bytes(self):
        self.assertEqual(stageid.call("frf", WORK / "run.slog", "-o", WORK / "again.h5"), 0)
        self.assertEqual((WORK / "again.h5").read_bytes(), (WORK / "frf.h5").read_bytes())

    def test_the_simulated_samples(self):
        log = stageid.simulate(CONFIG)
        r, u, y = log.arrays()
        with h5py.File(WORK / "run.h5") as h5:
            self.assertEqual(u.shape[0] * u.shape[1], len(h5["runs"]))
            for run in h5["runs"].values():
                at = run.attrs["realization"], run.attrs["experiment"]
                np.testing.assert_array_equal(r[at], run["excitation"][()])
                np.testing.assert_array_equal(u[at], run["actuators"][()])
                np.testing.assert_array_equal(y[at], run["sensors"][()])
        self.assert_same_frf(stageid.frf(log), "frf.h5")

    def test_a_response_from_a_file(self):
        for log in ("run.slog", "run.h5"):
            program("frf", log, "-o", "program.h5")
            self.assert_same_file(stageid.frf(WORK / log), "program.h5")
        self.assert_same_file(stageid.frf([self.log], threads=1), "frf.h5")

    def test_a_response_with_options(self):
        program("frf", "run.slog", "-o", "options.h5", "--realizations", "1,3", "--inputs", "a2,a1",
                "--transient-periods", "1", "--covariance", "full")
        self.assert_same_file(stageid.frf(WORK / "run.slog", realizations=[1, 3], inputs=["a2", "a1"],
                                          transient_periods=1, covariance="full"), "options.h5")
        program("frf", "run.slog", "-o", "lpm.h5", "--method", "lpm")
        self.assert_same_frf(stageid.frf(WORK / "run.slog", method="lpm"), "lpm.h5")
        program("frf", "run.slog", "-o", "one.h5", "--realizations", "2", "--outputs", "s1")
        self.assert_same_file(stageid.frf(WORK / "run.slog", realizations=2, outputs="s1"), "one.h5")

    def test_the_health_of_the_data(self):
        """Of a log with a sensor's sign turned: found as the program finds it, in memory too."""
        _, (r, u, y), settings = read_run()
        shutil.copy(WORK / "run.h5", WORK / "turned.h5")
        with h5py.File(WORK / "turned.h5", "a") as turned:
            for run in turned["runs"].values():
                run["sensors"][:, 1] *= -1
        done = subprocess.run([PROGRAM, "--json", "frf", "turned.h5", "-o", "t.h5"], cwd=WORK, capture_output=True)
        found = json.loads(done.stdout)["health"]
        self.assertIn("fault", [f["severity"] for f in found])
        frf = stageid.frf(WORK / "turned.h5")
        self.assertEqual([as_json(finding) for finding in frf.health], found)
        self.assertEqual(stageid.frf(WORK / "turned.h5", health=False).health, [])
        program("frf", "run.slog", "-o", "unseen.h5", "--no-health", "--periods", "unmarked", "--smooth-covariance", "3")
        self.assert_same_file(stageid.frf(WORK / "run.slog", health=False, periods="unmarked", covariance_lines=3),
                              "unseen.h5")
        in_memory = stageid.Log(r, u, y, **settings)
        self.assertNotIn("fault", [f.severity for f in stageid.frf(in_memory).health])

    def test_a_response_from_arrays(self):
        read, (r, u, y), settings = read_run()
        names = dict(excitation=read.excitation, actuators=read.actuators, sensors=read.sensors)
        orders = {"C": (u, y), "Fortran": (np.asfortranarray(u), np.asfortranarray(y)),
                  "slices": (np.concatenate([y, u], 3)[..., y.shape[3]:], np.repeat(y, 2, 2)[:, :, ::2])}
        for order, (u_given, y_given) in orders.items():
            with self.subTest(order):
                log = stageid.Log(r, u_given, y_given, **settings, **names)
                self.assert_same_frf(stageid.frf(log), "frf.h5")

    def test_marked_samples_are_not_used(self):
        read, (r, u, y), settings = read_run()
        P = read.period_samples
        marked = np.zeros(u.shape[:3], bool)
        marked[:, :, 3 * P + 5] = True  # in the second of three measured periods
        spoilt = y.copy()
        spoilt[:, :, 3 * P:4 * P] = 1e3
        without = stageid.frf(stageid.Log(r, u, spoilt, marked=marked, **settings))
        kept = np.r_[0:3 * P, 4 * P:5 * P]
        expected = stageid.frf(stageid.Log(r, u[:, :, kept], y[:, :, kept], **settings))
        np.testing.assert_array_equal(without.response, expected.response)

    def test_any_number_but_zero_marks_a_sample(self):
        r, u, y = self.log.arrays()
        marked = np.zeros(u.shape[:3])
        marked[:, :, 7] = 1
        for flags in (marked != 0, 256 * marked.astype(int), 0.5 * marked, -marked, np.nan * marked == 0, marked.tolist()):
            log = stageid.Log(r, u, y, marked=flags, sample_rate_hz=2000.0)
            expected = np.asarray(flags) != 0
            np.testing.assert_array_equal(log[0].marked, expected[0, 0])

    def test_a_fit_of_a_file(self):
        self.assert_same_file(stageid.fit(WORK / "frf.h5", band_hz=BAND).model, "model.json")
        self.assert_same_file(stageid.fit(self.frf, band_hz=BAND, threads=1).model, "model.json")

    def test_a_fit_with_options(self):
        code = program("fit", "frf.h5", "-o", "options.json", "--modes", "150.5,310", "--delay", "0.0003",
                       "--rigid-body", "2", "--residue-rank", "1", "--weighting", "relative",
                       "--direct-term", "full")
        fit = stageid.fit(WORK / "frf.h5", modes=[150.5, 310], delay=0.0003, rigid_body=2,
                          residue_rank=1, weighting="relative", direct_term="full")
        self.assert_same_file(fit.model, "options.json")
        self.assertEqual(fit.trustworthy, code == 0)

    def test_numbers_of_numpy_are_numbers(self):
        def cost(**options):
            return stageid.fit(WORK / "frf.h5", band_hz=BAND, **options).cost

        for name, plain, numbers in (("modes", 4, (np.int64(4), np.array(4))), ("rigid_body", 2, (np.int64(2),)),
                                     ("residue_rank", 1, (np.int32(1),)),
                                     ("delay", float(np.float32(6e-4)), (np.float32(6e-4), np.float64(np.float32(6e-4))))):
            for number in numbers:
                with self.subTest(name, number=repr(number)):
                    self.assertEqual(cost(**{name: number}), cost(**{name: plain}))

    def test_a_fit_without_any_file(self):
        model = stageid.fit(stageid.frf(stageid.simulate(CONFIG)), band_hz=BAND).model
        f = np.linspace(*BAND, 50)
        np.testing.assert_array_equal(model.response(f), self.model.response(f))
        for ours, theirs in zip(model.submodels, self.model.submodels):
            np.testing.assert_array_equal(ours.denominator, theirs.denominator)
            np.testing.assert_array_equal(ours.numerator, theirs.numerator)

    def test_the_covariance_is_what_the_program_writes(self):
        program("fit", "frf.h5", "-o", "with.json", "--band", *BAND, "--covariance", "covariance.h5")
        self.assertIsNone(stageid.fit(WORK / "frf.h5", band_hz=BAND).covariance)
        fit = stageid.fit(WORK / "frf.h5", band_hz=BAND, covariance=True)
        with h5py.File(WORK / "covariance.h5") as file:
            self.assertEqual([n.decode() for n in file["parameters/name"]], fit.covariance.name)
            for theirs in ("parameters/value", "covariance/sandwich", "covariance/likelihood", "response_variance",
                           "confidence_radius"):
                np.testing.assert_array_equal(getattr(fit.covariance, theirs.split("/")[-1]), file[theirs][:])
        deviation = np.sqrt(np.diag(fit.covariance.sandwich))
        by_name = dict(zip(fit.covariance.name, deviation))
        for i, submodel in enumerate(fit.model.submodels):
            std = submodel.numerator_std[0]
            for y, u in np.ndindex(std.shape):
                self.assertAlmostEqual(by_name[f"submodels[{i}].numerator[0][{y}][{u}]"] / std[y, u], 1.0, 6)
        for mode in fit.model.modes():
            self.assertTrue(0 < mode.modal_mass_std < mode.modal_mass)
            self.assertEqual(mode.input_shape_std.shape, mode.input_shape.shape)

    def test_candidate_modes(self):
        program("modes", "frf.h5", "-o", "modes.json", "--band", *BAND)
        found = stageid.modes(self.frf.select(band_hz=BAND))
        self.assertEqual([as_json(mode) for mode in found], json.loads((WORK / "modes.json").read_text())["modes"])

    def test_validation(self):
        done = json.loads(subprocess.run([PROGRAM, "--json", "validate", "model.json", "frf.h5"], cwd=WORK,
                                         capture_output=True, check=True).stdout)
        ours = stageid.validate(self.model, self.frf)
        theirs = done["frequency_domain"]
        np.testing.assert_array_equal(ours.channel_error.ravel("F"), theirs.pop("channel_error"))
        self.assertEqual(as_json(ours, without="channel_error"), theirs)

    def test_a_model_that_leaves_more_than_noise(self):
        fit = stageid.fit(self.frf, band_hz=BAND, modes=1)
        self.assertEqual((fit.trustworthy, fit.status), (False, "unexplained"))
        found = stageid.validate(fit.model, self.frf)
        self.assertIs(found.explained, False)
        self.assertRegex(found.reason, "^the residual is ")

    def test_a_validation_without_variances(self):
        bare = stageid.Frf(self.frf.frequency_hz, self.frf.response, inputs=self.frf.inputs, outputs=self.frf.outputs,
                           sample_rate_hz=self.frf.sample_rate_hz, hold=self.frf.hold)
        found = stageid.validate(self.model, bare)
        self.assertEqual(found.variance, "scatter")
        self.assertTrue(found.explained and 0.5 < found.chi_square_per_dof < 2)
        found = stageid.validate(self.model, bare.select(band_hz=(100.0, 140.0)))  # too few lines for a scatter
        for name in ("variance", "chi_square_per_dof", "expected_chi_square", "reason", "whitened_above_95",
                     "whiteness", "whiteness_limit"):
            self.assertIsNone(getattr(found, name), name)
        self.assertTrue(found.explained and found.relative_rms_error < 1)


class Values(Case):
    def test_files_as_arrays(self):
        with h5py.File(WORK / "run.h5") as h5:
            self.assertEqual(len(self.log), len(h5["runs"]))
            for run, name in zip(self.log, h5["runs"]):
                for group in ("excitation", "actuators", "sensors"):
                    np.testing.assert_array_equal(getattr(run, group), h5[f"runs/{name}/{group}"][()])

    def test_realizations_are_counted_from_1(self):
        self.assertEqual(self.log.realizations, [1, 2, 3])
        self.assertEqual([(run.realization, run.experiment) for run in self.log],
                         [(m, e) for m in (1, 2, 3) for e in (1, 2, 3)])
        r, u, y = self.log.arrays()
        np.testing.assert_array_equal(self.log[4].sensors, y[1, 1])

    def test_what_is_absent_is_none(self):
        frf = stageid.Frf([100.0, 200.0], np.ones((2, 1, 2), complex), input_units=["N", None])
        for name in ("noise_variance", "total_variance", "noise_dof", "total_dof", "sample_rate_hz", "compensated",
                     "delay_s"):
            self.assertIsNone(getattr(frf, name), name)
        self.assertEqual((frf.input_units, frf.output_units), (["N", None], [None]))
        compensated = self.frf.compensate("delay", 1e-4)
        self.assertEqual((compensated.compensated, compensated.delay_s), ("delay", 1e-4))
        model = stageid.fit(stageid.Frf(compensated.frequency_hz, compensated.response), band_hz=BAND, modes=1).model
        self.assertEqual((model.sample_rate_hz, model.input_delay_std_s), (None, None))
        self.assertEqual(model.fit.band_hz, BAND)

    def test_delays_as_states(self):
        """The response of the state space with its delays is that of the model at the samples."""
        sampled = self.model.sampled_state_space()
        shifted = dataclasses.replace(sampled, input_delay_samples=np.array([3, 0, 1]),
                                      output_delay_samples=np.array([0, 2]))
        A, B, C, D = shifted.with_delays()
        self.assertEqual(len(A), len(sampled.system.A) + 6)
        f = np.array([150.0, 333.0])
        z = np.exp(2j * np.pi * f / sampled.sample_rate_hz)
        a, b, c, d = sampled.system
        for k, zk in enumerate(z):
            system = c @ np.linalg.solve(zk * np.eye(len(a)) - a, b) + d
            expected = zk ** -np.array([[0.0], [2.0]]) * system * zk ** -np.array([3.0, 0.0, 1.0])
            np.testing.assert_allclose(C @ np.linalg.solve(zk * np.eye(len(A)) - A, B) + D, expected, rtol=1e-8)
            whole = zk ** -np.add.outer(sampled.output_delay_samples, sampled.input_delay_samples).astype(float) * system
            np.testing.assert_allclose(whole, self.model.response(f)[k], rtol=1e-6)
        early = dataclasses.replace(sampled, input_delay_samples=np.array([-1, 0, 0]))
        self.assertRaisesRegex(stageid.RequestError, "negative delay", early.with_delays)

    def test_a_model(self):
        program("export", "model.json", "-o", "model.h5")
        with h5py.File(WORK / "model.h5") as h5:
            np.testing.assert_array_equal(self.model.response(h5["frequency_hz"][()]), h5["response"][()])
            sampled = self.model.sampled_state_space()
            self.assertEqual(sampled.sample_rate_hz, self.model.sample_rate_hz)
            for kind, system in (("continuous", self.model.state_space()), ("discrete", sampled.system)):
                for given, name in zip(system, "ABCD"):
                    np.testing.assert_array_equal(given, h5[f"state_space/{kind}/{name}"][()])
            np.testing.assert_array_equal([m.modal_mass for m in self.model.modes()], h5["modes/modal_mass"][()])
        self.model.save(WORK / "saved.json")
        self.assertEqual(stageid.read_model(WORK / "saved.json").outputs, self.model.outputs)

    def test_a_model_at_one_frequency_and_at_none(self):
        n_y, n_u = len(self.model.outputs), len(self.model.inputs)
        for none in ([], np.empty(0)):
            response = self.model.response(none)
            self.assertEqual((response.shape, response.dtype), ((0, n_y, n_u), np.complex128))
        for one in (200.0, 200, np.float32(200.0)):
            np.testing.assert_array_equal(self.model.response(one), self.model.response([200.0]))
        np.testing.assert_array_equal(self.model.response(np.arange(100.0, 200.0)[::2]),
                                      self.model.response(np.arange(100.0, 200.0, 2.0)))

    def test_a_model_is_paired_with_itself(self):
        pairs = stageid.pair_modes(self.model, self.model)
        self.assertEqual([p.first for p in pairs], list(range(len(self.model.modes()))))
        for pair in pairs:
            self.assertEqual((pair.second, pair.frequency_difference), (pair.first, 0.0))
            self.assertAlmostEqual(pair.output_mac, 1.0, places=12)

    def test_a_multisine(self):
        x = stageid.multisine(1000.0, 500, 10.0, 100.0, rms=2.0, seed=7)
        self.assertAlmostEqual(np.sqrt(np.mean(x**2)), 2.0, places=12)
        lines = np.abs(np.fft.rfft(x)) > 1e-9
        np.testing.assert_array_equal(np.flatnonzero(lines), np.arange(5, 51))
        odd = stageid.multisine(1000.0, 500, 10.0, 100.0, 2.0, 7, lines="odd", crest_iterations=50)
        np.testing.assert_array_equal(np.flatnonzero(np.abs(np.fft.rfft(odd)) > 1e-9),
                                      np.arange(5, 51, 2))
        flat = stageid.multisine(1000.0, 500, 10.0, 100.0, 2.0, 7, lines="odd")
        self.assertLess(np.max(np.abs(odd)), np.max(np.abs(flat)))

    def test_a_response_of_arrays(self):
        copy = stageid.Frf(self.frf.frequency_hz, self.frf.response, noise_variance=self.frf.noise_variance,
                           noise_dof=self.frf.noise_dof, inputs=self.frf.inputs, outputs=self.frf.outputs,
                           sample_rate_hz=self.frf.sample_rate_hz, hold=self.frf.hold)
        np.testing.assert_array_equal(copy.response, self.frf.response)
        np.testing.assert_array_equal(copy.noise_variance, self.frf.noise_variance)
        self.assertIsNone(copy.total_variance)
        # F_{2, 2 nu} at 95 %, see confidence.hpp; scipy's F as the reference.
        from scipy.stats import f as f_distribution
        quantile = f_distribution.ppf(0.95, 2, 2 * self.frf.noise_dof)
        np.testing.assert_allclose(copy.confidence_radius(), np.sqrt(quantile * self.frf.noise_variance),
                                   rtol=1e-10)

    def test_selection_and_compensation(self):
        some = self.frf.select(band_hz=(100, 200), inputs=["a3", "a1"], outputs=[self.frf.outputs[1]])
        lines = (self.frf.frequency_hz >= 100) & (self.frf.frequency_hz <= 200)
        np.testing.assert_array_equal(some.response, self.frf.response[lines][:, 1:2][:, :, [2, 0]])
        T = 1 / self.frf.sample_rate_hz
        w = 2 * np.pi * self.frf.frequency_hz[:, None, None]
        expected = self.frf.response * np.exp(1j * w * (1e-4 + T / 2))
        np.testing.assert_allclose(self.frf.compensate("delay", 1e-4).response, expected, rtol=1e-12)

    def test_mode_indicator(self):
        expected = np.linalg.svd(self.frf.response, compute_uv=False).T**2
        # Squared singular values from G G^H: the small one loses the digits of its ratio to the large.
        np.testing.assert_allclose(stageid.cmif(self.frf), expected, rtol=1e-9, atol=1e-13 * expected.max())
        poles = stageid.stabilization(self.frf, most_order=20)
        self.assertTrue(all(0 < p.frequency_hz <= self.frf.frequency_hz[-1] for p in poles))
        self.assertEqual(max(p.order for p in poles), 20)


class Memory(Case):
    """Arrays share memory with what they come from, where the docstrings say so."""

    def test_views(self):
        frf = stageid.frf(stageid.simulate(CONFIG))
        for name in ("response", "noise_variance"):
            self.assertTrue(np.shares_memory(getattr(frf, name), getattr(frf, name)), name)
        self.assertFalse(frf.response.flags.writeable)
        response = frf.response
        before = response.copy()
        del frf  # the array keeps the response alive
        np.testing.assert_array_equal(response, before)

    def test_arrays_of_a_log_are_not_copied(self):
        r, u, y = stageid.simulate(CONFIG).arrays()
        again = stageid.Log(r, u, y, sample_rate_hz=2000.0).arrays()
        for given, held in zip((r, u, y), again):
            self.assertTrue(np.shares_memory(given, held))
        self.assertIs(u.base, y.base)  # the recorded rows


if __name__ == "__main__":
    run_tests()
