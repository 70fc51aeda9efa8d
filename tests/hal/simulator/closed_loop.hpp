#pragma once

#include <Eigen/Core>

#include "hal/stage/motion_controller.hpp"
#include "tests/hal/stage_bench.hpp"

namespace stageid::test {

/// A minimal measurement loop, u[n] = C y[n] + r[n], without logging and safety, which belong to acquisition.
class ClosedLoop {
 public:
  ClosedLoop(CyclicStage& stage, const MotionControllerSpec& controller)
      : driver_(stage), controller_(controller) {}

  void start(std::uint64_t run_seed) {
    controller_.reset();
    driver_.start(run_seed);
  }

  /// Computes u[n], then exchanges the sample with the stage.
  Outcome step(const Eigen::VectorXd& excitation) {
    controller_.update(driver_.y.data(), driver_.u.data());
    for (Eigen::Index i = 0; i < excitation.size(); ++i) driver_.u[i] += excitation[i];
    return driver_.step();
  }

  auto y() const {
    return Eigen::VectorXd::Map(driver_.y.data(), controller_.sensors());
  }  ///< after step(): y[n+1]
  auto u() const { return Eigen::VectorXd::Map(driver_.u.data(), controller_.actuators()); }

 private:
  Driver driver_;
  MotionController controller_;
};

}  // namespace stageid::test
