#include "frf/health/settling_check.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace stageid {

std::vector<Finding> check_settling(const FrfEstimate& frf) {
  const NonlinearityTest& test = frf.nonlinearity;
  if (test.settled_p_value.size() == 0) return {};
  // The limit is divided by the number of bands (Bonferroni); otherwise, many bands would cause false alarms.
  const auto bands = static_cast<double>(test.settled_p_value.size());
  if (bands * test.settled_p_value.minCoeff() >= kUnsettledBelow) return {};
  std::string figure;
  for (Eigen::Index b = 0; b < test.band_hz.rows(); ++b) {
    if (test.settled(b)) continue;
    figure += fmt::format("{}{:.4g} ... {:.4g} Hz: p = {:.0e}", figure.empty() ? "" : ", ",
                          test.band_hz(b, 0), test.band_hz(b, 1), test.settled_p_value[b]);
  }
  Finding finding;
  finding.severity = Severity::doubt;
  finding.cause = Cause::unsettled;
  finding.what = "the records are not settled: they contain a transient, a drift or slow noise";
  finding.figure = figure;
  finding.remedy = fmt::format("{}; linearity cannot be tested in these bands", kUnsettledRemedy);
  return {finding};
}

int runs_with_discarded_start(const FrfEstimate& frf) {
  const auto starts = static_cast<int>(
      std::count_if(frf.dropped_periods.begin(), frf.dropped_periods.end(),
                    [](const DroppedPeriod& dropped) { return dropped.period == 0; }));
  const bool most_runs = starts > 1 && 2 * starts > frf.realizations * frf.experiments;
  return most_runs && 2 * starts > static_cast<int>(frf.dropped_periods.size()) ? starts : 0;
}

std::vector<Finding> check_discarded_starts(const FrfEstimate& frf) {
  const int starts = runs_with_discarded_start(frf);
  if (starts == 0) return {};
  Finding finding;
  finding.severity = Severity::doubt;
  finding.cause = Cause::unsettled;
  finding.what =
      "not settled: the first used period of most runs differs from the later ones and was "
      "discarded; the transient of the start is not over";
  finding.figure = fmt::format("{} of {} runs", starts, frf.realizations * frf.experiments);
  finding.remedy = "increase --transient-periods by one, or use --method lpm";
  return {finding};
}

void withdraw_linearity_test(FrfEstimate& frf, const std::vector<Finding>& findings) {
  const bool explained = std::any_of(findings.begin(), findings.end(), [](const Finding& finding) {
    return finding.cause == Cause::drift || finding.cause == Cause::unsettled ||
           (finding.severity == Severity::fault && !finding.realizations.empty());
  });
  NonlinearityTest& test = frf.nonlinearity;
  if (!explained || test.band_hz.rows() == 0) return;
  test.settled_p_value.setZero(test.band_hz.rows());
  for (Eigen::MatrixXd* p : {&test.p_value, &test.even.p_value, &test.odd.p_value}) p->setOnes();
}

}  // namespace stageid
