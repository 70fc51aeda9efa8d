#include "tools/steps/model_verdict.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "acquisition/files/counted.hpp"
#include "tools/steps/fit_step.hpp"
#include "tools/steps/health_step.hpp"

namespace stageid {

std::vector<std::string> losses_of(const std::vector<LogRun>& runs) {
  RunHealth health;
  for (const LogRun& run : runs)
    if (run.complete) health += run.health;
  std::vector<std::string> losses;
  if (health.missing > 0)
    losses.push_back(counted(health.missing, "cycle is", "cycles are") + " missing");
  if (health.marked > 0)
    losses.push_back(counted(health.marked, "sample is", "samples are") + " marked as invalid");
  return losses;
}

ModelVerdict judge_model(const AdditiveModel& model, const std::vector<Finding>& health,
                         const std::optional<Validation>& validation,
                         const std::vector<LogRun>& runs) {
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
    if (!fit.trustworthy())
      distrust(fit.message.empty() ? "the fit ended with status " + fit.status_word()
                                   : fit.message);
  };
  // Faults of the fitted data are in the message of the fit; those of other data come before it.
  if (fit.status == FitStatus::faulty_data) judge_fit();
  for (std::string& fault : health_notes(health, Severity::fault)) distrust(std::move(fault));
  judge_fit();
  for (std::string& loss : losses_of(runs)) distrust(std::move(loss));
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
                        : "; not validated: no held-back data, or too few lines without variances",
      verdict.reasons.empty() ? "" : fmt::format(". Check: {}", fmt::join(verdict.reasons, "; ")));
}

nlohmann::ordered_json verdict_json(const ModelVerdict& verdict) {
  return {{"trustworthy", verdict.trustworthy},
          {"validated", verdict.validated},
          {"reasons", verdict.reasons}};
}

std::vector<std::string> validation_lines(const Validation& v) {
  std::vector<std::string> lines = {
      "no channel exceeds its noise, so a relative error is undefined"};
  if (std::isfinite(v.relative_rms_error))
    lines[0] = fmt::format("relative error {:.4e} (channels that respond), {:.4e} (whole response)",
                           v.relative_rms_error, v.normalized_error);
  if (v.chi_square_per_dof > 0.0) {
    const std::string expected = v.expected_chi_square > 0.0
                                     ? fmt::format("{:.3f}", v.expected_chi_square)
                                     : "undefined, the variances are too uncertain";
    lines.push_back(fmt::format(
        "chi-square per degree of freedom {:.3f}; expected from {} alone: {}", v.chi_square_per_dof,
        v.variance == ResidualVariance::noise     ? "noise"
        : v.variance == ResidualVariance::scatter ? "what neighbouring lines scatter"
                                                  : "noise and distortion",
        expected));
    lines.push_back(
        fmt::format("residuals above their 95 % point: {:.1f} %; autocorrelation {:.4f}, 99 % "
                    "limit {:.4f}",
                    100.0 * v.whitened_above_95, v.whiteness, v.whiteness_limit));
  } else {
    lines.push_back("too few lines without variances, so the error cannot be compared with noise");
  }
  return lines;
}

nlohmann::ordered_json validation_json(const Validation& v) {
  return {{"relative_rms_error", v.relative_rms_error},
          {"normalized_error", v.normalized_error},
          {"chi_square_per_dof", v.chi_square_per_dof},
          {"expected_chi_square", v.expected_chi_square},
          {"variance", to_string(v.variance)},
          {"explained", v.explained},
          {"reason", v.reason},
          {"whitened_above_95", v.whitened_above_95},
          {"whiteness", v.whiteness},
          {"whiteness_limit", v.whiteness_limit},
          {"channel_error", std::vector<double>(v.channel_error.begin(), v.channel_error.end())}};
}

}  // namespace stageid
