#!/usr/bin/python3
"""`stageid fit --hold exact` on the exact sampled response of a stage, computed here by zero-order-hold equivalents
in scipy: frequencies, damping ratios and delays come back, without noise and at 40 dB.

    exact_data_test.py PROGRAM WORK_DIR
"""

import json
import pathlib
import shutil
import subprocess
import sys
import unittest

import numpy as np
import scipy.linalg

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1] / "support"))
from frf_file import write_frf  # noqa: E402

PROGRAM, WORK = sys.argv[1], pathlib.Path(sys.argv[2])
RATE_HZ, N_Y, N_U = 5000.0, 3, 6
FREQUENCY_HZ = np.arange(1.0, 2000.5, 1.0)
MODES_HZ = np.array([31.7, 88.2, 143.9, 144.6, 260.3, 351.1, 420.8, 575.5, 731.9, 902.4, 1234.5, 1711.1])
DAMPING = np.array([0.012, 0.004, 0.003, 0.006, 0.02, 0.0025, 0.008, 0.005, 0.003, 0.011, 0.007, 0.004])


def held(A, B, C, delay_s):
    """Response of C (sI - A)^-1 B e^(-s delay) through a zero-order hold and a sampler, on all lines."""
    period_s = 1.0 / RATE_HZ
    samples = int(np.floor(delay_s * RATE_HZ))
    late_s = delay_s - samples * period_s
    n = len(A)

    def step(seconds):  # e^(A t), and the integral of e^(A v) B over [0, t]
        whole = scipy.linalg.expm(seconds * np.block([[A, B], [np.zeros((1, n + 1))]]))
        return whole[:n, :n], whole[:n, n:]

    early, now = step(period_s - late_s)
    before = early @ step(late_s)[1]
    z = np.exp(2j * np.pi * FREQUENCY_HZ / RATE_HZ)[:, None, None]
    state = np.linalg.solve(z * np.eye(n) - step(period_s)[0], now + before / z)
    return (C @ state)[:, 0, 0] * z[:, 0, 0] ** -samples


def stage(delay_s):
    """lines x outputs x inputs: a rigid body and modes of rank one. delay_s: outputs x inputs."""
    g = np.random.default_rng(12)
    terms = [(0.0, 0.0, g.normal(size=(N_Y, N_U)))]
    for hz, zeta in zip(MODES_HZ, DAMPING):
        terms.append((2 * np.pi * hz, zeta, np.outer(g.normal(size=N_Y), g.normal(size=N_U))))
    G = np.zeros((len(FREQUENCY_HZ), N_Y, N_U), complex)
    B, C = np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]])
    for omega, zeta, residue in terms:
        A = np.array([[0.0, 1.0], [-(omega**2), -2 * zeta * omega]])
        curves = {delay: held(A, B, C, delay) for delay in np.unique(delay_s)}
        for i in range(N_Y):
            for j in range(N_U):
                G[:, i, j] += residue[i, j] * curves[delay_s[i, j]]
    return G


def fitted(G, *arguments, hold="exact", exit_code=0, variance=None):
    write_frf(WORK / "frf.h5", FREQUENCY_HZ, G, variance, sample_rate_hz=RATE_HZ, hold="zoh")
    done = subprocess.run([PROGRAM, "fit", WORK / "frf.h5", "-o", WORK / "model.json", "--modes", str(len(MODES_HZ)),
                           "--hold", hold, *arguments], capture_output=True, text=True)  # fmt: skip
    assert done.returncode == exit_code, done.stderr
    return json.loads((WORK / "model.json").read_text())


def delays_of(model):
    return np.add.outer(model["output_delay_s"], model["input_delay_s"])


class ExactData(unittest.TestCase):
    def check_modes(self, model):
        modes = [m for m in model["submodels"] if "natural_frequency_hz" in m]
        found_hz = np.array([m["natural_frequency_hz"] for m in modes])
        order = np.argsort(found_hz)
        damping = np.array([m["damping_ratio"] for m in modes])
        np.testing.assert_allclose(found_hz[order], MODES_HZ, rtol=1e-9)
        np.testing.assert_allclose(damping[order], DAMPING, rtol=1e-7)

    def test_one_delay(self):
        model = fitted(stage(np.full((N_Y, N_U), 1.3 / RATE_HZ)), "--delay", "estimate")
        self.check_modes(model)
        np.testing.assert_allclose(delays_of(model), 1.3 / RATE_HZ, rtol=0, atol=1e-10)

    def test_a_delay_for_every_channel(self):
        g = np.random.default_rng(5)
        delay_s = np.add.outer(g.uniform(0.0, 0.4, N_Y), g.uniform(0.6, 1.5, N_U)) / RATE_HZ
        model = fitted(stage(delay_s), "--delay", "per_channel")
        self.check_modes(model)
        np.testing.assert_allclose(delays_of(model), delay_s, rtol=0, atol=1e-10)

    def test_noise_of_forty_decibels(self):
        g = np.random.default_rng(6)
        delay_s = np.add.outer(g.uniform(0.0, 0.4, N_Y), g.uniform(0.6, 1.5, N_U)) / RATE_HZ
        G = stage(delay_s)
        std = 0.01 * abs(G)
        G = G + std * (g.normal(size=G.shape) + 1j * g.normal(size=G.shape)) / np.sqrt(2)
        model = fitted(G, "--delay", "per_channel", variance=std**2)
        np.testing.assert_allclose(delays_of(model), delay_s, rtol=0, atol=1e-7)

    def test_the_other_holds_leave_an_error(self):
        G = stage(np.full((N_Y, N_U), 1.3 / RATE_HZ))
        for hold in ("phase", "sinc"):
            # Another structure would stand in for a part of the hold.
            model = fitted(G, "--delay", "estimate", "--damping", "proportional", "--direct-term", "none", hold=hold,
                           exit_code=3)
            self.assertGreater(model["fit"]["relative_rms_error"], 1e-3)


if __name__ == "__main__":
    shutil.rmtree(WORK, ignore_errors=True)
    WORK.mkdir(parents=True)
    unittest.main(argv=sys.argv[:1])
