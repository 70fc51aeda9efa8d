#pragma once

#include <string>
#include <vector>

#include "hal/stage/motion_controller.hpp"
#include "hal/stage/stage.hpp"
#include "tools/config/config_visitor.hpp"

namespace stageid {

/// A controller as matrices or transfer functions, u = r - C y, as written in a file.
struct LinearControllerKeys {
  struct StateSpace {
    std::vector<double> a, b, c, d;  ///< row by row
  };
  struct Transfer {
    std::string actuator, sensor;
    std::vector<double> numerator, denominator;
  };
  std::vector<std::string> sensors;    ///< inputs of the controller, in its order
  std::vector<std::string> actuators;  ///< outputs
  bool has_state_space = false;
  StateSpace state_space;
  std::vector<Transfer> transfer;

  bool empty() const noexcept { return !has_state_space && transfer.empty(); }
};

/// The keys `state_space` and `transfer`. `keys` contains the channels already.
void describe_linear_controller(ConfigVisitor& v, LinearControllerKeys& keys);

/// A = 0 and so on if the list is empty.
Eigen::MatrixXd matrix_of(const std::vector<double>& row_by_row, Eigen::Index rows,
                          Eigen::Index columns);

/// Adds the controller to `spec`, for the channels of a stage; its other channels have no controller.
/// @throws std::invalid_argument for a channel that the stage does not have
void take_linear_controller(const LinearControllerKeys& keys, const std::vector<Channel>& actuators,
                            const std::vector<Channel>& sensors, MotionControllerSpec& spec);

}  // namespace stageid
