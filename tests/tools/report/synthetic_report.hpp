#pragma once

#include "tools/report/report_page.hpp"

namespace stageid::test {

/// A synthetic stage of any size for the report.
struct SyntheticSize {
  Eigen::Index outputs = 4;
  Eigen::Index inputs = 13;
  Eigen::Index lines = 4000;
  int modes = 17;
  double relative_noise = 3e-3;
  int variance_dof = 0;  ///< variances are estimates of so many degrees of freedom; 0: exact
};

/// A complete report of a stage with rigid body, modes (two pairs of them close) and delay;
/// measured data are its exact response and circular noise of the variance stated. Modal sums are
/// evaluated here, without the code under test. The same size gives the same data.
ReportData synthetic_report(const SyntheticSize& size = {});

/// Share by which add_other_day() moves every natural frequency.
constexpr double kOtherDayShift = 4e-4;

/// Another day for comparison: every natural frequency higher by kOtherDayShift, the first mode gone, the
/// response 2 % smaller and with noise of its own.
void add_other_day(ReportData& data);

}  // namespace stageid::test
