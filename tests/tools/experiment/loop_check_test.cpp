#include "tools/experiment/loop_check.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "frf/file/frf_file.hpp"
#include "hal/simulator/loop_stability.hpp"
#include "tests/support/process/temporary_directory.hpp"
#include "tests/tools/experiment/exact_pilot.hpp"

namespace stageid::test_loop_check {

StageConfig with_gain(StageConfig stage, double factor) {
  for (AxisController& axis : stage.spec.controller.axes) axis.gain *= factor;
  return stage;
}

struct LoopCheckTest : testing::Test {
  LoopCheckTest()
      : config_(load_experiment_config(std::filesystem::path(STAGEID_SOURCE_DIR) /
                                       "configs/experiment/small_stage_limits.yaml")) {
    config_.limits->prior = directory_ / "pilot.h5";
    write_frf(config_.limits->prior,
              test::exact_pilot(config_.stage, Eigen::VectorXd::LinSpaced(474, 4.0, 950.0)));
  }
  const test::TemporaryDirectory directory_;
  ExperimentConfig config_;
};

// Two methods with the same verdict: the eigenvalues of the configured plant, and the encirclements of the response
// measured by a pilot.
TEST_F(LoopCheckTest, APriorAndThePlantItselfAgree) {
  const StageConfig stage = config_.stage;
  int stable = 0;
  int unstable = 0;
  for (const double factor : {0.3, 1.0, 2.0, 3.0, 5.0, 10.0, 30.0, -1.0}) {
    config_.stage = with_gain(stage, factor);
    const bool holds = loop_stability(config_.stage.spec, config_.stage.plant.value()).stable();
    const LoopCheck of_prior = check_loop(config_);
    ++(holds ? stable : unstable);
    if (of_prior.doubt.empty() || holds) {
      EXPECT_EQ(of_prior.problem.empty(), holds) << factor << " " << of_prior.problem;
    }
    EXPECT_EQ(check_loop(config_.stage).problem.empty(), holds) << factor;
  }
  EXPECT_GE(stable, 2);
  EXPECT_GE(unstable, 2);
}

TEST_F(LoopCheckTest, ALittleMarginIsADoubt) {
  const StageConfig stage = config_.stage;
  bool doubted = false;
  for (double factor = 1.0; factor < 30.0; factor *= 1.1) {
    const LoopCheck check = check_loop(with_gain(stage, factor));
    if (!check.problem.empty()) break;
    doubted = !check.doubt.empty();
    EXPECT_EQ(doubted, check.largest_sensitivity > 3.0) << factor;
  }
  EXPECT_TRUE(doubted) << "the loop became unstable without a doubt before";
  EXPECT_THAT(check_loop(stage).doubt, testing::IsEmpty());
}

}  // namespace stageid::test_loop_check
