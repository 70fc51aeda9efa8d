#pragma once

#include <Eigen/Core>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "acquisition/record/log_info.hpp"
#include "frf/response/frf_estimate.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {

/// Result of an import, for people (lines) and for --json (an object).
struct ImportSummary {
  std::vector<std::string> lines;
  Json json = Json::object();
};

/// Collects the figures of a log run by run.
class LogSummary {
 public:
  /// @param period one period of the excitation x channels   @param actuators, sensors run.samples x channels
  void add(const LogRun& run, const Eigen::Ref<const Eigen::MatrixXd>& period,
           const Eigen::Ref<const Eigen::MatrixXd>& actuators,
           const Eigen::Ref<const Eigen::MatrixXd>& sensors);
  /// @param notes conversions, one sentence each
  ImportSummary summary(const LogInfo& info, const std::vector<std::string>& notes) const;

 private:
  std::vector<LogRun> runs_;
  std::map<int, std::set<Eigen::Index>> excited_;     ///< channels per experiment
  Eigen::VectorXd excitation_, actuators_, sensors_;  ///< sums of squares per channel
};

ImportSummary summary_of(const FrfEstimate& frf, const std::vector<std::string>& notes);

}  // namespace stageid
