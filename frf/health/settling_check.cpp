#include "frf/health/settling_check.hpp"

#include <fmt/format.h>

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

}  // namespace stageid
