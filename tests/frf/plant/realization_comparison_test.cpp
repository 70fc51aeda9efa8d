// A channel that is recorded differently in one realization only.
#include "frf/plant/realization_comparison.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "frf/health/data_health.hpp"
#include "frf/plant/plant_frf.hpp"
#include "tests/support/logs/told_findings.hpp"
#include "tests/support/stages/sampled_loop.hpp"

namespace stageid::test_realization_comparison {

using test::MemoryLog;
using test::record_realizations;
using test::text;
using testing::HasSubstr;

/// Changes the records of one realization, counted from 0.
void change(MemoryLog& log, int realization, const std::function<void(LogSamples&)>& by) {
  for (std::size_t run = 0; run < log.records.size(); ++run)
    if (log.log_runs[run].realization == realization) by(log.records[run]);
}

/// Records channel c `by` samples late.
void late(Eigen::MatrixXd& samples, Eigen::Index c, Eigen::Index by = 1) {
  const Eigen::VectorXd before = samples.col(c);
  samples.col(c).tail(before.size() - by) = before.head(before.size() - by);
}

std::vector<Finding> told(const MemoryLog& log) {
  return test::told(check_health(estimate_plant_frf_and_health({&log}).health, std::nullopt));
}

TEST(RealizationComparison, FindsNothingInCleanAndDistortedLogs) {
  for (std::uint64_t seed = 1; seed <= 15; ++seed)
    for (const int realizations : {2, 3, 5})
      for (const double cubic : {0.0, 1e-2}) {
        const MemoryLog log = record_realizations({realizations, seed, 1e-5, cubic});
        const std::vector<Finding> findings = told(log);
        EXPECT_TRUE(findings.empty()) << seed << " " << realizations << "\n" << text(findings);
      }
}

// Motion of the stage itself disturbs the lowest lines, where the response is largest, by far more than the noise.
TEST(RealizationComparison, ADisturbanceOfAFewLinesIsNoScale) {
  constexpr Eigen::Index kLines = 100;
  FrfEstimate frf;
  frf.frequency_hz = Eigen::VectorXd::LinSpaced(kLines, 1.0, 100.0);
  frf.outputs.names = {"y1", "y2"};
  frf.inputs.names = {"u1", "u2"};
  frf.sample_rate_hz = 1000.0;
  frf.response.resize(4, kLines);
  for (Eigen::Index k = 0; k < kLines; ++k)
    frf.response.col(k).setConstant(1.0 / (frf.frequency_hz[k] * frf.frequency_hz[k]));
  frf.noise_variance = Eigen::MatrixXd::Constant(4, kLines, 1e-10);
  RealizationComparison comparison(2, 2, kLines);
  for (int m = 0; m < 2; ++m) {
    comparison.begin(m);
    for (Eigen::Index k = 0; k < kLines; ++k)
      comparison.add((m == 1 && k == 0 ? 3.0 : 1.0) * frf.response.col(k).reshaped(2, 2), k);
  }
  const RealizationDifferences found = comparison.find(frf);
  EXPECT_TRUE(found.changes.empty()) << found.changes.front().channel;
  EXPECT_EQ(found.outlying, std::vector<int>{1});
}

TEST(RealizationComparison, NamesTheChannelTheChangeAndTheRealization) {
  struct Fault {
    std::function<void(LogSamples&)> by;
    Cause cause;
    const char* channel;
    double value;  // factor or us; 0: none
  };
  const std::vector<Fault> faults = {
      {[](LogSamples& s) { s.sensors.col(1) *= 1.05; }, Cause::scale, "z2", 1.05},
      {[](LogSamples& s) { s.sensors.col(1) *= 2.36; }, Cause::scale, "z2", 2.36},
      {[](LogSamples& s) { s.sensors.col(2) *= -1.0; }, Cause::sign, "z3", -1.0},
      {[](LogSamples& s) { s.actuators.col(0) *= 1.2; }, Cause::scale, "a1", 1.2},
      {[](LogSamples& s) { late(s.sensors, 0); }, Cause::skew, "z1", 500.0},
      {[](LogSamples& s) { late(s.actuators, 1); }, Cause::skew, "a2", 500.0},
      {[](LogSamples& s) { s.sensors.col(0).swap(s.sensors.col(2)); }, Cause::swapped, "z1 z3", 0},
      {[](LogSamples& s) { s.actuators.col(0).swap(s.actuators.col(1)); }, Cause::swapped, "a1 a2",
       0}};
  for (std::size_t f = 0; f < faults.size(); ++f)
    for (const int realizations : {3, 4})
      for (const int wrong : {0, 2})
        for (std::uint64_t seed = 1; seed <= 3; ++seed) {
          MemoryLog log = record_realizations({realizations, seed});
          change(log, wrong, faults[f].by);
          const std::vector<Finding> findings = told(log);
          ASSERT_EQ(findings.size(), 1U) << f << " " << seed << "\n" << text(findings);
          EXPECT_EQ(findings[0].severity, Severity::fault);
          EXPECT_EQ(findings[0].cause, faults[f].cause) << f;
          EXPECT_EQ(findings[0].channel, faults[f].channel) << f;
          EXPECT_EQ(findings[0].realizations, std::vector<int>{wrong}) << f;
          EXPECT_THAT(findings[0].what, HasSubstr("realization " + std::to_string(wrong + 1)));
          if (faults[f].value == 0.0) continue;
          const std::size_t at = findings[0].figure.find_first_of("-0123456789");
          EXPECT_NEAR(std::stod(findings[0].figure.substr(at)), faults[f].value,
                      0.02 * std::abs(faults[f].value))
              << f;
        }
}

// The first change of a channel is found while those of the others still bias it.
TEST(RealizationComparison, AChannelIsToldOnceIfSeveralAreChanged) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    MemoryLog log = record_realizations({4, seed});
    change(log, 1, [](LogSamples& s) {
      late(s.sensors, 0, 2);
      late(s.sensors, 1, 1);
      late(s.actuators, 0, 1);
    });
    std::vector<std::string> channels;
    for (const RealizationChange& one :
         estimate_plant_frf_and_health({&log}).health.differences.changes) {
      EXPECT_EQ(std::count(channels.begin(), channels.end(), one.channel), 0)
          << one.channel << " " << seed;
      EXPECT_TRUE(one.kind != RealizationChange::Kind::skew || std::abs(one.value) > 1e-4)
          << one.channel << " " << one.value;
      channels.push_back(one.channel);
    }
    EXPECT_FALSE(channels.empty());
  }
}

TEST(RealizationComparison, OfTwoRealizationsEitherMayBeWrong) {
  MemoryLog log = record_realizations({2, 5});
  change(log, 1, [](LogSamples& s) { s.sensors.col(1) *= 2.0; });
  const std::vector<Finding> findings = told(log);
  ASSERT_EQ(findings.size(), 1U) << text(findings);
  EXPECT_THAT(findings[0].what, HasSubstr("in realization 2 than in realization 1, one of which"));
  EXPECT_EQ(findings[0].realizations, (std::vector<int>{0, 1}));
}

}  // namespace stageid::test_realization_comparison
