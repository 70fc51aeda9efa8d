#include "tools/report/report_verdict.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <utility>

#include "acquisition/files/counted.hpp"
#include "tools/steps/model_verdict.hpp"

namespace stageid {
namespace {

using Reasons = std::vector<std::string>;

void judge_modes(const ReportData& data, Reasons& reasons) {
  if (data.true_modes.empty()) return;
  for (const ModeRow& row : mode_rows(*data.model, data.true_modes)) {
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
  if (data.model) {
    ModelVerdict model =
        judge_model(*data.model, data.findings, data.validation, data.runs, data.files);
    trustworthy = model.trustworthy;
    verdict.problems = std::move(model.problems);
  } else {
    verdict.problems = problems_of(data.findings);
    rank(verdict.problems);
    add_commands(verdict.problems, data.files, data.frf ? data.frf->provenance_json : "", nullptr);
  }
  const auto is_known = [&](const std::string& doubt) {
    return std::ranges::any_of(verdict.problems, [&](const Problem& problem) {
      return doubt.find(problem.what) != std::string::npos ||
             problem.text().find(doubt) != std::string::npos;
    });
  };
  std::ranges::copy_if(data.doubts, std::back_inserter(verdict.remarks), std::not_fn(is_known));
  judge_runs(data, verdict.remarks);
  if (data.model) judge_modes(data, verdict.remarks);

  if (!trustworthy) {
    verdict.level = Verdict::Level::bad;
    verdict.text = "Not to be trusted";
  } else if (!verdict.problems.empty() || !verdict.remarks.empty()) {
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

Json verdict_json(const Verdict& verdict) {
  Json json = {{"level", to_string(verdict.level)}, {"text", verdict.text}};
  json.update(head_json(verdict.problems));
  for (const std::string& remark : verdict.remarks) json["reasons"].push_back(remark);
  return json;
}

}  // namespace stageid
