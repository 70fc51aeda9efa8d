# %% [markdown]
# # Design an experiment and measure a simulated stage
#
# Run from the root of the repository, as a script or cell by cell.

# %%
import functools
import pathlib
import tempfile

import numpy as np

import stageid

CONFIG = pathlib.Path("configs/experiment/small_stage.yaml")

# %% [markdown]
# ## A multisine
# One period on the odd lines of a band, with random phases or with phases that reduce the crest factor. At the same
# rms, a lower crest factor gives the same information with a lower peak force.

# %%
draw = functools.partial(stageid.multisine, sample_rate_hz=2000.0, period_samples=500, low_hz=16.0, high_hz=800.0,
                         rms=1.0, seed=7, lines="odd")
plain, low_crest = draw(), draw(crest_iterations=200)
print(f"crest factor {np.abs(plain).max():.2f} with random phases, {np.abs(low_crest).max():.2f} reduced")
assert np.abs(low_crest).max() < np.abs(plain).max()

lines = np.flatnonzero(np.abs(np.fft.rfft(plain)) > 1e-9)
print(f"{lines.size} lines, {lines[0] * 4.0} to {lines[-1] * 4.0} Hz, every second of 4 Hz")

# %% [markdown]
# ## Check the experiment against the limits of the stage
# `stageid design` predicts forces and motions before the measurement and prints a table.

# %%
with tempfile.TemporaryDirectory() as folder:
    assert stageid.call("design", CONFIG, "-o", f"{folder}/excitation.h5") == 0

# %% [markdown]
# ## The measurement
# The simulation runs in virtual time and in memory. The arrays are [M, E, S, channels], for M realizations of E
# experiments. `r` is one period.

# %%
log = stageid.simulate(CONFIG)
r, u, y = log.arrays()
print(f"{len(log)} runs: r {r.shape} N, u {u.shape} N, y {y.shape} m")
for m, e in np.ndindex(*r.shape[:2]):
    excited = [log.excitation[c] for c in np.flatnonzero(np.ptp(r[m, e], axis=0))]
    print(f"realization {m + 1}, experiment {e + 1}: {', '.join(excited)} excited, "
          f"u rms {np.sqrt(np.mean(u[m, e] ** 2)):.2f} N, y peak {1e6 * np.abs(y[m, e]).max():.2f} um")

# %% [markdown]
# The change between consecutive periods is transient and noise.

# %%
P = log.period_samples
periods = y[0, 0].reshape(-1, P, y.shape[3])
for before, after in zip(periods, periods[1:]):
    print(f"change from one period to the next: {1e9 * np.sqrt(np.mean((after - before) ** 2)):8.3f} nm rms")
assert np.std(periods[-1] - periods[-2]) < np.std(periods[1] - periods[0])
