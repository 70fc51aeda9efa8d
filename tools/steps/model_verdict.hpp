#pragma once

#include <optional>
#include <string>
#include <vector>

#include "acquisition/record/log_info.hpp"
#include "estimation/modal/validation.hpp"
#include "estimation/model/additive_model.hpp"
#include "frf/periods/health_finding.hpp"
#include "tools/steps/problem.hpp"
#include "tools/steps/problem_commands.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {

/// Whether a model can be trusted, as in the exit code.
struct ModelVerdict {
  bool trustworthy = true;
  bool validated = false;         ///< compared with held-back data
  std::vector<Problem> problems;  ///< see rank(); those of a trustworthy model are not grave
};

/// What the complete runs lost: "3 cycles are missing", "4 samples are marked as invalid". Incomplete runs are not used,
/// and the ramp of a controlled stop is marked.
std::vector<std::string> losses_of(const std::vector<LogRun>& runs);

/// Collects the problems of the model, of the data to which it was fitted, and of those to which it is compared. Doubts
/// about data leave the model trustworthy; see problem.hpp for the ranking.
/// @param health of the data to which the model is compared, or was fitted
/// @param runs of their log, if it is known
/// @param files for the commands
ModelVerdict judge_model(const AdditiveModel& model, const std::vector<Finding>& health,
                         const std::optional<Validation>& validation,
                         const std::vector<LogRun>& runs = {}, const ResultFiles& files = {});

/// The head for people: "verdict: trustworthy, ...", or the first problems with their commands.
std::vector<std::string> verdict_lines(const ModelVerdict& verdict);
Json verdict_json(const ModelVerdict& verdict);

/// The comparison with held-back data, for people.
std::vector<std::string> validation_lines(const Validation& validation);
Json validation_json(const Validation& validation);

}  // namespace stageid
