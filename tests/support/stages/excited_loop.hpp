#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "estimation/modal/period_spectra.hpp"
#include "excitation/multisine/dft.hpp"
#include "hal/simulator/plant_spec.hpp"
#include "hal/stage/motion_controller.hpp"
#include "tests/support/stages/simulated_spec.hpp"

namespace stageid::test {

/// The mode of the plant with the nearest natural frequency: the channel of a fault of a mode.
inline int nearest_mode(const StageInfo& info, const PlantSpec& plant, double hz) {
  const std::vector<PlantMode> modes = plant_modes(info, plant);
  const auto distance = [&](const PlantMode& m) { return std::abs(m.natural_frequency_hz - hz); };
  return static_cast<int>(std::ranges::min_element(modes, {}, distance) - modes.begin());
}

/// A simulated stage in closed loop under a periodic excitation, for ever; gives the spectra of period after period.
class ExcitedLoop {
 public:
  /// @param excitation samples of one period x actuators   @param lines of the spectra
  ExcitedLoop(const SimulatedSpec& spec, Eigen::MatrixXd excitation, std::vector<int> lines,
              const std::vector<std::string>& inputs, const std::vector<std::string>& outputs,
              std::uint64_t seed)
      : stage_(simulated(spec)),
        controller_(spec.controller),
        dft_(static_cast<int>(excitation.rows())),
        excitation_(std::move(excitation)),
        lines_(std::move(lines)),
        u_(Eigen::VectorXd::Zero(std::ssize(spec.info.actuators))),
        y_(Eigen::VectorXd::Zero(std::ssize(spec.info.sensors))) {
    for (const std::string& name : inputs)
      inputs_.push_back(channel_index(spec.info.actuators, name));
    for (const std::string& name : outputs)
      outputs_.push_back(channel_index(spec.info.sensors, name));
    measured_.y = {y_.data(), static_cast<std::size_t>(y_.size())};
    stage_->start(seed, measured_);
  }

  /// The loop follows a setpoint: m at every sensor, by sample since the start.
  void follow(std::function<Eigen::VectorXd(std::uint64_t)> setpoint) {
    setpoint_ = std::move(setpoint);
  }

  /// The next periods have another excitation, of as many samples.
  void excite(Eigen::MatrixXd excitation) { excitation_ = std::move(excitation); }

  PeriodSpectra next() {
    const Eigen::Index N = excitation_.rows();
    Eigen::MatrixXd u(N, u_.size());
    Eigen::MatrixXd y(N, y_.size());
    for (Eigen::Index n = 0; n < N; ++n) {
      const Eigen::VectorXd error = setpoint_ ? Eigen::VectorXd(y_ - setpoint_(sample_++)) : y_;
      controller_.update(error.data(), u_.data());
      u_ += excitation_.row(n).transpose();
      u.row(n) = u_;
      y.row(n) = y_;
      (void)stage_->exchange({measured_.cycle, {u_.data(), static_cast<std::size_t>(u_.size())}},
                             measured_, {});
    }
    return {spectra(y, outputs_), spectra(u, inputs_)};
  }

 private:
  Eigen::MatrixXcd spectra(const Eigen::MatrixXd& samples, const std::vector<int>& channels) {
    Eigen::MatrixXcd out(std::ssize(channels), std::ssize(lines_));
    for (Eigen::Index c = 0; c < out.rows(); ++c) {
      const auto X = dft_.forward(samples.col(channels[c]));
      for (Eigen::Index k = 0; k < out.cols(); ++k) out(c, k) = X[lines_[k]];
    }
    return out / static_cast<double>(dft_.length());
  }

  std::unique_ptr<SimulatedStage> stage_;
  MotionController controller_;
  RealDft dft_;
  Eigen::MatrixXd excitation_;
  std::function<Eigen::VectorXd(std::uint64_t)> setpoint_;
  std::uint64_t sample_ = 0;
  std::vector<int> lines_;
  Eigen::VectorXd u_;
  Eigen::VectorXd y_;
  std::vector<int> inputs_;
  std::vector<int> outputs_;
  Inputs measured_;
};

}  // namespace stageid::test
