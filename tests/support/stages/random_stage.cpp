#include "tests/support/stages/random_stage.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/support/logs/memory_log.hpp"
#include "tests/support/models/model_reference.hpp"

namespace stageid::test {
namespace {

struct Mode {
  double frequency_hz;
  double damping_ratio;
};

/// Modes spread over the band, never closer than four half-power widths but in `pairs` pairs.
std::vector<Mode> draw_modes(RandomNumbers& random, const RandomStageSpec& spec, int count,
                             int pairs) {
  std::vector<Mode> modes;
  const auto crowded = [&](const Mode& mode) {
    return std::any_of(modes.begin(), modes.end(), [&](const Mode& other) {
      const double width = std::max(mode.damping_ratio * mode.frequency_hz,
                                    other.damping_ratio * other.frequency_hz);
      return std::abs(other.frequency_hz - mode.frequency_hz) < 8.0 * width;
    });
  };
  const auto draw = [&] {
    // Logarithmic damping; frequencies denser where stages have more modes.
    return Mode{
        spec.first_mode_hz +
            (spec.last_mode_hz - spec.first_mode_hz) * std::pow(random.uniform(), 0.8),
        spec.least_damping * std::pow(spec.most_damping / spec.least_damping, random.uniform())};
  };
  while (static_cast<int>(modes.size()) < count - pairs) {
    const Mode mode = draw();
    if (!crowded(mode)) modes.push_back(mode);
  }
  for (int p = 0; p < pairs; ++p) {  // the first modes drawn get a close neighbour
    const Mode first = modes[p];
    const double half_power_width = 2.0 * first.damping_ratio * first.frequency_hz;
    modes.push_back({first.frequency_hz + random.uniform(0.6, 2.0) * half_power_width,
                     first.damping_ratio * random.uniform(0.7, 1.4)});
  }
  std::sort(modes.begin(), modes.end(),
            [](const Mode& a, const Mode& b) { return a.frequency_hz < b.frequency_hz; });
  return modes;
}

AdditiveModel draw_model(RandomNumbers& random, const RandomStageSpec& spec, int count, int pairs) {
  AdditiveModel model;
  model.outputs = channels("z", spec.outputs, "m");
  model.inputs = channels("a", spec.inputs, "N");
  model.sample_rate_hz = spec.sample_rate_hz;
  model.hold = HoldModel::exact;

  const double mass_kg = 20.0;
  Eigen::MatrixXd rigid = Eigen::MatrixXd::Zero(spec.outputs, spec.inputs);
  for (int degree = 0; degree < 3; ++degree) {
    const Eigen::VectorXd phi = random_vector(random, spec.outputs);
    rigid += phi * random_vector(random, spec.inputs).transpose() / mass_kg;
  }
  model.submodels.push_back({2, {1.0}, {rigid}, {}, {}});
  for (const Mode& mode : draw_modes(random, spec, count, pairs)) {
    const double omega = 2.0 * std::numbers::pi * mode.frequency_hz;
    const Eigen::VectorXd phi = random_vector(random, spec.outputs);
    // phi psi^T / (m (s^2 + 2 zeta omega s + omega^2)), in the form B_0 / (1 + a_1 s + a_2 s^2)
    const Eigen::MatrixXd residue = phi * random_vector(random, spec.inputs).transpose() /
                                    (mass_kg * random.uniform(0.5, 2.0) * omega * omega);
    const std::vector<double> a = mode_coefficients(mode.frequency_hz, mode.damping_ratio);
    model.submodels.push_back({0, {1.0, a[0], a[1]}, {residue}, {}, {}});
  }
  return model;
}

Eigen::VectorXd lines_of(const RandomStageSpec& spec) {
  const auto count = static_cast<Eigen::Index>(
      std::floor((spec.band_high_hz - spec.band_low_hz) / spec.line_spacing_hz) + 1.0);
  return Eigen::VectorXd::LinSpaced(
      count, spec.band_low_hz,
      spec.band_low_hz + spec.line_spacing_hz * static_cast<double>(count - 1));
}

}  // namespace

std::string RandomStage::description() const {
  std::string text = fmt::format(
      "{} modes, {} close pairs, {} peaks missing, noise {:.0f} dB falling as f^-{}, "
      "delay {:.1f} us;",
      truth.submodels.size() - 1, pairs, missing_peaks, noise_db, noise_slope, 1e6 * delay_s);
  for (const Submodel& s : truth.submodels)
    if (s.is_mode())
      text += fmt::format(" {:.2f}({:.2f}%)", s.natural_frequency_hz(), 100.0 * s.damping_ratio());
  return text;
}

RandomStage draw_random_stage(std::uint64_t seed, const RandomStageSpec& spec) {
  RandomNumbers random(seed);
  RandomStage stage;
  const int modes = random.integer(spec.least_modes, spec.most_modes);
  stage.seed = seed;
  // From a separate generator, so that the stages of earlier seeds do not change.
  stage.missing_peaks = RandomNumbers(seed + 0x9e3779b9U).integer(0, spec.most_missing_peaks);
  stage.pairs = random.integer(0, std::min(spec.most_pairs, modes / 2));
  stage.noise_db = random.uniform(spec.least_noise_db, spec.most_noise_db);
  stage.noise_slope = random.integer(0, 2);
  stage.delay_s = random.uniform(0.2, 2.2) / spec.sample_rate_hz;
  stage.truth = draw_model(random, spec, modes, stage.pairs);
  stage.truth.input_delay_s = Eigen::VectorXd::Constant(spec.inputs, stage.delay_s);
  stage.truth.output_delay_s = Eigen::VectorXd::Zero(spec.outputs);

  FrfEstimate& frf = stage.frf;
  frf.frequency_hz = lines_of(spec);
  frf.inputs = stage.truth.inputs;
  frf.outputs = stage.truth.outputs;
  frf.sample_rate_hz = spec.sample_rate_hz;
  frf.hold = Hold::zoh;
  frf.realizations = 2;
  frf.periods = 3;
  frf.experiments = spec.inputs;
  frf.noise_dof = 52.0;
  stage.exact = reference_response(stage.truth, frf.frequency_hz, HoldModel::exact);

  const Eigen::ArrayXd slope = frf.frequency_hz.unaryExpr(
      [&](double f) { return std::pow(f, static_cast<double>(stage.noise_slope)); });
  stage.variance.resize(stage.exact.rows(), stage.exact.cols());
  for (Eigen::Index c = 0; c < stage.exact.rows(); ++c) {
    const Eigen::ArrayXd magnitude = stage.exact.row(c).cwiseAbs().transpose().array();
    const double level = median_of(magnitude * slope) * std::pow(10.0, stage.noise_db / 20.0);
    stage.variance.row(c) = (level / slope).square().matrix().transpose();
  }
  frf.response = stage.exact;
  frf.noise_variance.resize(stage.exact.rows(), stage.exact.cols());
  for (Eigen::Index k = 0; k < stage.exact.cols(); ++k)
    for (Eigen::Index c = 0; c < stage.exact.rows(); ++c) {
      frf.response(c, k) += std::sqrt(stage.variance(c, k)) * random.circular();
      frf.noise_variance(c, k) = stage.variance(c, k) * random.chi_square_mean(frf.noise_dof);
    }
  return stage;
}

}  // namespace stageid::test
