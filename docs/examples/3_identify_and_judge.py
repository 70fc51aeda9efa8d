# %% [markdown]
# # Identify a modal model and validate it
#
# Run from the root of the repository, as a script or cell by cell.

# %%
import numpy as np

import stageid

log = stageid.simulate("configs/experiment/small_stage.yaml")
frf = stageid.frf(log, realizations=[1, 2])
held_back = stageid.frf(log, realizations=[3])

# %% [markdown]
# ## Candidates
# Candidates are peaks of the mode indicator. Poles that are stable over increasing orders are a second opinion.

# %%
for peak in stageid.modes(frf.select(band_hz=(120, 800))):
    print(f"peak at {peak.frequency_hz:7.2f} Hz, damping {peak.damping_ratio:.4f}")
stable = [p for p in stageid.stabilization(frf, most_order=40, delay_s=600e-6) if p.stable_damping]
print(f"{len(stable)} stable poles over 20 orders")

# %% [markdown]
# ## Fit
# P(s) is the sum of modes, a suspension with known frequencies, and the compliance of modes above the band. It
# includes hold, delay and sampler. `fit.decisions` lists every decision.

# %%
fit = stageid.fit(frf, rigid_body="suspension:0.4:0.5", direct_term="full")
print(*fit.decisions, sep="\n")
print(f"{fit.status}, cost {fit.cost[0]:.3g} -> {fit.cost[-1]:.3g}")
assert fit.trustworthy

for found in fit.model.modes():
    if found.natural_frequency_hz > frf.frequency_hz[0]:
        print(f"{found.natural_frequency_hz:9.3f} +- {found.natural_frequency_std_hz:.4f} Hz   damping "
              f"{found.damping_ratio:.5f} +- {found.damping_ratio_std:.6f}   "
              f"shape at the sensors {np.round(found.output_shape.real, 2)}")

# %% [markdown]
# ## Validate
# Validation uses a realization that was not fitted. If the error is noise, chi-square per degree of freedom is close to
# its expected value, which depends on the number of periods.

# %%
figures = stageid.validate(fit.model, held_back)
print(f"relative error {figures.relative_rms_error:.2e}, chi-square {figures.chi_square_per_dof:.2f} "
      f"(of noise alone {figures.expected_chi_square:.2f})")
assert figures.explained and figures.chi_square_per_dof is not None and figures.whitened_above_95 is not None
print(f"residuals above their 95 % point: {100 * figures.whitened_above_95:.1f} %")

# The same figures detect a model with too few modes.
poor = stageid.fit(frf, modes=1, rigid_body="suspension:0.4:0.5", direct_term="full").model
too_few = stageid.validate(poor, held_back)
print(f"with one mode: relative error {too_few.relative_rms_error:.2e}, "
      f"chi-square {too_few.chi_square_per_dof:.3g}")
assert not too_few.explained and too_few.chi_square_per_dof is not None
assert too_few.chi_square_per_dof > 100 * figures.chi_square_per_dof

# %% [markdown]
# The standard deviation of the model is smaller than that of the data, because the model has fewer parameters.

# %%
assert frf.noise_variance is not None and fit.response_variance is not None
gain = np.median(np.sqrt(frf.noise_variance / fit.response_variance))
print(f"standard deviation of the data over that of the model: {gain:.1f} (median)")
assert gain > 1
