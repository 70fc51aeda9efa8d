#include "excitation/multisine/multisine.hpp"

#include <cmath>

#include "excitation/multisine/line_spectrum.hpp"
#include "excitation/multisine/multisine_lines.hpp"
#include "excitation/words/require.hpp"

namespace stageid {
namespace {

void check(const FrequencyGrid& grid, const MultisineSpec& spec) {
  require(spec.level > 0.0 && std::isfinite(spec.level),
          "multisine: level must be positive and finite; got {}", spec.level);
  require(spec.crest_iterations >= 0, "multisine: crest_iterations must be 0 or more; got {}",
          spec.crest_iterations);
  if (spec.shape.size() == 0) return;
  require(spec.shape.size() == grid.size(),
          "multisine: shape has {} entries; expected one per line ({})", spec.shape.size(),
          grid.size());
  require(spec.shape.allFinite() && (spec.shape.array() >= 0.0).all(),
          "multisine: shape must be finite and nonnegative on every line");
  require((spec.shape.array() != 0.0).any(),
          "multisine: shape is zero on every line; at least one entry must be positive");
}

}  // namespace

Multisine random_phase_multisine(const FrequencyGrid& grid, const MultisineSpec& spec) {
  check(grid, spec);
  Eigen::VectorXd amplitude = unit_rms_amplitude(grid, spec.shape);

  Eigen::VectorXd phase_rad =
      multisine_phase_rad(grid, amplitude, spec.seed, spec.crest_iterations);
  Eigen::VectorXd samples =
      LineSpectrum(grid).samples(line_coefficients(1.0, amplitude, phase_rad));
  const double unit =
      spec.scaling == AmplitudeScaling::rms ? 1.0 : samples.lpNorm<Eigen::Infinity>();
  amplitude *= spec.level / unit;
  samples *= spec.level / unit;
  return {grid, std::move(samples), std::move(amplitude), std::move(phase_rad)};
}

double crest_factor(const Eigen::Ref<const Eigen::VectorXd>& samples) {
  const double peak = samples.size() == 0 ? 0.0 : samples.lpNorm<Eigen::Infinity>();
  require(peak > 0.0, "crest factor: all samples are zero; at least one must be nonzero");
  return peak * std::sqrt(static_cast<double>(samples.size())) / samples.stableNorm();
}

}  // namespace stageid
