#include "tools/steps/model_verdict.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "acquisition/files/counted.hpp"

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
                         const std::vector<LogRun>& runs, const ResultFiles& files) {
  ModelVerdict verdict;
  verdict.problems = problems_of(model);
  const auto add = [&](Problem problem) { verdict.problems.push_back(std::move(problem)); };
  for (Problem& problem : problems_of(health)) add(std::move(problem));
  for (std::string& loss : losses_of(runs))
    add({kLosses, true, std::move(loss),
         "remove the cause, see 'late' and 'missing' of the log, and measure again"});
  const bool consequence = !model.fit.trustworthy();
  if (validation && !validation->explained && !consequence)
    add({kHeldBack, true, "on held-back data " + validation->reason,
         "check that the stage has not changed, and estimate the response again"});
  rank(verdict.problems);
  add_commands(verdict.problems, files, model);
  verdict.trustworthy = std::ranges::none_of(verdict.problems, &Problem::grave);
  verdict.validated = validation && validation->variance != ResidualVariance::none;
  return verdict;
}

std::vector<std::string> verdict_lines(const ModelVerdict& verdict) {
  if (!verdict.trustworthy) return head_lines("verdict: not to be trusted: ", verdict.problems);
  const std::string trusted = fmt::format(
      "verdict: trustworthy{}",
      verdict.validated ? "; noise and known distortion explain the error on held-back data"
                        : "; not validated: no held-back data, or too few lines without variances");
  return head_lines(trusted + (verdict.problems.empty() ? "" : ". Check: "), verdict.problems);
}

Json verdict_json(const ModelVerdict& verdict) {
  Json json = {{"trustworthy", verdict.trustworthy}, {"validated", verdict.validated}};
  json.update(head_json(verdict.problems));
  return json;
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
    std::string whitened =
        fmt::format("residuals above their 95 % point: {:.1f} %", 100.0 * v.whitened_above_95);
    if (v.whiteness_limit > 0.0)
      whitened += fmt::format("; autocorrelation {:.4f}, 99 % limit {:.4f}", v.whiteness,
                              v.whiteness_limit);
    lines.push_back(std::move(whitened));
  } else {
    lines.push_back("too few lines without variances, so the error cannot be compared with noise");
  }
  return lines;
}

Json validation_json(const Validation& v) {
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
          {"channel_error", v.channel_error}};
}

}  // namespace stageid
