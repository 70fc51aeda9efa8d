#!/usr/bin/python3
"""Objects of the package go through pickle, copy and deepcopy. Arguments: experiment.py."""

import copy
import multiprocessing
import pickle

from experiment import CONFIG, WORK, Case, file_bytes, run_tests, setUpModule

import numpy as np

import stageid


def copies(thing):
    return (pickle.loads(pickle.dumps(thing)), copy.copy(thing), copy.deepcopy(thing))


def half(frf, band_hz):
    return frf.select(band_hz=band_hz)


class Pickles(Case):
    def same_bytes(self, thing):
        """A copy is written as the same file."""
        for number, other in enumerate(copies(thing)):
            with self.subTest(number):
                self.assertIsNot(other, thing)
                self.assertEqual(file_bytes(other), file_bytes(thing))

    def test_frequency_responses(self):
        frf = stageid.frf(WORK / "run.slog", covariance="full")
        self.same_bytes(frf)
        self.same_bytes(stageid.Frf([1.0, 2.0], np.ones((2, 1, 1), complex)))
        other = pickle.loads(pickle.dumps(frf))
        self.assertEqual(other.health, frf.health)
        self.assertIsNone(stageid.Frf([1.0], np.ones((1, 1, 1), complex)).noise_variance)

    def test_fits_and_models(self):
        fit = stageid.fit(self.frf, band_hz=(120, 800), covariance=True)
        self.same_bytes(fit.model)
        for other in copies(fit):
            for key in ("status", "message", "trustworthy", "cost", "decisions", "removal_cost"):
                self.assertEqual(getattr(other, key), getattr(fit, key), key)
            np.testing.assert_array_equal(other.response_variance, fit.response_variance)
            self.assertEqual(other.covariance.name, fit.covariance.name)
            for key in ("sandwich", "likelihood", "response_variance", "confidence_radius"):
                np.testing.assert_array_equal(getattr(other.covariance, key), getattr(fit.covariance, key))
            np.testing.assert_array_equal(other.model.response([200.0]), fit.model.response([200.0]))

    def test_logs(self):
        for log in (stageid.simulate(CONFIG), self.log):
            expected = stageid.frf(log)
            for other in copies(log):
                self.assertEqual((len(other), other.sample_rate_hz, other.sensor_units),
                                 (len(log), log.sample_rate_hz, log.sensor_units))
                for a, b in zip(other.arrays(), log.arrays()):
                    np.testing.assert_array_equal(a, b)
                np.testing.assert_array_equal(stageid.frf(other).response, expected.response)

    def test_a_log_in_memory_keeps_its_marks(self):
        g = np.random.default_rng(1)
        marked = np.zeros((1, 1, 200), np.uint8)
        marked[0, 0, 77] = 1
        log = stageid.Log(np.ones((1, 1, 50, 1)), g.normal(size=(1, 1, 200, 1)), g.normal(size=(1, 1, 200, 1)),
                          sample_rate_hz=100.0, marked=marked)
        for other in copies(log):
            np.testing.assert_array_equal(other[0].marked, log[0].marked)

    def test_results(self):
        model = self.model
        for result in (self.log[0], stageid.modes(self.frf)[0], model.modes()[0], model.submodels[0], model.fit,
                       stageid.validate(model, self.frf), stageid.pair_modes(model, model)[0],
                       model.sampled_state_space()):
            for other in copies(result):
                self.assertIs(type(other), type(result))
                for name, value in vars(result).items():
                    np.testing.assert_equal(getattr(other, name), value)
        for named in (model.state_space(), self.log.arrays()):
            for other in copies(named):
                self.assertEqual(other._fields, named._fields)

    def test_worker_processes(self):
        with multiprocessing.Pool(2) as pool:
            low, high = pool.starmap(half, [(self.frf, (120, 400)), (self.frf, (400, 800))])
        np.testing.assert_array_equal(low.response, self.frf.select(band_hz=(120, 400)).response)
        np.testing.assert_array_equal(high.frequency_hz, self.frf.select(band_hz=(400, 800)).frequency_hz)


if __name__ == "__main__":
    run_tests()
