# %% [markdown]
# # Data from other programs
#
# Run from the root of the repository, as a script or cell by cell. The files are made here, as a bench might have
# written them; the numbers come from the simulator.

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
# A data acquisition system that counts: integers and a scale for every channel, one matrix for each run. Stack the
# runs as [realizations, experiments, samples, channels] and give the excitation's period; that is a log.

# %%
scale = np.array([2e-9, 2e-9])  # m a count
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
# ## Samples in a file of MATLAB
# Several runs behind each other in one matrix: a map tells what is what, as `stageid import` wants it.

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
# Frequencies and complex numbers are enough for a fit. Here hold and delay were divided out by the other program.

# %%
plain = reference.compensate("hold", 600e-6)
foreign = stageid.Frf(plain.frequency_hz, plain.response, inputs=plain.inputs, outputs=plain.outputs)
fit = stageid.fit(foreign, band_hz=(120, 800), modes=4, direct_term="full")
print(*fit.decisions[:3], sep="\n")
print("modes at", ", ".join(f"{m['natural_frequency_hz']:.1f}" for m in fit.model.modes()), "Hz")
