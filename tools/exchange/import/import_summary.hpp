#pragma once

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "acquisition/record/log_info.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Result of an import, for people (lines) and for --json (an object).
struct ImportSummary {
  std::vector<std::string> lines;
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
};

/// Collects the figures of a log run by run.
class LogSummary {
 public:
  /// @param period one period of the excitation x channels   @param actuators, sensors samples x channels
  void add(const LogRun& run, const Eigen::Ref<const Eigen::MatrixXd>& period,
           const Eigen::Ref<const Eigen::MatrixXd>& actuators,
           const Eigen::Ref<const Eigen::MatrixXd>& sensors);
  /// @param notes conversions, one sentence each
  ImportSummary summary(const LogInfo& info, const std::vector<std::string>& notes) const;

 private:
  struct Power {
    Eigen::VectorXd squares;  ///< per channel
    double samples = 0.0;
    void add(const Eigen::Ref<const Eigen::MatrixXd>& columns);
  };
  std::set<std::pair<int, int>> runs_;  ///< realization, experiment
  /// per experiment: channels with nonzero excitation
  std::vector<std::set<Eigen::Index>> excited_;
  std::vector<std::uint64_t> samples_;
  Power excitation_, actuators_, sensors_;
};

ImportSummary summary_of(const FrfEstimate& frf, const std::vector<std::string>& notes);

}  // namespace stageid
