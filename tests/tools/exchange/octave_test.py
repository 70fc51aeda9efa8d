#!/usr/bin/python3
"""Octave reads what ours writes and runs the program that `export` makes of a model; ours reads what it saves.

    octave_test.py PROGRAM WORK_DIR

Exit code 77 (skipped) when there is no octave-cli: it is too large to be asked for by the tests.
"""

import json
import shutil
import subprocess
import sys

import numpy as np

from exchange_test import MODEL, WORK, Case, content, run_tests

OCTAVE = shutil.which("octave-cli")


class Octave(Case):
    def octave(self, script):
        result = subprocess.run([OCTAVE, "--norc", "--quiet", "--eval", script], capture_output=True, text=True, cwd=WORK)
        self.assertEqual(result.returncode, 0, result.stderr)
        return result.stdout

    def numbers(self, file, name):
        """A variable or field of a .mat file as Octave has it, column-major."""
        self.octave(f"m = load('{file}'); v = m.{name}; f = fopen('v.bin', 'w'); "
                    "fwrite(f, [real(v(:)); imag(v(:))], 'double'); fclose(f);")
        real, imaginary = np.fromfile(WORK / "v.bin").reshape(2, -1)
        return real + 1j * imaginary

    def same(self, h5, files, names):
        for file in files:
            for name in names:
                value = content(h5)[name]
                given = (np.moveaxis(value, 0, -1) if value.ndim == 3 else value).ravel(order="F")
                np.testing.assert_array_equal(self.numbers(file, name.replace("/", ".")), given, f"{file} {name}")

    def export_model(self, *names):
        (WORK / "model.json").write_text(json.dumps(MODEL))
        for name in names:
            self.exports("model.json", name, flags=["--mat-version", "7.3"] if "73" in name else ())

    def test_runs_the_function_that_holds_the_model(self):
        self.export_model("m.m", "m.mat")
        # A sum of a rigid body and modes loses digits by cancellation, as in the Python script.
        self.octave("load m.mat; model = m(); P = model.response(frequency_hz);"
                    "e = max(abs(P(:) - response(:)) ./ abs(response(:))); assert(e < 3e-10);"
                    "assert(isequal(model.Ad, state_space.discrete.A)); assert(isequal(model.outputs{2}, 'z''2'));")

    def test_builds_what_the_toolboxes_of_matlab_take(self):
        """Stand-ins keep their arguments: sizes, delays, sample times, and A as umat and ureal make it."""
        uncertain = json.loads(json.dumps(MODEL))
        uncertain["submodels"][1].update(natural_frequency_std_hz=0.02, damping_ratio_std=1e-4)
        (WORK / "model.json").write_text(json.dumps(uncertain))
        self.exports("model.json", "m.m")
        stubs = WORK / "stubs"
        stubs.mkdir(exist_ok=True)
        for name, body in (("ss", "s.args = varargin;"), ("idss", "s.from = varargin{1};"), ("absorbDelay", "s = varargin{1}; s.absorbed = true;"),
                           ("idfrd", "s.args = varargin;"), ("uss", "s = [];"), ("umat", "s = varargin{1};"),
                           ("ureal", "global radius; radius.(varargin{1}) = varargin{4}; s = varargin{2};")):
            (stubs / f"{name}.m").write_text(f"function s = {name}(varargin)\n{body}\nend\n")
        self.octave("addpath('stubs'); global radius; radius = struct(); model = m(); a = model.continuous.args;"
                    "assert(isequal(a(1:4), {model.A, model.B, model.C, model.D})); assert(isequal(a{6}, model.input_delay_s));"
                    "u = model.uncertain.args{1}; assert(max(abs(u(:) - model.A(:))) < 1e-9 * max(abs(model.A(:))));"
                    "assert(abs(radius.f1 - 1.96 * 0.02) < 1e-12); assert(abs(radius.zeta1 - 1.96e-4) < 1e-12);"
                    "s = model.sampled.args; assert(s{5} == 1 / model.sample_rate_hz); assert(isequal(s{7}, model.input_delay_samples));"
                    "assert(model.identified.from.absorbed);"
                    "g = model.frd.args; assert(isequal(size(g{1}), [size(model.C, 1), size(model.B, 2), 1000]));"
                    "assert(abs(g{2}(end) - 2 * pi * model.band_hz(2)) < 1e-9); assert(g{3} == 1 / model.sample_rate_hz);")

    def test_loads_models_to_the_bit(self):
        self.export_model("m.mat", "m73.mat", "m.h5")
        self.same("m.h5", ("m.mat", "m73.mat"),
                  ("response", "state_space/continuous/A", "state_space/discrete/B", "modes/output_shape"))
        self.assertEqual(self.octave("m = load('m.mat'); printf('%s ', m.outputs{:}, m.hold);"), "z1 z'2 exact ")

    def test_loads_frequency_responses_to_the_bit(self):
        frf = self.frf()
        self.exports(frf, "f.mat")
        self.exports(frf, "f73.mat", flags=["--mat-version", "7.3"])
        self.same(frf, ("f.mat", "f73.mat"), ("response", "noise_variance", "frequency_hz"))

    def test_what_it_saves_is_imported_to_the_bit(self):
        frf = self.frf()
        self.exports(frf, "f.mat")
        self.octave("load f.mat; f = frequency_hz; G = response;"
                    "save -v6 v6.mat f G; save -v7 v7.mat f G; save own.mat f G; save -hdf5 h5.mat f G;")
        for file in ("v6.mat", "v7.mat"):
            self.imports(file, map="kind: frf\nfrequency: f\nfrequency_unit: Hz\nresponse: G\n"
                         "axes: [output, input, line]\noutput_unit: m\ninput_unit: N\n")
            for name in ("response", "frequency_hz"):
                np.testing.assert_array_equal(content()[name], content(frf)[name])
        self.refuse("own.mat: is in the native Octave format; write it in Octave with 'save -v7", "import", "own.mat")
        self.refuse("h5.mat: is HDF5, but not a MATLAB file; write it in Octave with 'save -v7", "import", "h5.mat")


if __name__ == "__main__":
    if OCTAVE is None:
        print("no octave-cli; apt-get install octave")
        sys.exit(77)
    run_tests()
