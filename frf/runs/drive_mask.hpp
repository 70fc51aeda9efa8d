#pragma once

#include <Eigen/Core>
#include <vector>

#include "acquisition/record/log_info.hpp"

namespace stageid {

/// Samples at which the excitation of one run changes. A channel that is constant while nothing drives it (after a
/// chirp, or on an axis that waits for its experiment) is not stuck.
class DriveMask {
 public:
  DriveMask() = default;
  /// @param period excitation of the run, samples x excitation channels
  DriveMask(const Eigen::MatrixXd& period, const LogInfo& info);

  /// Per sample, whether any excitation channel differs from the previous sample; null: unknown.
  const char* any() const noexcept { return any_.empty() ? nullptr : any_.data(); }
  /// The same for the excitation channel with this actuator's name, if it is excited in this run; otherwise any().
  const char* of_actuator(Eigen::Index actuator) const noexcept;
  /// Whether the excitation channel with the actuator's name is excited in this run.
  bool excites(Eigen::Index actuator) const noexcept;

 private:
  std::vector<char> any_;
  std::vector<std::vector<char>> own_;  // by actuator; empty: not excited in this run
};

}  // namespace stageid
