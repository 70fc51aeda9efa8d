// Constant channels: unplugged, stuck.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>

#include "frf/health/data_health.hpp"
#include "frf/plant/plant_frf.hpp"
#include "tests/support/process/error_message.hpp"
#include "tests/support/stages/closed_loop.hpp"

namespace stageid::test_constant_channel {

using test::LoopExperiment;
using test::MemoryLog;
using testing::AllOf;
using testing::HasSubstr;

MemoryLog noisy_log() {
  LoopExperiment x{.realizations = 2, .periods = 3};
  x.lines = test::line_range(1, 59, 2);
  x.noise_factor = 1e-3 * Eigen::MatrixXcd::Identity(2, 2);
  return test::simulate_log(test::small_stage(), x);
}

class ConstantSensor : public testing::TestWithParam<double> {};

// Not even rounding is taken for a response.
TEST_P(ConstantSensor, GivesAResponseOfZeroAndAFault) {
  MemoryLog log = noisy_log();
  for (LogSamples& record : log.records) record.sensors.col(1).setConstant(GetParam());
  const FrfAndHealth both = estimate_plant_frf_and_health({&log});
  EXPECT_NO_THROW(check(both.frf));
  const NonlinearityTest& test = both.frf.nonlinearity;
  for (Eigen::Index c = 1; c < both.frf.response.rows(); c += 2) {
    EXPECT_EQ(both.frf.response.row(c).cwiseAbs().maxCoeff(), 0.0);
    EXPECT_EQ(test.distortion.row(c).maxCoeff(), 0.0);
    EXPECT_EQ(test.p_value.row(c).minCoeff(), 1.0);
    EXPECT_EQ(test.odd.p_value.row(c).minCoeff(), 1.0);
    EXPECT_EQ(test.odd.level.row(c).maxCoeff(), 0.0);
  }
  EXPECT_TRUE(test.settled_p_value.allFinite());
  const std::vector<Finding> found = check_health(both.health, std::nullopt);
  ASSERT_GE(found.size(), 2U);
  EXPECT_EQ(found[0].severity, Severity::fault);
  EXPECT_EQ(found[0].cause, Cause::dead);
  EXPECT_EQ(found[0].channel, "z2");
  EXPECT_EQ(found[1].cause, Cause::unknown_stage);
}

INSTANTIATE_TEST_SUITE_P(AtZeroOrElsewhere, ConstantSensor, testing::Values(0.0, 0.3));

TEST(ConstantSensor, GivesAResponseOfZeroByWholeRecordsToo) {
  MemoryLog log = noisy_log();
  for (LogSamples& record : log.records) record.sensors.col(1).setConstant(0.3);
  const FrfEstimate frf = estimate_plant_frf({&log}, {.method = FrfMethod::lpm});
  EXPECT_NO_THROW(check(frf));
  EXPECT_EQ(frf.response.row(1).cwiseAbs().maxCoeff(), 0.0);
}

TEST(ConstantActuator, IsNamed) {
  MemoryLog log = noisy_log();
  for (LogSamples& record : log.records) record.actuators.col(2).setConstant(0.1);
  const auto named = AllOf(HasSubstr("/runs/0000/actuators"), HasSubstr("channel a3 is constant"));
  for (const FrfMethod method : {FrfMethod::periodic, FrfMethod::lpm})
    EXPECT_THAT(test::error_message<std::invalid_argument>(
                    [&] { estimate_plant_frf({&log}, {.method = method}); }),
                named);
}

}  // namespace stageid::test_constant_channel
