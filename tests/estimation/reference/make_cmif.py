#!/usr/bin/env python3
"""Writes cmif.json beside itself: a random response and numpy's squared singular values of it."""
import json
import pathlib

import numpy as np

rng = np.random.default_rng(20240611)
outputs, inputs = 4, 5
frequency_hz = np.array([0.25, 20.25, 431.75, 1999.75])
scale = 10.0 ** rng.uniform(-6, 0, (len(frequency_hz), outputs, inputs))
response = scale * (
    rng.standard_normal(scale.shape) + 1j * rng.standard_normal(scale.shape))
response[3, 1] = 2 * response[3, 0]  # a line where the rank is one less
values = np.linalg.svd(response, compute_uv=False) ** 2
accelerance = values * (2 * np.pi * frequency_hz[:, None]) ** 4
target = pathlib.Path(__file__).with_name("cmif.json")
target.write_text(json.dumps({
    "outputs": outputs,
    "inputs": inputs,
    "frequency_hz": frequency_hz.tolist(),
    "response": np.stack([response.real, response.imag], axis=-1).tolist(),
    "squared_singular_values": values.tolist(),
    "accelerance_squared_singular_values": accelerance.tolist(),
}, indent=1) + "\n")
