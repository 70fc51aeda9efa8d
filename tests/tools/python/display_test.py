#!/usr/bin/python3
"""How objects are displayed, and what they become in other packages. Arguments: experiment.py."""

import subprocess
import sys
import types
from html.parser import HTMLParser
from unittest import mock

from experiment import CONFIG, PACKAGES, WORK, Case, run_tests, setUpModule

import numpy as np

import stageid


class Tags(HTMLParser):
    """Checks that every tag is closed, and collects the text."""

    def __init__(self, html):
        super().__init__()
        self.open, self.text = [], []
        self.feed(html)
        self.close()
        assert not self.open, self.open

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag, tag

    def handle_data(self, data):
        self.text.append(data)


class Display(Case):
    def shows(self, thing, text, *in_notebook):
        self.assertRegex(repr(thing), text)
        self.assertNotIn("\n", repr(thing))
        if in_notebook:
            html = " ".join(Tags(thing._repr_html_()).text)
            for word in in_notebook:
                self.assertIn(word, html)

    def test_logs(self):
        self.shows(self.log, "^<Log 9 runs, 3 complete realizations, 3 actuators, 2 sensors, 2000 Hz>$",
                   "a1 (N)", "1, 2, 3", "500 samples, 0.25 s")
        self.shows(stageid.simulate(CONFIG)[4], "^<Run of realization 2, experiment 2, 2500 samples>$")

    def test_responses(self):
        self.shows(self.frf, "^<Frf 2 x 3, [0-9]+ lines, 16 to 800 Hz, noise and total variance>$", "a3 (N)", "2000 Hz")
        one = stageid.Frf([50.0], [[[1j]]], inputs=["<in & out>"])
        self.shows(one, "^<Frf 1 x 1, 1 line, 50 to 50 Hz, no variance>$", "<in & out>")

    def test_models(self):
        fit = stageid.fit(WORK / "frf.h5", band_hz=(120, 800))
        modes = len(fit.model.modes())
        last = f"{fit.model.modes()[-1].natural_frequency_hz:.6g} ± "
        self.shows(fit.model, f"^<Model 2 x 3, {modes} modes?, ([0-9]+ other submodels?, )?hold exact>$", last)
        self.shows(fit, f"^<Fit trustworthy, {fit.status}, cost [0-9.]+, {modes} modes>$", last, fit.decisions[0])

    def test_results(self):
        self.shows(self.model.modes()[0], "^<Mode [0-9.]+ Hz, damping ratio 0.0[0-9]+>$")
        self.shows(self.model.submodels[0], "^<Submodel of order [0-9], ")
        self.shows(stageid.validate(self.model, self.frf), "^<Validation: relative error .*, chi-square .* explained>$")
        self.shows(self.model.sampled_state_space(),
                   "^<SampledStateSpace 2 x 3, [0-9]+ states, 2000 Hz, delays up to [0-9]")


class OtherPackages(Case):
    def test_they_are_imported_only_when_asked_for(self):
        code = "import stageid, sys; print({'xarray', 'control', 'scipy'} & sys.modules.keys())"
        done = subprocess.run([sys.executable, "-c", code], env={"PYTHONPATH": str(PACKAGES)}, capture_output=True,
                              text=True, check=True)
        self.assertEqual(done.stdout.strip(), "set()")

    def test_a_package_that_is_missing(self):
        for name, method in (("xarray", self.frf.to_xarray), ("control", self.model.to_control)):
            with mock.patch.dict(sys.modules, {name: None}), \
                 self.assertRaisesRegex(ImportError, f"requires the package {name}: pip install {name}"):
                method()

    def test_xarray(self):
        data = self.frf.to_xarray()
        self.assertEqual(data.response.dims, ("frequency", "output", "input"))
        self.assertTrue(np.shares_memory(data.response.values, self.frf.response))
        at = data.response.sel(output=self.frf.outputs[1], input="a3").sel(frequency=201.0, method="nearest")
        self.assertEqual(at.item(), self.frf.response[np.argmin(np.abs(self.frf.frequency_hz - 201.0)), 1, 2])
        np.testing.assert_array_equal(data.noise_variance, self.frf.noise_variance)
        self.assertEqual(data.noise_variance.attrs, {"units": "(m/N)^2", "degrees_of_freedom": self.frf.noise_dof})
        self.assertEqual((data.response.units, data.frequency.units, data.attrs["sample_rate_hz"], data.attrs["hold"]),
                         ("m/N", "Hz", 2000.0, "zoh"))
        self.assertEqual(list(data.input_unit.values), ["N"] * 3)
        self.assertNotIn("delay_s", data.attrs)
        bare = stageid.Frf([1.0, 2.0], np.ones((2, 1, 2), complex), input_units=["N", "A"]).to_xarray()
        self.assertEqual((list(bare.data_vars), bare.response.attrs), (["response"], {}))

    def test_control(self):
        """control.ss() is called with what the package takes, here by a recorder in its place."""
        recorder = types.ModuleType("control")
        recorder.ss = lambda *words, **names: (words, names)
        sampled = self.model.sampled_state_space()
        with mock.patch.dict(sys.modules, {"control": recorder}):
            for options in ({}, {"sampled": True}):
                (*system, step), names = self.model.to_control(**options)
                self.assertEqual((step, names),
                                 (1 / 2000, {"inputs": self.model.inputs, "outputs": self.model.outputs}))
                for given, expected in zip(system, sampled.with_delays(), strict=True):
                    np.testing.assert_array_equal(given, expected)
            continuous, _ = self.model.to_control(sampled=False)
            for given, expected in zip(continuous, self.model.state_space(), strict=True):
                np.testing.assert_array_equal(given, expected)
            bare = stageid.Frf(self.frf.frequency_hz, self.frf.response)
            no_rate = stageid.fit(bare, band_hz=(120, 800), modes=1).model
            self.assertEqual(len(no_rate.to_control()[0]), 4)
            self.assertRaisesRegex(stageid.RequestError, "rate", no_rate.to_control, sampled=True)


if __name__ == "__main__":
    run_tests()
