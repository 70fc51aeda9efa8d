#include "tools/experiment/plant_prior_file.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/json_members.hpp"
#include "acquisition/files/json_text.hpp"
#include "estimation/modal/validation.hpp"
#include "estimation/model/additive_model.hpp"
#include "frf/file/frf_file.hpp"
#include "frf/plant/low_frequency_plant.hpp"
#include "frf/response/hold_compensation.hpp"
#include "hal/simulator/rigid_body.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {
namespace {

using Eigen::Index;

constexpr Index kSmoothedLines = 10;  // on each side
/// Least degrees of freedom of a covariance, so that its inverse is accurate.
constexpr double kFreedomPerOutput = 10.0;

/// Indices of the channels in the stage.
std::vector<Index> places(const std::filesystem::path& file, const ChannelList& channels,
                          const std::vector<Channel>& stage, const char* kind) {
  std::vector<Index> indices;
  for (const std::string& name : channels.names) {
    const int index = channel_index(stage, name);
    if (index < 0)
      fail_format(file, "", "has the {0} '{1}', which the stage lacks; use a prior of this stage",
                  kind, name);
    indices.push_back(index);
  }
  return indices;
}

std::vector<Channel> chosen(const std::vector<Channel>& channels,
                            const std::vector<Index>& indices) {
  std::vector<Channel> some;
  for (const Index i : indices) some.push_back(channels[i]);
  return some;
}

FrfEstimate prior_of_model(const std::filesystem::path& file, const StageInfo& stage,
                           const Eigen::VectorXd& frequency_hz) {
  const AdditiveModel model = read_model(file);
  FrfEstimate frf;
  frf.frequency_hz = frequency_hz;
  frf.inputs = model.inputs;
  frf.outputs = model.outputs;
  frf.sample_rate_hz = stage.sample_rate_hz;
  frf.hold = Hold::zoh;
  try {
    frf.response = response_like(model, frf);
  } catch (const std::invalid_argument& error) {
    throw FormatError(file, "", error.what());
  }
  return frf;
}

FrfEstimate prior_of_frf(const std::filesystem::path& file, const StageInfo& stage,
                         const Eigen::VectorXd& frequency_hz) {
  FrfEstimate frf = read_frf(file);
  if (frf.compensated != Compensation::none) frf = as_measured(std::move(frf));
  if (frf.hold != Hold::zoh || frf.sample_rate_hz != stage.sample_rate_hz)
    fail_format(file, "",
                "expected a response through the hold at {} Hz, got {} at {} Hz; measure a pilot "
                "of this stage",
                stage.sample_rate_hz, frf.hold == Hold::zoh ? "one with hold" : "one without hold",
                frf.sample_rate_hz);
  const double low_hz = frequency_hz[0];
  const double high_hz = frequency_hz[frequency_hz.size() - 1];
  if (low_hz < 0.5 * frf.frequency_hz[0] || high_hz > 1.02 * frf.frequency_hz[frf.lines() - 1])
    fail_format(
        file, "/frequency_hz",
        "{} ... {} Hz do not cover the band of {} ... {} Hz; measure a pilot on the whole band",
        frf.frequency_hz[0], frf.frequency_hz[frf.lines() - 1], low_hz, high_hz);
  return frf;
}

/// Location of a frequency between others: line `below`, and the fraction of the way to the next.
struct Between {
  Index below = 0;
  double part = 0.0;
};

Between between(const Eigen::VectorXd& lines_hz, double frequency_hz) {
  const double* const found =
      std::upper_bound(lines_hz.data(), lines_hz.data() + lines_hz.size(), frequency_hz);
  const Index above = found - lines_hz.data();
  if (above == 0) return {0, 0.0};
  if (above == lines_hz.size()) return {lines_hz.size() - 1, 0.0};
  return {above - 1,
          (frequency_hz - lines_hz[above - 1]) / (lines_hz[above] - lines_hz[above - 1])};
}

template <typename Columns>
auto interpolated(const Columns& columns, const Between& at) {
  using Vector = Eigen::Matrix<typename Columns::Scalar, Eigen::Dynamic, 1>;
  const Index above = at.part > 0.0 ? at.below + 1 : at.below;
  return Vector((1.0 - at.part) * columns.col(at.below) + at.part * columns.col(above));
}

double period_s_of(const FrfEstimate& frf) {
  const auto json = parse_json_object<Json>(frf.provenance_json);
  if (!json.contains("options")) return 0.0;
  return number_in(json["options"], "period_samples").value_or(0.0) / frf.sample_rate_hz;
}

/// Outputs x lines of the FRF, smoothed; empty if unknown.
Eigen::MatrixXd noise_density(const FrfEstimate& frf) {
  const double period_s = period_s_of(frf);
  if (frf.residual_covariance.size() == 0 || !(period_s > 0.0) || frf.periods < 1) return {};
  const Index n_y = frf.n_outputs();
  Eigen::MatrixXd density(n_y, frf.lines());
  for (Index k = 0; k < frf.lines(); ++k) {
    const Index first = std::max<Index>(0, k - kSmoothedLines);
    const Index count = std::min(frf.lines() - 1, k + kSmoothedLines) - first + 1;
    for (Index i = 0; i < n_y; ++i)
      density(i, k) =
          frf.residual_covariance.real().row(i * (n_y + 1)).segment(first, count).mean() *
          frf.periods * period_s;
  }
  return density;
}

}  // namespace

PlantPrior read_plant_prior(const std::filesystem::path& file, const StageInfo& stage,
                            const Eigen::VectorXd& frequency_hz,
                            const Eigen::VectorXd& below_band_hz) {
  const bool of_model = file.extension() == ".json";
  Eigen::VectorXd asked_hz(below_band_hz.size() + frequency_hz.size());
  asked_hz << below_band_hz, frequency_hz;
  const FrfEstimate frf =
      of_model ? prior_of_model(file, stage, asked_hz) : prior_of_frf(file, stage, frequency_hz);
  const std::vector<Index> sensors = places(file, frf.outputs, stage.sensors, "sensor");
  const std::vector<Index> actuators = places(file, frf.inputs, stage.actuators, "actuator");
  PlantPrior prior;
  prior.sensor_known.assign(stage.sensors.size(), false);
  prior.actuator_known.assign(stage.actuators.size(), false);
  for (const Index i : sensors) prior.sensor_known[i] = true;
  for (const Index j : actuators) prior.actuator_known[j] = true;
  const auto n_y = static_cast<Index>(stage.sensors.size());
  const auto n_u = static_cast<Index>(stage.actuators.size());

  std::optional<LowFrequencyPlant> low;
  if (asked_hz[0] < frf.frequency_hz[0]) {
    low.emplace(frf, stage.delay_s + 0.5 / stage.sample_rate_hz,
                rigid_body_jacobian(chosen(stage.sensors, sensors)),
                rigid_body_jacobian(chosen(stage.actuators, actuators)));
    prior.extrapolated_below_hz = frf.frequency_hz[0];
    prior.extrapolation_misfit = low->misfit();
  }
  const auto response = [&](double f_hz) {
    const Eigen::VectorXcd G = f_hz < frf.frequency_hz[0]
                                   ? low->response(f_hz)
                                   : interpolated(frf.response, between(frf.frequency_hz, f_hz));
    Eigen::MatrixXcd whole = Eigen::MatrixXcd::Zero(n_y, n_u);
    whole(sensors, actuators) = G.reshaped(frf.n_outputs(), frf.n_inputs());
    return whole;
  };
  for (const double f_hz : below_band_hz) prior.below_band.push_back(response(f_hz));
  for (const double f_hz : frequency_hz) prior.response.push_back(response(f_hz));

  const Eigen::MatrixXd density = noise_density(frf);
  if (density.size() == 0) return prior;
  prior.noise_density.setZero(n_y, frequency_hz.size());
  for (Index k = 0; k < frequency_hz.size(); ++k)
    prior.noise_density(sensors, k) =
        interpolated(density, between(frf.frequency_hz, frequency_hz[k]));
  return prior;
}

std::vector<Eigen::MatrixXcd> output_noise(const FrfEstimate& frf,
                                           const Eigen::VectorXd& frequency_hz, double period_s) {
  const double measured_s = period_s_of(frf);
  if (frf.residual_covariance.size() == 0 || !(measured_s > 0.0) || frf.periods < 1) return {};
  const auto n_y = static_cast<double>(frf.n_outputs());
  const double line_freedom = std::max(1.0, frf.noise_dof);
  const auto half =
      static_cast<Index>(std::ceil(0.5 * (kFreedomPerOutput * n_y / line_freedom - 1.0)));
  const auto around = [&](Index k) {
    const Index first = std::max<Index>(0, k - half);
    const Index last = std::min(frf.lines() - 1, k + half);
    Eigen::MatrixXcd sum = output_covariance(frf, first);
    for (Index l = first + 1; l <= last; ++l) sum += output_covariance(frf, l);
    const double count = static_cast<double>(last - first + 1);
    // A covariance of nu degrees of freedom has an inverse that is larger by nu / (nu - n_y).
    const double freedom = std::max(line_freedom * count, n_y + 1.0);
    return Eigen::MatrixXcd(sum * (freedom / (freedom - n_y) / count));
  };
  const double scale = frf.periods * measured_s / period_s;
  std::vector<Eigen::MatrixXcd> noise;
  for (const double f_hz : frequency_hz) {
    const Between at = between(frf.frequency_hz, f_hz);
    Eigen::MatrixXcd C = (1.0 - at.part) * around(at.below);
    if (at.part > 0.0) C += at.part * around(at.below + 1);
    noise.emplace_back(scale * C);
  }
  return noise;
}

}  // namespace stageid
