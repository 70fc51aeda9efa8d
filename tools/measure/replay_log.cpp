#include "tools/measure/replay_log.hpp"

#include <fmt/format.h>

#include <stdexcept>

namespace stageid {

ReplayLog::ReplayLog(std::unique_ptr<LogReader> log, const std::vector<RunId>& runs)
    : log_(std::move(log)) {
  const std::vector<LogRun>& recorded = log_->runs();
  for (const RunId wanted : runs) {
    // Of several complete runs the last one is used, as in the estimate.
    std::size_t found = recorded.size();
    for (std::size_t i = 0; i < recorded.size(); ++i)
      if (recorded[i].complete && recorded[i].realization == wanted.realization &&
          recorded[i].experiment == wanted.experiment)
        found = i;
    if (found == recorded.size())
      throw std::invalid_argument(
          fmt::format("{}: no complete run of realization {}, experiment {}; replay the log of the "
                      "same experiment",
                      log_->path().string(), wanted.realization + 1, wanted.experiment + 1));
    order_.push_back(found);
  }
}

void ReplayLog::load(int run, Eigen::MatrixXd& u, Eigen::MatrixXd& y, Eigen::VectorXi& marked) {
  const std::size_t index = order_.at(static_cast<std::size_t>(run));
  LogSamples samples;
  log_->read(index, 0, log_->runs()[index].samples, samples);
  u = samples.actuators.transpose();
  y = samples.sensors.transpose();
  marked = samples.marked.cast<int>();
}

}  // namespace stageid
