#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "hal/stage/motion_controller.hpp"
#include "hal/stage/stage.hpp"

namespace stageid::test {

/// A minimal measurement loop, u[n] = C y[n] + r[n], without logging and safety, which belong to acquisition.
class ClosedLoop {
 public:
  ClosedLoop(CyclicStage& stage, const MotionControllerSpec& controller)
      : stage_(stage),
        controller_(controller),
        y_(Eigen::VectorXd::Zero(controller_.sensors())),
        u_(Eigen::VectorXd::Zero(controller_.actuators())) {}

  void start(std::uint64_t run_seed) {
    inputs_.y = {y_.data(), static_cast<std::size_t>(y_.size())};
    controller_.reset();
    stage_.start(run_seed, inputs_);
  }

  /// Computes u[n], then exchanges the sample with the stage.
  Outcome step(const Eigen::VectorXd& excitation) {
    controller_.update(y_.data(), u_.data());
    u_ += excitation;
    Outputs outputs;
    outputs.cycle = inputs_.cycle;
    outputs.u = {u_.data(), static_cast<std::size_t>(u_.size())};
    return stage_.exchange(outputs, inputs_, {});
  }

  const Eigen::VectorXd& y() const { return y_; }  ///< after step(): y[n+1]
  const Eigen::VectorXd& u() const { return u_; }
  const Inputs& inputs() const { return inputs_; }

 private:
  CyclicStage& stage_;
  MotionController controller_;
  Eigen::VectorXd y_;
  Eigen::VectorXd u_;
  Inputs inputs_;
};

}  // namespace stageid::test
