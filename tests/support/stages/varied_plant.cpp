#include "tests/support/stages/varied_plant.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "excitation/decompositions/decompositions.hpp"
#include "tests/support/logs/memory_log.hpp"
#include "tests/support/models/model_reference.hpp"
#include "tests/support/process/random_numbers.hpp"

namespace stageid::test {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;
constexpr double kMass = 20.0;              // kg
constexpr std::size_t kMostDescribed = 19;  // submodels

struct Size {
  int outputs;
  int inputs;
  int most_modes;
};
constexpr std::array<Size, 8> kSizes = {{{1, 1, 5},
                                         {3, 1, 8},
                                         {2, 2, 8},
                                         {1, 6, 8},
                                         {3, 3, 10},
                                         {4, 13, 15},
                                         {3, 20, 12},
                                         {7, 17, 15}}};

Eigen::MatrixXd rank_one(RandomNumbers& random, const AdditiveModel& model) {
  const Eigen::VectorXd phi = random_matrix(random, model.n_outputs(), 1);
  return phi * random_matrix(random, 1, model.n_inputs());
}

Submodel draw_mode(RandomNumbers& random, const AdditiveModel& model, double frequency_hz,
                   double damping_ratio, bool general) {
  const double omega = kTwoPi * frequency_hz;
  const std::vector<double> a = mode_coefficients(frequency_hz, damping_ratio);
  const double scale = 1.0 / (kMass * random.uniform(0.5, 2.0) * omega * omega);
  Submodel s{0, {1.0, a[0], a[1]}, {scale * rank_one(random, model)}, {}, {}};
  // A complex shape turns the residue by some tenths of a radian.
  if (general)
    s.numerator.push_back(random.uniform(0.1, 0.5) * scale / omega * rank_one(random, model));
  return s;
}

constexpr int kMostTries = 100000;  // some draws leave no place for the last poles

/// Frequencies at least six half-power widths apart; fewer than `count` if no more fit into the band.
std::vector<std::array<double, 2>> draw_poles(RandomNumbers& random, int count, double low_hz,
                                              double high_hz) {
  std::vector<std::array<double, 2>> poles;
  for (int tries = 0; static_cast<int>(poles.size()) < count && tries < kMostTries; ++tries) {
    const double f = random.uniform(low_hz, high_hz);
    const double zeta = 0.003 * std::pow(10.0, random.uniform());
    if (std::none_of(poles.begin(), poles.end(), [&](const std::array<double, 2>& other) {
          return std::abs(other[0] - f) < 12.0 * std::max(zeta * f, other[1] * other[0]);
        }))
      poles.push_back({f, zeta});
  }
  return poles;
}

void draw_body(RandomNumbers& random, double lowest_hz, AdditiveModel& model) {
  const int kind = random.integer(0, 2);
  if (kind == 0) return;
  Eigen::MatrixXd body = Eigen::MatrixXd::Zero(model.n_outputs(), model.n_inputs());
  for (int degree = 0; degree < 3; ++degree) body += rank_one(random, model) / kMass;
  if (kind == 1) {
    model.submodels.push_back({2, {1.0}, {body}, {}, {}});
    return;
  }
  const double f = random.uniform(0.1, 0.7) * lowest_hz;
  const std::vector<double> a = mode_coefficients(f, random.uniform(0.05, 0.3));
  model.submodels.push_back({0, {1.0, a[0], a[1]}, {body * a[1]}, {}, {}});
}

}  // namespace

std::string VariedPlant::description() const {
  std::string text = fmt::format("{} x {}, {} lines, noise {:.0f} dB, delay {};", truth.n_outputs(),
                                 truth.n_inputs(), frf.lines(), noise_db,
                                 delay == DelayModel::fixed      ? "none"
                                 : delay == DelayModel::estimate ? "common"
                                                                 : "per channel");
  if (truth.submodels.size() > kMostDescribed)
    return text + fmt::format(" {} modes", truth.submodels.size());
  for (const Submodel& s : truth.submodels) {
    if (s.integrators == 2)
      text += " free body";
    else if (s.denominator.size() == 1)
      text += " direct term";
    else
      text += fmt::format(" {:.4g}({:.2g}%{})", s.natural_frequency_hz(), 100.0 * s.damping_ratio(),
                          s.numerator.size() > 1 ? ", general" : "");
  }
  return text;
}

int VariedPlant::modes() const {
  int modes = 0;
  for (const Submodel& s : truth.submodels)
    if (s.is_mode() && s.natural_frequency_hz() > frf.frequency_hz[0])
      modes += static_cast<int>(pivoted_qr(s.numerator[0]).rank());
  return modes;
}

VariedPlant draw_varied_plant(std::uint64_t seed) {
  RandomNumbers random(seed);
  VariedPlant plant;
  AdditiveModel& model = plant.truth;
  const Size& size = kSizes[random.integer(0, 7)];
  model.outputs = channels("y", size.outputs, "m");
  model.inputs = channels("u", size.inputs, "N");
  model.sample_rate_hz = 10000.0;
  model.hold = HoldModel::exact;

  const double low_hz = random.uniform(5.0, 30.0);
  const double high_hz = random.uniform(600.0, 2000.0);
  const auto lines = static_cast<Eigen::Index>(random.uniform(800.0, 3000.0));
  const bool general = random.uniform() < 0.4;
  draw_body(random, low_hz, model);
  for (const auto& [f, zeta] :
       draw_poles(random, random.integer(2, size.most_modes), 4.0 * low_hz, 0.95 * high_hz))
    model.submodels.push_back(draw_mode(random, model, f, zeta, general));
  const double beyond = random.uniform();
  if (beyond < 0.3) {
    const double stiffness = kMass * std::pow(kTwoPi * 2.0 * high_hz, 2.0);
    model.submodels.push_back({0, {1.0}, {rank_one(random, model) / stiffness}, {}, {}});
  } else if (beyond < 0.6) {
    const double f = random.uniform(1.05, 1.5) * high_hz;
    model.submodels.push_back(draw_mode(random, model, f, random.uniform(0.005, 0.02), general));
  }
  if (std::min(size.outputs, size.inputs) > 1 && random.uniform() < 0.3) {
    Submodel& mode = *std::find_if(
        model.submodels.begin(), model.submodels.end(),
        [&](const Submodel& s) { return s.is_mode() && s.natural_frequency_hz() > low_hz; });
    mode.numerator[0] +=
        random.uniform(0.3, 1.0) * mode.numerator[0].norm() * rank_one(random, model).normalized();
  }
  const double period_s = 1.0 / model.sample_rate_hz;
  model.input_delay_s = Eigen::VectorXd::Constant(size.inputs, random.uniform(0.2, 2.7) * period_s);
  model.output_delay_s = Eigen::VectorXd::Zero(size.outputs);
  if (size.outputs * size.inputs > 1 && random.uniform() < 0.25) {
    plant.delay = DelayModel::per_channel;
    for (double& delay : model.input_delay_s) delay += random.uniform(0.0, 1.0) * period_s;
    for (double& delay : model.output_delay_s.head(size.outputs - 1))
      delay += random.uniform(0.0, 1.0) * period_s;
  }

  FrfEstimate& frf = plant.frf;
  frf.frequency_hz = Eigen::VectorXd::LinSpaced(lines, low_hz, high_hz);
  frf.inputs = model.inputs;
  frf.outputs = model.outputs;
  frf.sample_rate_hz = model.sample_rate_hz;
  frf.hold = Hold::zoh;
  frf.realizations = 4;
  frf.periods = 3;
  frf.experiments = size.inputs;
  frf.noise_dof = std::max(8.0, 8.0 * size.inputs);
  frf.response = reference_response(model, frf.frequency_hz, HoldModel::exact);
  frf.noise_variance.resize(frf.response.rows(), frf.response.cols());
  plant.noise_db = random.uniform(-75.0, -35.0);
  const double slope = random.integer(0, 2);
  const Eigen::ArrayXd rise = (frf.frequency_hz.array() / high_hz).pow(slope);
  for (Eigen::Index c = 0; c < frf.response.rows(); ++c) {
    const Eigen::ArrayXd magnitude = frf.response.row(c).cwiseAbs().transpose().array();
    const double level = median_of(magnitude * rise) * std::pow(10.0, plant.noise_db / 20.0);
    for (Eigen::Index k = 0; k < lines; ++k) {
      const double deviation = level / rise[k];
      frf.response(c, k) += deviation * random.circular();
      frf.noise_variance(c, k) = deviation * deviation * random.chi_square_mean(frf.noise_dof);
    }
  }
  return plant;
}

}  // namespace stageid::test
