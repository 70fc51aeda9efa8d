#pragma once

#include <cstdint>

#include "tools/report.hpp"

namespace stageid::test {

/// A stage as the report sees it, at any size.
struct SyntheticSize {
  Eigen::Index outputs = 4;
  Eigen::Index inputs = 13;
  Eigen::Index lines = 4000;
  int modes = 17;
  double relative_noise = 3e-3;
};

/// A complete report of a stage with rigid body, modes (two pairs of them close) and delay;
/// measured data are its exact response and circular noise of the variance stated. Modal sums are
/// evaluated here, without the code under test. The same seed gives the same data.
ReportData synthetic_report(const SyntheticSize& size = {}, std::uint64_t seed = 1);

}  // namespace stageid::test
