#pragma once

#include <memory>
#include <vector>

#include "acquisition/record/log_reader.hpp"
#include "excitation/plan/experiment_plan.hpp"
#include "hal/stage/replay_stage.hpp"

namespace stageid {

/// Provides the runs of a log to the replay stage, in the order of a plan's runs.
class ReplayLog final : public ReplaySource {
 public:
  /// @throws std::invalid_argument if the log lacks a complete run of the list.
  ReplayLog(std::unique_ptr<LogReader> log, const std::vector<RunId>& runs);

  int runs() const override { return static_cast<int>(order_.size()); }
  void load(int run, Eigen::MatrixXd& u, Eigen::MatrixXd& y, Eigen::VectorXi& marked) override;

 private:
  std::unique_ptr<LogReader> log_;
  std::vector<std::size_t> order_;
};

}  // namespace stageid
