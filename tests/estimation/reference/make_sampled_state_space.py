#!/usr/bin/env python3
"""Writes sampled_state_space.json beside itself: a model with delays, and its sampled response.

Every channel is made for itself from scipy's tf2ss and cont2discrete at a tenth of the sample period,
of which all delays are whole multiples: ten small steps with the input held make one sample.
"""
import json
import pathlib

import numpy as np
from scipy import signal

rng = np.random.default_rng(20240611)
outputs, inputs, sample_rate_hz, fine = 2, 3, 1000.0, 10
step = 1 / sample_rate_hz / fine
input_delay = np.array([0, 14, 7])  # in steps
output_delay = np.array([0, 5])
frequency_hz = np.array([1.0, 33.0, 81.5, 170.0, 260.0, 499.0])


def mode(frequency, damping):
    omega = 2 * np.pi * frequency
    return [1.0, 2 * damping / omega, 1 / omega**2]


def shape(count, scale):
    return (scale * rng.standard_normal((count, outputs, inputs))).tolist()


submodels = [
    {'integrators': 2, 'denominator': [1.0], 'numerator': shape(1, 1e3)},
    {'integrators': 0, 'denominator': mode(80.0, 0.02), 'numerator': shape(1, 1e-2)},
    {'integrators': 0, 'denominator': mode(260.0, 0.01),
     'numerator': [m.tolist() for m in np.array(shape(2, 1e-2)) * [[[1]], [[1e-3]]]]},
    {'integrators': 0, 'denominator': [1.0, 5e-3], 'numerator': shape(1, 1e-2)},
    {'integrators': 0, 'denominator': [1.0], 'numerator': shape(1, 1e-3)},
]


def sampled(numerator, denominator, delay, z):
    """Response of one rational function (descending powers) held, delayed by steps, sampled."""
    if len(denominator) == 1:
        return numerator[0] / denominator[0] * z ** -float(-(-delay // fine))
    A, B, C, D = signal.tf2ss(numerator, denominator)
    assert not D.any()
    A, B, C, D, _ = signal.cont2discrete((A, B, C, D), step, 'zoh')
    whole, late = divmod(delay, fine)
    reached = [np.linalg.matrix_power(A, q) @ B for q in range(fine)]
    now = sum(reached[:fine - late])
    before = sum(reached[fine - late:], np.zeros_like(B))
    A = np.linalg.matrix_power(A, fine)
    held = now + before / z
    return (C @ np.linalg.solve(z * np.eye(len(A)) - A, held)).item() * z ** -float(whole)


response = np.zeros((len(frequency_hz), outputs, inputs), complex)
for k, f in enumerate(frequency_hz):
    z = np.exp(2j * np.pi * f / sample_rate_hz)
    for s in submodels:
        denominator = np.array(s['denominator'])[::-1].tolist() + [0.0] * s['integrators']
        for i in range(outputs):
            for j in range(inputs):
                numerator = np.array([m[i][j] for m in s['numerator']])[::-1]
                response[k, i, j] += sampled(
                    numerator, denominator, int(input_delay[j] + output_delay[i]), z)

pathlib.Path(__file__).with_name('sampled_state_space.json').write_text(json.dumps({
    'model': {
        'format': 'stageid-model', 'format_version': 1,
        'inputs': ['u1', 'u2', 'u3'], 'outputs': ['y1', 'y2'],
        'sample_rate_hz': sample_rate_hz, 'hold': 'exact',
        'input_delay_s': (input_delay * step).tolist(),
        'output_delay_s': (output_delay * step).tolist(),
        'submodels': submodels,
    },
    'frequency_hz': frequency_hz.tolist(),
    'response': np.stack([response.real, response.imag], axis=-1).tolist(),
}, indent=1) + '\n')
