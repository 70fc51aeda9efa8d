#pragma once

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <vector>

#include "estimation/fit/fit_additive_model.hpp"
#include "tests/support/models/estimate_trials.hpp"

/// Fits of one loop, measured from rest again and again with other noise.
namespace stageid::test {

/// Modes of a sampled_plant() as a model in which a fit can end: their poles are the plant's, their
/// numerators, which a fit solves for, are zero.
inline AdditiveModel model_with(const std::vector<PlantMode>& modes, const FrfEstimate& frf) {
  AdditiveModel model;
  model.inputs = frf.inputs;
  model.outputs = frf.outputs;
  model.sample_rate_hz = frf.sample_rate_hz;
  model.hold = HoldModel::exact;
  for (const PlantMode& mode : modes) {
    const std::complex<double> pole(-1.0 / mode.decay_s,
                                    2.0 * std::numbers::pi * mode.frequency_hz);
    Submodel submodel;
    submodel.denominator = {1.0, -2.0 * pole.real() / std::norm(pole), 1.0 / std::norm(pole)};
    // Of C (zI - A)^-1 B a numerator of first order remains behind the hold.
    submodel.numerator.assign(2, Eigen::MatrixXd::Zero(frf.n_outputs(), frf.n_inputs()));
    model.submodels.push_back(std::move(submodel));
  }
  return model;
}

/// Natural frequencies and damping ratios over the seeds, frequency and damping of each mode in turn.
struct FitTrials {
  Eigen::ArrayXd over_reported;  ///< scatter over the rms of the reported standard deviations
  Eigen::ArrayXd bias;           ///< mean error over the scatter of that mean
  double correlated_lines = 0.0;
};

/// @throws std::runtime_error where a fit does not converge
inline FitTrials repeat_fits(const SampledPlant& plant, const std::vector<PlantMode>& modes,
                             LoopExperiment x, double noise_std, const FrfOptions& options,
                             Weighting weighting, int seeds) {
  const auto n = static_cast<Eigen::Index>(2 * modes.size());
  Eigen::ArrayXXd errors(n, seeds);
  Eigen::ArrayXd reported = Eigen::ArrayXd::Zero(n);
  FitTrials trials;
  for (int seed = 1; seed <= seeds; ++seed) {
    x.seed = static_cast<std::uint64_t>(seed);
    const MemoryLog log = simulate_sampled_log(plant, x, noise_std);
    const FrfEstimate frf = estimate_plant_frf({&log}, options);
    trials.correlated_lines += frf.correlated_lines / seeds;
    FitOptions fit_options;
    fit_options.weighting = weighting;
    fit_options.hold = HoldModel::exact;
    fit_options.response_variance = false;
    const AdditiveModel truth = model_with(modes, frf);
    const FitResult fit = fit_additive_model(frf, truth, fit_options);
    if (!fit.trustworthy()) throw std::runtime_error("fit: " + fit.message());
    for (std::size_t i = 0; i < modes.size(); ++i) {
      const auto f = static_cast<Eigen::Index>(2 * i);
      const Submodel& found = fit.model.submodels[i];
      errors(f, seed - 1) =
          found.natural_frequency_hz() - truth.submodels[i].natural_frequency_hz();
      errors(f + 1, seed - 1) = found.damping_ratio() - truth.submodels[i].damping_ratio();
      reported[f] += std::pow(found.natural_frequency_std_hz.value(), 2) / seeds;
      reported[f + 1] += std::pow(found.damping_ratio_std.value(), 2) / seeds;
    }
  }
  const Eigen::ArrayXd mean = errors.rowwise().mean();
  const Eigen::ArrayXd scatter =
      ((errors.colwise() - mean).square().rowwise().sum() / (seeds - 1.0)).sqrt();
  trials.over_reported = scatter / reported.sqrt();
  trials.bias = mean / scatter * std::sqrt(static_cast<double>(seeds));
  return trials;
}

}  // namespace stageid::test
