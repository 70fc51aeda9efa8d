#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "acquisition/record/log_info.hpp"
#include "estimation/modal/validation.hpp"
#include "estimation/model/additive_model.hpp"
#include "frf/periods/health_finding.hpp"

namespace stageid {

/// Whether a model can be trusted, as in the exit code.
struct ModelVerdict {
  bool trustworthy = true;
  bool validated = false;            ///< compared with held-back data
  std::vector<std::string> reasons;  ///< the gravest first; for a trustworthy model, warnings
};

/// What the complete runs lost: "3 cycles are missing", "4 samples are marked as invalid". Incomplete runs are not used,
/// and the ramp of a controlled stop is marked.
std::vector<std::string> losses_of(const std::vector<LogRun>& runs);

/// Checks, in this order: faults of the data, the status of the fit, losses of the recording, doubts about the data,
/// then the residual on held-back data. Doubts alone leave the model trustworthy.
/// @param health of the data to which the model is compared, or was fitted
/// @param runs of their log, if it is known
ModelVerdict judge_model(const AdditiveModel& model, const std::vector<Finding>& health,
                         const std::optional<Validation>& validation,
                         const std::vector<LogRun>& runs = {});

/// One sentence for people: "verdict: trustworthy, ...".
std::string verdict_line(const ModelVerdict& verdict);
nlohmann::ordered_json verdict_json(const ModelVerdict& verdict);

/// The comparison with held-back data, for people.
std::vector<std::string> validation_lines(const Validation& validation);
nlohmann::ordered_json validation_json(const Validation& validation);

}  // namespace stageid
