#include "acquisition/prediction/closed_loop_prediction.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>

#include "acquisition/loop/excited_actuators.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "excitation/multisine/bounded_signal.hpp"
#include "excitation/multisine/dft.hpp"
#include "hal/stage/motion_controller.hpp"

namespace stageid {
namespace {

/// Transfers from the excited channels to u and to y, per line: (channels x axes) matrices.
struct ClosedLoop {
  std::vector<Eigen::MatrixXcd> to_u;
  std::vector<Eigen::MatrixXcd> to_y;
};

ClosedLoop closed_loop(const ExperimentPlan& plan, const StageSpec& stage, const PlantSpec& plant) {
  const StageInfo& info = stage.info;
  const auto n_u = static_cast<Eigen::Index>(info.actuators.size());
  Eigen::MatrixXd selection = Eigen::MatrixXd::Zero(n_u, plan.axes());
  const std::vector<int> excited = excited_actuators(plan.spec(), info);
  for (std::size_t axis = 0; axis < excited.size(); ++axis)
    selection(excited[axis], static_cast<Eigen::Index>(axis)) = 1.0;
  const std::vector<PlantMode> modes = plant_modes(info, plant);
  const MotionController controller(stage.controller);
  ClosedLoop loop;
  for (const double frequency_hz : plan.grid().frequency_hz()) {
    const Eigen::MatrixXcd G =
        sampled_response(modes, info.delay_s, info.sample_rate_hz, frequency_hz);
    const Eigen::MatrixXcd K = controller.response(frequency_hz);
    const Eigen::MatrixXcd return_difference = Eigen::MatrixXcd::Identity(n_u, n_u) - K * G;
    loop.to_u.push_back(solve(return_difference, selection.cast<std::complex<double>>()));
    loop.to_y.push_back(G * loop.to_u.back());
  }
  return loop;
}

void compare(ChannelPrediction& channel, const char* what, double value,
             const Eigen::VectorXd& limits, Eigen::Index index, const char* per = "") {
  if (limits.size() == 0 || !(value > limits[index])) return;
  channel.violations.push_back(fmt::format("{}: {} would be {:.4g} {}{}, limit {:.4g} {}{}",
                                           channel.name, what, value, channel.unit, per,
                                           limits[index], channel.unit, per));
}

class Predictor {
 public:
  Predictor(const ExperimentPlan& plan, const StageSpec& stage,
            const std::optional<PlantSpec>& plant)
      : plan_(plan), stage_(stage), dft_(plan.grid().samples_per_period()) {
    result_.crest_factor.assign(plan.spec().axes.size(), 0.0);
    if (!why_unpredictable(stage, plant).empty()) return;
    loop_ = closed_loop(plan, stage, plant.value());
    for (const Channel& c : stage.info.actuators) result_.actuators.push_back({c.name, c.unit});
    for (const Channel& c : stage.info.sensors) result_.sensors.push_back({c.name, c.unit});
  }

  DesignPrediction predict() {
    for (const RunId run : plan_.runs()) add_run(run);
    for (std::size_t i = 0; i < result_.actuators.size(); ++i) judge_actuator(i);
    for (std::size_t i = 0; i < result_.sensors.size(); ++i) {
      ChannelPrediction& channel = result_.sensors[i];
      compare(channel, "|y|", channel.peak, stage_.limits.position_window_m,
              static_cast<Eigen::Index>(i));
    }
    return std::move(result_);
  }

 private:
  void add_run(RunId run) {
    const Eigen::MatrixXd r = plan_.excitation(run);
    for (Eigen::Index axis = 0; axis < r.cols(); ++axis)
      if (r.col(axis).squaredNorm() > 0.0) {
        double& largest = result_.crest_factor[axis];
        largest = std::max(largest, crest_factor(r.col(axis)));
      }
    const Eigen::MatrixXcd R = plan_.spectrum(run);
    const Eigen::VectorXd& feed_forward = stage_.controller.feed_forward_n;
    for (std::size_t i = 0; i < result_.actuators.size(); ++i) {
      Eigen::VectorXd u = period(loop_.to_u, R, static_cast<Eigen::Index>(i));
      if (feed_forward.size() > 0) u.array() += feed_forward[i];
      ChannelPrediction& channel = result_.actuators[i];
      add_period(channel, u);
      double step = std::abs(u[0] - u[u.size() - 1]);
      step = std::max(step, (u.tail(u.size() - 1) - u.head(u.size() - 1)).cwiseAbs().maxCoeff());
      const double rate_hz = stage_.info.sample_rate_hz;
      channel.slew_per_s = std::max(channel.slew_per_s, step * rate_hz);
      channel.thermal_rms = std::max(
          channel.thermal_rms, windowed_rms(u, rate_hz, stage_.limits.thermal_time_constant_s));
    }
    for (std::size_t i = 0; i < result_.sensors.size(); ++i)
      add_period(result_.sensors[i], period(loop_.to_y, R, static_cast<Eigen::Index>(i)));
  }

  Eigen::VectorXd period(const std::vector<Eigen::MatrixXcd>& transfer, const Eigen::MatrixXcd& R,
                         Eigen::Index channel) {
    Eigen::VectorXcd half = Eigen::VectorXcd::Zero(dft_.half_size());
    const std::vector<int>& lines = plan_.grid().lines();
    for (std::size_t k = 0; k < lines.size(); ++k)
      half[lines[k]] = transfer[k].row(channel) * R.col(k);
    return dft_.inverse(half);
  }

  static void add_period(ChannelPrediction& channel, const Eigen::VectorXd& x) {
    channel.rms = std::max(channel.rms, std::sqrt(x.squaredNorm() / static_cast<double>(x.size())));
    channel.peak = std::max(channel.peak, x.cwiseAbs().maxCoeff());
  }

  void judge_actuator(std::size_t i) {
    ChannelPrediction& channel = result_.actuators[i];
    const StageLimits& limits = stage_.limits;
    compare(channel, "|u|", channel.peak, limits.actuator_n, i);
    compare(channel, "slew", channel.slew_per_s, limits.slew_n_s, i, "/s");
    compare(channel, "thermal rms", channel.thermal_rms, limits.thermal_rms_n, i);
  }

  const ExperimentPlan& plan_;
  const StageSpec& stage_;
  ClosedLoop loop_;
  RealDft dft_;
  DesignPrediction result_;
};

}  // namespace

std::vector<std::string> DesignPrediction::violations() const {
  std::vector<std::string> all;
  for (const auto* list : {&actuators, &sensors})
    for (const ChannelPrediction& channel : *list)
      all.insert(all.end(), channel.violations.begin(), channel.violations.end());
  return all;
}

std::string why_unpredictable(const StageSpec& stage, const std::optional<PlantSpec>& plant) {
  if (stage.controller.by_peer)
    return "the stage closes the loop by a controller of its own ('controller: peer')";
  if (!plant) return "the stage file has no 'plant'";
  return "";
}

DesignPrediction predict_closed_loop(const ExperimentPlan& plan, const StageSpec& stage,
                                     const std::optional<PlantSpec>& plant) {
  return Predictor(plan, stage, plant).predict();
}

}  // namespace stageid
