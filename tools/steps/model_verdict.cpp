#include "tools/steps/model_verdict.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "estimation/problem/fit_options.hpp"
#include "tools/steps/fit_step.hpp"
#include "tools/steps/health_step.hpp"

namespace stageid {

ModelVerdict judge_model(const AdditiveModel& model, const std::vector<Finding>& health,
                         const std::optional<Validation>& validation) {
  const FitRecord& fit = model.fit;
  ModelVerdict verdict;
  const auto add = [&](std::string reason) {
    const auto holds = [&](const std::string& other) {
      return other.find(reason) != std::string::npos;
    };
    if (std::ranges::none_of(verdict.reasons, holds)) verdict.reasons.push_back(std::move(reason));
  };
  const auto distrust = [&](std::string reason) {
    verdict.trustworthy = false;
    add(std::move(reason));
  };
  const auto judge_fit = [&] {
    if (!is_trustworthy(fit))
      distrust(fit.message.empty() ? "the fit ended with status " + fit.status : fit.message);
  };
  // Faults of the fitted data are in the message of the fit; those of other data come before it.
  if (fit.status == to_string(FitStatus::faulty_data)) judge_fit();
  for (std::string& fault : health_notes(health, Severity::fault)) distrust(std::move(fault));
  judge_fit();
  // Doubts come before the residual, because they are the cause if it is too large.
  for (std::string& doubt : doubts_of(model)) add(std::move(doubt));
  for (std::string& doubt : health_notes(health, Severity::doubt)) add(std::move(doubt));
  if (validation && !validation->explained) distrust("on held-back data " + validation->reason);
  verdict.validated = validation && validation->variance != ResidualVariance::none;
  return verdict;
}

std::string verdict_line(const ModelVerdict& verdict) {
  if (!verdict.trustworthy)
    return fmt::format("verdict: not to be trusted: {}", fmt::join(verdict.reasons, "; "));
  return fmt::format(
      "verdict: trustworthy{}{}",
      verdict.validated ? "; noise and known distortion explain the error on held-back data"
                        : "; not validated: no held-back data with variances",
      verdict.reasons.empty() ? "" : fmt::format(". Check: {}", fmt::join(verdict.reasons, "; ")));
}

nlohmann::ordered_json verdict_json(const ModelVerdict& verdict) {
  return {{"trustworthy", verdict.trustworthy},
          {"validated", verdict.validated},
          {"reasons", verdict.reasons}};
}

}  // namespace stageid
