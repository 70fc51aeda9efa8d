# %% [markdown]
# # Compare two days, and design a controller
#
# Run from the root of the repository, as a script or cell by cell.

# %%
import pathlib
import tempfile

import numpy as np
from scipy.linalg import solve_discrete_are

import stageid

folder = pathlib.Path(tempfile.mkdtemp())
configs = pathlib.Path("configs")


def identify(name: str, stage: str) -> stageid.Model:
    """Measures a stage (text of its file) and fits the modes."""
    (folder / f"{name}_stage.yaml").write_text(stage)
    experiment = (configs / "experiment/small_stage.yaml").read_text()
    (folder / f"{name}.yaml").write_text(experiment.replace("../stage/small_stage.yaml", f"{name}_stage.yaml"))
    frf = stageid.frf(stageid.simulate(folder / f"{name}.yaml"))
    fit = stageid.fit(frf, rigid_body="suspension:0.4:0.5", direct_term="full")
    assert fit.trustworthy
    return fit.model


# %% [markdown]
# ## Two days
# On the second day the plate is slightly softer.

# %%
stage = (configs / "stage/small_stage.yaml").read_text()
monday = identify("monday", stage)
tuesday = identify("tuesday", stage.replace("first_mode_hz: 170", "first_mode_hz: 169"))

before, after = monday.modes(), tuesday.modes()
changes = []
for pair in stageid.pair_modes(monday, tuesday):
    a, b = before[pair.first], after[pair.second]
    if a.natural_frequency_hz < 16:
        continue
    assert a.natural_frequency_std_hz is not None and b.natural_frequency_std_hz is not None
    std = np.hypot(a.natural_frequency_std_hz, b.natural_frequency_std_hz)
    moved = b.natural_frequency_hz - a.natural_frequency_hz
    changes.append(100 * pair.frequency_difference)
    print(f"{a.natural_frequency_hz:8.2f} Hz moved by {moved:6.2f} Hz, {abs(moved) / std:6.1f} standard "
          f"deviations; MAC {pair.output_mac:.3f}")
# All frequencies of a plate change in proportion: 1 / 170 = 0.588 %.
print(f"the first mode moved by {changes[0]:.3f} %")
assert abs(changes[0] + 100 / 170) < 0.05

# %% [markdown]
# ## A regulator
# The sampled state space is exact at the samples. Whole samples of delay are separate; here they become states.
# `monday.to_control()` gives the same system to the package python-control.

# %%
sampled = monday.sampled_state_space()
A, B, C, D = sampled.with_delays()
size, n_u = B.shape
print(f"{size} states, of which {size - len(sampled.system.A)} are delays")

# Penalize positions (1 um as much as 10 N), then compute the poles of the loop.
Q = C.T @ C / 1e-6**2 + 1e-12 * np.eye(size)
R = np.eye(n_u) / 10.0**2
X = solve_discrete_are(A, B, Q, R)
K = np.linalg.solve(R + B.T @ X @ B, B.T @ X @ A)
open_loop = np.abs(np.linalg.eigvals(A)).max()
closed_loop = np.abs(np.linalg.eigvals(A - B @ K)).max()
print(f"largest pole {open_loop:.5f} without, {closed_loop:.5f} with the regulator")
assert closed_loop < open_loop and closed_loop < 1
