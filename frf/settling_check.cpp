#include "frf/settling_check.hpp"

#include <fmt/format.h>

namespace stageid {

std::vector<Finding> check_settling(const FrfEstimate& frf) {
  const NonlinearityTest& test = frf.nonlinearity;
  std::string figure;
  for (Eigen::Index b = 0; b < test.band_hz.rows(); ++b) {
    if (test.settled(b)) continue;
    figure += fmt::format("{}{:.4g} ... {:.4g} Hz: p = {:.0e}", figure.empty() ? "" : ", ",
                          test.band_hz(b, 0), test.band_hz(b, 1), test.settled_p_value[b]);
  }
  if (figure.empty()) return {};
  Finding finding;
  finding.severity = Severity::doubt;
  finding.cause = Cause::unsettled;
  finding.what =
      "the records are not settled: a transient or a drift, which is smooth over the lines";
  finding.figure = figure;
  finding.remedy =
      "pass over more periods (--transient-periods), or model it (--method lpm); linearity cannot "
      "be told there";
  return {finding};
}

}  // namespace stageid
