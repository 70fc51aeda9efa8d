#pragma once

#include <Eigen/Core>
#include <vector>

#include "acquisition/record/log_info.hpp"

namespace stageid {

/// Where in a period the excitation of one run changes from sample to sample. A channel that shows one value
/// while nothing drives it (the rest after a chirp, an axis that waits for its experiment) is not stuck.
class DriveMask {
 public:
  DriveMask() = default;
  /// @param period excitation of the run, samples x excitation channels
  DriveMask(const Eigen::MatrixXd& period, const LogInfo& info);

  /// Per sample, whether any excitation channel differs from the sample before; null: unknown.
  const char* any() const noexcept { return any_.empty() ? nullptr : any_.data(); }
  /// The same of the excitation channel of this actuator's name, if it is excited in this run; else any().
  const char* of_actuator(Eigen::Index actuator) const noexcept;
  /// Whether the excitation channel of its name is excited in this run.
  bool excites(Eigen::Index actuator) const noexcept;

 private:
  std::vector<char> any_;
  std::vector<std::vector<char>> own_;  // by actuator; empty: not excited in this run
};

}  // namespace stageid
