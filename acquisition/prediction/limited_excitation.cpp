#include "acquisition/prediction/limited_excitation.hpp"

#include <cmath>

#include "acquisition/files/fail.hpp"
#include "acquisition/loop/excited_actuators.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "hal/stage/motion_controller.hpp"

namespace stageid {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;

// A Gaussian signal exceeds this once in 5e8 samples, and an alarm would need the largest sample of the excitation at
// the same time.
constexpr double kDeviations = 6.0;

// Of the first period from rest: the noise of a pilot, and the part of that period that the steady-state bound between
// the samples does not cover.
constexpr double kRestMargin = 0.02;

std::vector<Index> actuators_of(const ExperimentSpec& experiment, const StageInfo& stage,
                                const PlantPrior& prior) {
  const std::vector<int> excited = excited_actuators(experiment, stage);
  for (std::size_t axis = 0; axis < excited.size(); ++axis)
    if (!prior.actuator_known[excited[axis]])
      fail_request("prior: does not contain the axis '{}'; measure a pilot with all axes",
                   experiment.axes[axis].channel);
  return {excited.begin(), excited.end()};
}

std::vector<Index> outputs_of(const std::vector<std::string>& names, const StageInfo& stage,
                              const PlantPrior& prior) {
  std::vector<Index> indices;
  for (std::size_t i = 0; i < stage.sensors.size(); ++i)
    if (names.empty() && prior.sensor_known[i]) indices.push_back(static_cast<Index>(i));
  for (const std::string& name : names) {
    const int index = channel_index(stage.sensors, name);
    if (index < 0 || !prior.sensor_known[index])
      fail_request("prior: does not contain the output '{}'; measure a pilot with all outputs",
                   name);
    indices.push_back(index);
  }
  return indices;
}

/// Transfers and noise of the loop, per line.
class LoopTransfers {
 public:
  LoopTransfers(const FrequencyGrid& grid, const StageSpec& stage, const PlantPrior& prior,
                const std::vector<Index>& axes, const std::vector<Index>& outputs)
      : grid_(grid), prior_(prior), axes_(axes), outputs_(outputs) {
    const auto n_u = static_cast<Index>(stage.info.actuators.size());
    const auto n_y = static_cast<Index>(stage.info.sensors.size());
    const auto n = static_cast<Index>(axes.size());
    to_u.assign(stage.info.actuators.size(), MatrixXcd(n, grid.size()));
    to_y.assign(stage.info.sensors.size(), MatrixXcd(n, grid.size()));
    cost.resize(n, grid.size());
    u_noise.setZero(n_u);
    slew_noise.setZero(n_u);
    y_noise.setZero(n_y);
    velocity_noise.setZero(n_y);
    const MotionController controller(stage.controller);
    for (Index k = 0; k < grid.size(); ++k)
      add_line(k, controller.response(grid.frequency_hz()[k]));
    const Eigen::VectorXd below_hz = below_band_hz(grid);
    const Index below = prior.below_band.empty() ? 0 : below_hz.size();
    below_u.assign(stage.info.actuators.size(), MatrixXcd(n, below));
    below_y.assign(stage.info.sensors.size(), MatrixXcd(n, below));
    for (Index b = 0; b < below; ++b)
      add_transfers(b, prior.below_band[b], controller.response(below_hz[b]), below_u, below_y);
  }

  std::vector<MatrixXcd> to_u, to_y;        ///< per channel: axes x lines
  std::vector<MatrixXcd> below_u, below_y;  ///< axes x below_band_hz(), or empty
  MatrixXd cost;
  Eigen::VectorXd u_noise, slew_noise, y_noise, velocity_noise;  ///< mean squares

 private:
  /// @returns S on the excited axes
  MatrixXcd add_transfers(Index column, const MatrixXcd& G, const MatrixXcd& K,
                          std::vector<MatrixXcd>& u, std::vector<MatrixXcd>& y) const {
    const MatrixXcd S_all = inverse(MatrixXcd::Identity(K.rows(), K.rows()) - K * G);
    MatrixXcd S = S_all(Eigen::all, axes_);
    const MatrixXcd Y = G * S;
    for (Index i = 0; i < S.rows(); ++i) u[i].col(column) = S.row(i).transpose();
    for (Index i = 0; i < Y.rows(); ++i) y[i].col(column) = Y.row(i).transpose();
    return S;
  }

  void add_line(Index k, const MatrixXcd& K) {
    const MatrixXcd& G = prior_.response[k];
    const MatrixXcd S = add_transfers(k, G, K, to_u, to_y);
    const MatrixXcd from_axes = inverse(S(axes_, Eigen::all));
    double relative = 0.0;
    for (const Index i : outputs_) {
      const double size = G(i, axes_).squaredNorm();
      relative += density(i, k) * grid_.resolution_hz() / size;
    }
    cost.col(k) = from_axes.cwiseAbs2().colwise().sum().transpose() * relative /
                  static_cast<double>(outputs_.size());
    if (prior_.noise_density.size() > 0) add_noise(k, K, G);
  }

  double density(Index sensor, Index k) const {
    return prior_.noise_density.size() > 0 ? prior_.noise_density(sensor, k) : 1.0;
  }

  /// Both sides of the spectrum, times the width represented by a line, up to Nyquist for the last one.
  void add_noise(Index k, const MatrixXcd& K, const MatrixXcd& G) {
    const Eigen::VectorXd f = grid_.frequency_hz();
    const double from = k == 0 ? 0.0 : 0.5 * (f[k - 1] + f[k]);
    const bool last = k + 1 == grid_.size();
    const double to = last ? 0.5 * grid_.sample_rate_hz() : 0.5 * (f[k] + f[k + 1]);
    const MatrixXcd S_y = inverse(MatrixXcd::Identity(G.rows(), G.rows()) - G * K);
    const Eigen::VectorXd power = 2.0 * (to - from) * prior_.noise_density.col(k);
    const Eigen::VectorXd y = S_y.cwiseAbs2() * power;
    const Eigen::VectorXd u = (K * S_y).cwiseAbs2() * power;
    const double rate = grid_.sample_rate_hz();
    y_noise += y;
    u_noise += u;
    slew_noise += std::norm(kind_factor(SignalKind::difference, f[k], rate)) * u;
    // Above the band it is noise of the sensor, not motion.
    if (!last) velocity_noise += std::norm(kind_factor(SignalKind::derivative, f[k], rate)) * y;
  }

  const FrequencyGrid& grid_;
  const PlantPrior& prior_;
  const std::vector<Index>& axes_;
  const std::vector<Index>& outputs_;
};

double limit_of(const Eigen::VectorXd& limits, std::size_t i) {
  return limits.size() == 0 ? kUnlimited : limits[i];
}

double reserve_of(const Eigen::VectorXd& mean_square, std::size_t i) {
  return kDeviations * std::sqrt(mean_square[i]);
}

void add(BoundedLoop& loop, BoundedSignal signal, std::string unit) {
  if (std::isinf(signal.peak_limit) && std::isinf(signal.rms_limit)) return;
  loop.signals.push_back(std::move(signal));
  loop.units.push_back(std::move(unit));
}

void add_actuator(BoundedLoop& loop, const LoopTransfers& transfers, const StageSpec& stage,
                  std::size_t i) {
  const Channel& channel = stage.info.actuators[i];
  BoundedSignal u{
      .name = channel.name, .transfer = transfers.to_u[i], .below_band = transfers.below_u[i]};
  BoundedSignal slew = u;
  const Eigen::VectorXd& feed_forward = stage.controller.feed_forward_n;
  const double bias = feed_forward.size() > 0 ? feed_forward[i] : 0.0;
  u.peak_limit = limit_of(stage.limits.actuator_n, i) - std::abs(bias);
  const double rms = limit_of(stage.limits.thermal_rms_n, i);
  if (!(u.peak_limit > 0.0) || !(rms > std::abs(bias)))
    fail_request("the feed-forward of '{}' alone, {} {}, reaches a limit; lower it", channel.name,
                 bias, channel.unit);
  u.rms_limit = std::sqrt(rms * rms - bias * bias);
  u.rms_time_constant_s = stage.limits.thermal_time_constant_s;
  u.reserve = reserve_of(transfers.u_noise, i);
  add(loop, std::move(u), channel.unit);
  slew.kind = SignalKind::difference;
  slew.peak_limit = limit_of(stage.limits.slew_n_s, i);
  slew.reserve = reserve_of(transfers.slew_noise, i);
  add(loop, std::move(slew), channel.unit + "/s");
}

void add_sensor(BoundedLoop& loop, const LoopTransfers& transfers, const StageSpec& stage,
                const Eigen::VectorXd& velocity_m_s, std::size_t i) {
  const Channel& channel = stage.info.sensors[i];
  BoundedSignal y{
      .name = channel.name, .transfer = transfers.to_y[i], .below_band = transfers.below_y[i]};
  BoundedSignal velocity = y;
  y.peak_limit = limit_of(stage.limits.position_window_m, i);
  y.reserve = reserve_of(transfers.y_noise, i);
  add(loop, std::move(y), channel.unit);
  velocity.kind = SignalKind::derivative;
  velocity.peak_limit = limit_of(velocity_m_s, i);
  velocity.reserve = reserve_of(transfers.velocity_noise, i);
  add(loop, std::move(velocity), channel.unit + "/s");
}

}  // namespace

BoundedLoop bounded_loop(const FrequencyGrid& grid, const ExperimentSpec& experiment,
                         const StageSpec& stage, const PlantPrior& prior,
                         const std::vector<std::string>& outputs,
                         const Eigen::VectorXd& velocity_m_s) {
  const std::vector<Index> axes = actuators_of(experiment, stage.info, prior);
  const std::vector<Index> wanted = outputs_of(outputs, stage.info, prior);
  const LoopTransfers transfers(grid, stage, prior, axes, wanted);
  BoundedLoop loop;
  loop.cost = transfers.cost;
  loop.noise_known = prior.noise_density.size() > 0;
  loop.extrapolated_below_hz = prior.extrapolated_below_hz;
  loop.extrapolation_misfit = prior.extrapolation_misfit;
  for (std::size_t i = 0; i < stage.info.actuators.size(); ++i)
    add_actuator(loop, transfers, stage, i);
  for (std::size_t i = 0; i < stage.info.sensors.size(); ++i) {
    if (prior.sensor_known[i])
      add_sensor(loop, transfers, stage, velocity_m_s, i);
    else if (stage.limits.position_window_m.size() > 0)
      loop.unknown.push_back(stage.info.sensors[i].name);
  }
  for (BoundedSignal& signal : loop.signals) {
    signal.rest_margin = kRestMargin;
    signal.below_band_doubt = prior.extrapolation_misfit;
  }
  return loop;
}

double relative_variance(const ExperimentPlan& plan, const MatrixXd& cost) {
  const ExcitationScheme scheme = plan.spec().scheme;
  const auto n = static_cast<double>(plan.axes());
  // Zippered: each axis has every n-th line, in one experiment.
  const double factor = scheme == ExcitationScheme::single_axis ? 1.0
                        : scheme == ExcitationScheme::zippered  ? n
                                                                : 1.0 / n;
  const Eigen::ArrayXXd power = plan.amplitude().array().square();
  return 4.0 * factor * (power > 0.0).select(cost.array() / power, 0.0).colwise().sum().mean();
}

}  // namespace stageid
