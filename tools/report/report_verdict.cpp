#include "tools/report/report_verdict.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "acquisition/files/counted.hpp"
#include "tools/report/report_modes.hpp"
#include "tools/steps/model_verdict.hpp"

namespace stageid {
namespace {

using Reasons = std::vector<std::string>;

/// @returns whether the model is trustworthy.
bool judge_fit(const ReportData& data, Reasons& reasons) {
  const ModelVerdict verdict = judge_model(*data.model, data.findings, data.validation, data.runs);
  for (const std::string& reason : verdict.reasons) {
    // Findings of the data are already reasons, without their remedy.
    const auto said = [&](const std::string& other) { return reason.starts_with(other); };
    if (std::ranges::none_of(reasons, said)) reasons.push_back(reason);
  }
  return verdict.trustworthy;
}

void judge_modes(const ReportData& data, Reasons& reasons) {
  if (data.true_modes.empty()) return;
  for (const ModeRow& row : mode_table(*data.model, data.true_modes)) {
    if (!row.truth) {
      // Outside the band, a mode represents the rest of the plant: suspension, modes above.
      const auto& band_hz = data.model->fit.band_hz;
      if (*row.frequency_hz < band_hz[0] || (*row.frequency_hz > band_hz[1] && band_hz[1] > 0.0))
        continue;
      reasons.push_back(
          fmt::format("the mode at {:.2f} Hz does not exist in the plant", *row.frequency_hz));
    } else if (!row.frequency_hz) {
      reasons.push_back(fmt::format("the true mode at {:.2f} Hz was not identified",
                                    row.truth->natural_frequency_hz));
    } else if (std::abs(row.frequency_deviation().value_or(0.0)) > 3.0 &&
               *row.relative_frequency_error() > 1e-4) {
      reasons.push_back(fmt::format(
          "the mode at {:.2f} Hz deviates from the true one by {:.1f} standard deviations",
          *row.frequency_hz, std::abs(*row.frequency_deviation())));
    }
  }
}

void add_findings(const ReportData& data, Reasons& reasons) {
  for (const Finding& finding : data.findings) {
    if (finding.severity == Severity::unchecked) continue;
    reasons.push_back(fmt::format("{}{}{}{}", finding.channel, finding.channel.empty() ? "" : ": ",
                                  finding.what,
                                  finding.figure.empty() ? "" : " (" + finding.figure + ")"));
  }
}

void judge_runs(const ReportData& data, Reasons& reasons) {
  const auto incomplete = std::ranges::count(data.runs, false, &LogRun::complete);
  if (incomplete > 0) reasons.push_back(counted(incomplete, "run is", "runs are") + " incomplete");
  if (data.model) return;  // judge_model() knows the losses
  for (const std::string& loss : losses_of(data.runs)) reasons.push_back(loss);
}

}  // namespace

Verdict judge(const ReportData& data) {
  Verdict verdict;
  bool trustworthy = !any_fault(data.findings);
  add_findings(data, verdict.reasons);
  verdict.reasons.insert(verdict.reasons.end(), data.doubts.begin(), data.doubts.end());
  judge_runs(data, verdict.reasons);
  if (data.model) {
    trustworthy = judge_fit(data, verdict.reasons);
    judge_modes(data, verdict.reasons);
  }

  if (!trustworthy) {
    verdict.level = Verdict::Level::bad;
    verdict.text = "Not to be trusted";
  } else if (!verdict.reasons.empty()) {
    verdict.level = Verdict::Level::doubt;
    verdict.text = data.model ? "Review these findings before using the model"
                              : "Review these findings before using the measurement";
  } else if (data.model) {
    verdict.level = Verdict::Level::good;
    verdict.text = data.validation && data.validation->chi_square_per_dof > 0.0
                       ? "The fit converged, and the model agrees with held-back data"
                       : "The fit converged";
  } else {
    verdict.text = data.frf ? "Measured frequency response, no model" : "No model";
  }
  return verdict;
}

}  // namespace stageid
