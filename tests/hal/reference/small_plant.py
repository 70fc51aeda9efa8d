"""Writes small_plant.csv: the step response of a two-mode plant by numerical integration.

Independent of stageid: scipy integrates q'' + 2 zeta w q' + w^2 q = phi u(t) for each mode with the
held, delayed input written as a function of time, restarted at each of its jumps so that the
integrator never steps across one. Tolerances 1e-13; the C++ test allows 1e-10.

Columns: sample, u1[n], u2[n], y1[n], y2[n]. Run: /usr/bin/python3 small_plant.py
"""

import os

import numpy as np
from scipy.integrate import solve_ivp

RATE_HZ = 1000.0
DELAY_S = 1.7e-3  # 1.7 samples
MODES = [  # frequency, damping, actuator shape, sensor shape
    (40.0, 0.02, [1.0, -0.5], [0.8, 0.3]),
    (210.0, 0.005, [0.4, 1.2], [-0.6, 1.0]),
]
SAMPLES = 60


def main():
    rng = np.random.default_rng(7)
    u = np.round(rng.normal(size=(SAMPLES, 2)), 6)
    jumps = np.arange(SAMPLES) / RATE_HZ + DELAY_S
    instants = np.arange(SAMPLES) / RATE_HZ
    y = np.zeros((SAMPLES, 2))
    for frequency, damping, actuator, sensor in MODES:
        w = 2 * np.pi * frequency
        force = u @ np.array(actuator)
        edges = np.unique(np.concatenate([instants, jumps]))
        edges = edges[edges <= instants[-1] + 1e-12]
        state = np.zeros(2)
        at = {0.0: state}
        for begin, end in zip(edges[:-1], edges[1:]):
            index = np.searchsorted(jumps, 0.5 * (begin + end)) - 1
            f = force[index] if index >= 0 else 0.0
            state = solve_ivp(
                lambda t, x: [x[1], f - 2 * damping * w * x[1] - w * w * x[0]],
                (begin, end), state, method="DOP853", rtol=1e-13, atol=1e-20,
            ).y[:, -1]
            at[end] = state
        q = np.array([at[t][0] for t in instants])
        y += np.outer(q, sensor)
    path = os.path.join(os.path.dirname(os.path.abspath(__file__)), "small_plant.csv")
    rows = np.column_stack([np.arange(SAMPLES), u, y])
    np.savetxt(path, rows, delimiter=",", fmt=["%d", "%.6f", "%.6f", "%.17g", "%.17g"],
               header="sample,u1,u2,y1,y2", comments="")


if __name__ == "__main__":
    main()
