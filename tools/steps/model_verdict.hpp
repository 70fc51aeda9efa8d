#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "estimation/modal/validation.hpp"
#include "estimation/model/additive_model.hpp"
#include "frf/periods/health_finding.hpp"

namespace stageid {

/// Whether a model may be trusted, as the exit code says it.
struct ModelVerdict {
  bool trustworthy = true;
  bool validated = false;            ///< compared with data that were held back and have variances
  std::vector<std::string> reasons;  ///< the gravest first; of a trustworthy model what to look at
};

/// Faults of the data, the end of the fit, doubts about the data, then the residual on data that were held back. Doubts
/// alone leave the model trustworthy.
/// @param health of the data that the model is compared with, or was fitted to
ModelVerdict judge_model(const AdditiveModel& model, const std::vector<Finding>& health,
                         const std::optional<Validation>& validation);

/// One sentence for people: "verdict: trustworthy, ...".
std::string verdict_line(const ModelVerdict& verdict);
nlohmann::ordered_json verdict_json(const ModelVerdict& verdict);

}  // namespace stageid
