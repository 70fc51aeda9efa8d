// Uses every installed library once, as a program outside the tree would: designs an excitation,
// and checks the estimation side's response of a mode against the simulator's, which shares no code
// with it.

#include <Eigen/Core>
#include <cmath>
#include <cstdio>
#include <exception>
#include <numbers>

#include "acquisition/loop/run_experiment.hpp"
#include "acquisition/record/log_info.hpp"
#include "estimation/model/additive_model.hpp"
#include "excitation/multisine/multisine.hpp"
#include "frf/response/frf_estimate.hpp"
#include "hal/simulator/simulated_stage.hpp"

namespace {

constexpr double kRateHz = 10000.0;
constexpr double kDelay_s = 1.37e-4;  // not a whole number of samples

stageid::PlantMode plate_mode() {
  stageid::PlantMode mode;
  mode.natural_frequency_hz = 730.0;
  mode.damping_ratio = 0.004;
  mode.actuator_shape = Eigen::Vector3d(0.4, -0.7, 0.2);
  mode.sensor_shape = Eigen::Vector2d(0.9, -0.3);
  return mode;
}

stageid::AdditiveModel model_of(const stageid::PlantMode& mode) {
  const double omega = 2.0 * std::numbers::pi * mode.natural_frequency_hz;
  stageid::Submodel submodel;
  submodel.denominator = {1.0, 2.0 * mode.damping_ratio / omega, 1.0 / (omega * omega)};
  submodel.numerator = {mode.sensor_shape * mode.actuator_shape.transpose() / (omega * omega)};
  stageid::AdditiveModel model;
  model.inputs = {{"a1", "a2", "a3"}, {"N", "N", "N"}};
  model.outputs = {{"s1", "s2"}, {"m", "m"}};
  model.sample_rate_hz = kRateHz;
  model.hold = stageid::HoldModel::exact;
  model.input_delay_s = Eigen::VectorXd::Constant(3, kDelay_s);
  model.output_delay_s = Eigen::VectorXd::Zero(2);
  model.submodels = {submodel};
  return model;
}

double response_difference(const stageid::FrfEstimate& frf, const stageid::PlantMode& mode) {
  double largest = 0.0;
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const Eigen::MatrixXcd truth =
        stageid::sampled_response({mode}, kDelay_s, kRateHz, frf.frequency_hz[k]);
    largest = std::fmax(largest, (frf.at(k) - truth).norm() / truth.norm());
  }
  return largest;
}

int run() {
  const auto grid =
      stageid::FrequencyGrid::band(kRateHz, 4000, {.low_hz = 10.0, .high_hz = 2000.0});
  const stageid::Multisine signal =
      stageid::random_phase_multisine(grid, {.level = 2.0, .seed = 7});
  const double rms = signal.samples.norm() / std::sqrt(static_cast<double>(signal.samples.size()));

  const stageid::PlantMode mode = plate_mode();
  const stageid::AdditiveModel model = model_of(mode);
  stageid::FrfEstimate frf;
  frf.frequency_hz = grid.frequency_hz();
  frf.inputs = model.inputs;
  frf.outputs = model.outputs;
  frf.response = stageid::response(model, frf.frequency_hz, stageid::HoldModel::exact);
  stageid::check(frf);
  const double difference = response_difference(frf, mode);

  stageid::LogInfo info;
  info.sample_rate_hz = kRateHz;
  info.period_samples = grid.samples_per_period();
  info.excitation = info.actuators = model.inputs;
  info.sensors = model.outputs;
  stageid::check_log_info(info);
  auto* volatile perform = &stageid::run_experiment;  // links stageid::acquisition

  std::printf("rms %.12f N, largest relative difference of the responses %.2e\n", rms, difference);
  // Both are the same closed form up to rounding, which the phase delay * omega and the
  // cancellation beside the resonance enlarge.
  return std::fabs(rms - 2.0) < 1e-12 && difference < 1e-9 && perform != nullptr ? 0 : 1;
}

}  // namespace

int main() {
  try {
    return run();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "consumer: %s\n", error.what());
    return 1;
  }
}
