#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tools/report/report_input.hpp"
#include "tools/report/report_page.hpp"
#include "tools/workbench/fit_history.hpp"

namespace stageid {

/// A result for comparison as the page needs it: encoded once, shown with any model.
struct Compared {
  ReportComparison result;
  std::string response;  ///< encoded as other_response; empty: none
  std::string model_response;
};

/// What the page of the workbench shows: that of the report, with a model that changes.
class WorkbenchPage {
 public:
  /// @param data of the report with an FRF and all its lines; its model is not used
  explicit WorkbenchPage(ReportData data);

  /// @throws as report::make_comparison()
  std::shared_ptr<const Compared> compared(ComparedResult result);

  /// The page without a model.
  std::string html() const;

  /// The results of a state as JSON: {"stage", "content": as of a report without response, "arrays", "blocks": base64 by
  /// name: model_response, other_response, other_model, "trends": one report::comparison_json() per entry of `all`}.
  /// @param all results that are compared
  /// @param chosen index of the one whose curves are shown; empty: none
  std::string results(const FitState& state,
                      const std::vector<std::shared_ptr<const Compared>>& all,
                      std::optional<std::size_t> chosen) const;

  const FrfEstimate& frf() const noexcept { return *data_.frf; }

 private:
  ReportData data_;   ///< without model
  ReportData light_;  ///< the same without responses
};

}  // namespace stageid
