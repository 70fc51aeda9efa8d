# %% [markdown]
# # Data from other programs
#
# Run from the root of the repository, as a script or cell by cell. The script creates the files itself, in the form of
# typical test bench files, with data from the simulator.

# %%
import pathlib
import tempfile

import numpy as np
from scipy.io import savemat

import stageid

folder = pathlib.Path(tempfile.mkdtemp())
ours = stageid.simulate("configs/experiment/small_stage.yaml")
r, u, y = ours.arrays()
reference = stageid.frf(ours)

# %% [markdown]
# ## Samples in arrays
# A data acquisition system often stores integer counts, one scale per channel and one matrix per run. Stack the runs
# as [realizations, experiments, samples, channels], and add one period of the excitation.

# %%
scale = np.array([2e-9, 2e-9])  # m per count
counts = np.round(y / scale).astype(np.int32)
np.savez(folder / "bench.npz", force=u, counts=counts, scale=scale, excitation=r)

bench = np.load(folder / "bench.npz")
log = stageid.Log(bench["excitation"], bench["force"], bench["counts"] * bench["scale"], sample_rate_hz=2000.0,
                  transient_periods=2, actuators=["a1", "a2", "a3"], sensors=["s1", "s2"],
                  actuator_units=["N"] * 3, sensor_units=["m"] * 2)
frf = stageid.frf(log)
error = np.abs(frf.response - reference.response) / np.abs(reference.response)
print(f"from counts of 2 nm: relative difference {np.median(error):.1e} (median)")
assert np.median(error) < 0.1

# %% [markdown]
# ## Samples in a MATLAB file
# Several runs are stored one after the other in one matrix. A map for `stageid import` assigns the arrays.

# %%
M, E, S, n_u = u.shape
savemat(folder / "bench.mat", {"F": u.reshape(-1, n_u), "y": y.reshape(-1, 2),
                               "d": np.tile(r, (1, 1, S // r.shape[2], 1)).reshape(-1, 3)})
runs = "".join(f"  - {{realization: {m}, experiment: {e}, first_row: {(m * E + e) * S}, rows: {S}}}\n"
               for m in range(M) for e in range(E))
(folder / "bench.yaml").write_text(f"""kind: log
sample_rate_hz: 2000
period_samples: {r.shape[2]}
transient_periods: 2
excitation: {{arrays: [d], names: [a1, a2, a3], unit: N}}
actuators: {{arrays: [F], names: [a1, a2, a3], unit: N}}
sensors: {{arrays: [y], names: [s1, s2], unit: m}}
runs:
{runs}""")
assert stageid.call("import", folder / "bench.mat", "-o", folder / "bench.slog", "--map", folder / "bench.yaml") == 0
assert np.array_equal(stageid.frf(folder / "bench.slog").response, reference.response)

# %% [markdown]
# ## A response alone
# Frequencies and a complex response are enough for a fit. Here the other program has divided out hold and delay.

# %%
plain = reference.compensate("hold", 600e-6)
foreign = stageid.Frf(plain.frequency_hz, plain.response, inputs=plain.inputs, outputs=plain.outputs)
fit = stageid.fit(foreign, band_hz=(120, 800), modes=4, direct_term="full")
print(*fit.decisions[:3], sep="\n")
print("modes at", ", ".join(f"{m.natural_frequency_hz:.1f}" for m in fit.model.modes()), "Hz")
