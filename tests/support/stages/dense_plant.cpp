#include "tests/support/stages/dense_plant.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "tests/support/logs/memory_log.hpp"
#include "tests/support/models/model_reference.hpp"
#include "tests/support/process/random_numbers.hpp"

namespace stageid::test {
namespace {

using Eigen::Index;

constexpr double kTwoPi = 2.0 * std::numbers::pi;

void add_mode(AdditiveModel& model, double frequency_hz, double damping_ratio,
              const Eigen::MatrixXd& residue) {
  const std::vector<double> a = mode_coefficients(frequency_hz, damping_ratio);
  model.submodels.push_back({0, {1.0, a[0], a[1]}, {residue * a[1]}, {}, {}});
}

void add_channels(AdditiveModel& model, int outputs, int inputs) {
  model.outputs = channels("y", outputs, "m");
  model.inputs = channels("u", inputs, "N");
  model.input_delay_s = Eigen::VectorXd::Zero(inputs);
  model.output_delay_s = Eigen::VectorXd::Zero(outputs);
}

/// Fixed-free chain of n equal masses and springs: omega_r = 2 w0 sin((2 r - 1) pi / (4 n + 2)), shape
/// sin((2 r - 1) j pi / (2 n + 1)). The roof is pushed; two floors are measured.
void draw_building(RandomNumbers& random, AdditiveModel& model) {
  const int n = random.integer(20, 40);
  add_channels(model, 2, 1);
  const int floors[] = {random.integer(n / 2, n - 1), n};
  const double w0 = kTwoPi * random.uniform(5.0, 50.0);
  const double lowest = 2.0 * w0 * std::sin(std::numbers::pi / (4.0 * n + 2.0));
  const double damping = random.uniform(0.002, 0.02);
  for (int r = 1; r <= n; ++r) {
    const double angle = (2.0 * r - 1.0) * std::numbers::pi / (4.0 * n + 2.0);
    const double omega = 2.0 * w0 * std::sin(angle);
    // Rayleigh: equal at the lowest and the highest mode.
    const double zeta = damping * (lowest / omega + omega / (2.0 * w0));
    Eigen::MatrixXd residue(2, 1);
    for (int i = 0; i < 2; ++i)
      residue(i, 0) =
          std::sin(2.0 * angle * floors[i]) * std::sin(2.0 * angle * n) * 4.0 / (2.0 * n + 1.0);
    add_mode(model, omega / kTwoPi, zeta, residue);
  }
}

void draw_scattered(RandomNumbers& random, AdditiveModel& model, int channels, int modes,
                    double decades_of_frequency, double decades_of_gain, bool clustered) {
  add_channels(model, channels, channels);
  double centre = 0.0;
  for (int r = 0; r < modes; ++r) {
    if (!clustered || r % 5 == 0) centre = random.uniform(0.0, decades_of_frequency);
    const double frequency_hz =
        std::pow(10.0, clustered ? centre + random.uniform(0.0, 0.1) : centre);
    const double gain = std::pow(10.0, random.uniform(-0.5, 0.5) * decades_of_gain);
    const double zeta = clustered ? 0.005 : std::pow(10.0, random.uniform(-2.5, -1.3));
    add_mode(model, frequency_hz, zeta,
             gain * random_matrix(random, channels, 1) * random_matrix(random, 1, channels));
  }
}

}  // namespace

VariedPlant draw_dense_plant(std::uint64_t seed) {
  RandomNumbers random(seed);
  VariedPlant plant;
  AdditiveModel& model = plant.truth;
  switch (random.integer(0, 2)) {
    case 0:
      draw_building(random, model);
      break;
    case 1:
      draw_scattered(random, model, 2, random.integer(30, 60), 3.0, 6.0, false);
      break;
    default:
      draw_scattered(random, model, 3, random.integer(30, 100), 2.0, 2.0, true);
  }
  model.hold = HoldModel::none;
  plant.delay = DelayModel::fixed;

  FrfEstimate& frf = plant.frf;
  const auto by_frequency = [](const Submodel& a, const Submodel& b) {
    return a.natural_frequency_hz() < b.natural_frequency_hz();
  };
  const auto [low, high] =
      std::minmax_element(model.submodels.begin(), model.submodels.end(), by_frequency);
  const double low_hz = 0.7 * low->natural_frequency_hz();
  const double high_hz = 1.4 * high->natural_frequency_hz();
  const auto lines = static_cast<Index>(random.uniform(2000.0, 5000.0));
  if (random.uniform() < 0.5)
    frf.frequency_hz = Eigen::VectorXd::LinSpaced(lines, low_hz, high_hz);
  else
    frf.frequency_hz =
        Eigen::VectorXd::LinSpaced(lines, std::log(low_hz), std::log(high_hz)).array().exp();
  frf.inputs = model.inputs;
  frf.outputs = model.outputs;
  frf.response = reference_response(model, frf.frequency_hz, HoldModel::none);
  plant.noise_db = -std::numeric_limits<double>::infinity();
  if (seed % 3 == 0) return plant;
  plant.noise_db = random.uniform(-80.0, -40.0);
  const double level = std::pow(10.0, plant.noise_db / 20.0);
  frf.noise_dof = 1000.0;
  frf.noise_variance = level * level * frf.response.cwiseAbs2();
  for (Index k = 0; k < lines; ++k)
    for (Index c = 0; c < frf.response.rows(); ++c)
      frf.response(c, k) += std::sqrt(frf.noise_variance(c, k)) * random.circular();
  return plant;
}

}  // namespace stageid::test
