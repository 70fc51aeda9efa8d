# %% [markdown]
# # A frequency response and its uncertainty
#
# Run from the root of the repository, as a script or cell by cell.

# %%
import numpy as np

import stageid

log = stageid.simulate("configs/experiment/small_stage.yaml")

# %% [markdown]
# ## Estimate
# The estimate uses the excitation, so it is valid in closed loop: G = (mean Y) (mean U)^-1, line by line.

# %%
frf = stageid.frf(log)
N, n_y, n_u = frf.response.shape
print(f"{n_y} x {n_u} on {N} lines, {frf.frequency_hz[0]} to {frf.frequency_hz[-1]} Hz, unit m/N")
print(f"noise variance with {frf.noise_dof:g} degrees of freedom, total variance with {frf.total_dof:g}")

# %% [markdown]
# ## Two variances
# The noise variance is the scatter of periods: the error if the same excitation is repeated. The total variance is the
# scatter of realizations: noise and nonlinear distortion. This stage is linear, so both agree within their scatter.

# %%
assert frf.total_variance is not None and frf.noise_variance is not None  # several realizations and periods
ratio = np.median(frf.total_variance / frf.noise_variance)
print(f"median of total over noise variance: {ratio:.2f}")
relative = np.sqrt(frf.noise_variance) / np.abs(frf.response)
print(f"relative standard deviation: median {np.median(relative):.1e}, largest {relative.max():.1e}")

# %% [markdown]
# ## Check the confidence circles
# Two estimates from different realizations differ by noise alone. The variance of their difference is the sum of their
# variances. 95 % circles should contain 95 % of the differences.

# %%
first, second = (stageid.frf(log, realizations=[m]) for m in (1, 2))
assert first.noise_variance is not None and second.noise_variance is not None
assert first.noise_dof is not None and second.noise_dof is not None
difference = np.abs(first.response - second.response) ** 2
nu = first.noise_dof + second.noise_dof
variance = first.noise_variance + second.noise_variance
inside = np.mean(difference < variance * nu * (0.05 ** (-1 / nu) - 1))
print(f"{100 * inside:.1f} % of {difference.size} differences are within their circle")
# The binomial scatter would be 0.6 % for independent differences, but channels of one output have common noise.
assert 0.91 < inside < 0.99

# %% [markdown]
# ## Fewer samples
# The local polynomial method models the transient. It uses whole records and gives the same response.

# %%
whole = stageid.frf(log, method="lpm")
assert whole.noise_variance is not None
distance = np.abs(whole.response - frf.response) / np.sqrt(whole.noise_variance + frf.noise_variance)
print(f"lpm from {log.period_samples * 5} samples per run: {np.median(distance):.2f} standard deviations away (median)")
assert np.median(distance) < 2
