// An excitation that was recorded late: the channels and the response are right.
#include "frf/wiring/excitation_timing.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "frf/health/data_health.hpp"
#include "frf/plant/plant_frf.hpp"
#include "tests/support/logs/told_findings.hpp"
#include "tests/support/stages/sampled_loop.hpp"

namespace stageid::test_excitation_timing {

using Eigen::Index;
using test::MemoryLog;

struct Case {
  explicit Case(std::uint64_t seed) {
    test::LoopExperiment x{.sample_rate_hz = 2000.0, .period_samples = 2000, .axes = 2};
    x.lines = test::line_range(3, 801, 2);
    x.periods = 3;
    x.seed = seed;
    test::ComplexNoise random(seed + 100);
    const double first_hz = 60.0 + 60.0 * random.uniform();
    plant = test::sampled_plant(2, 2, {{first_hz, 0.05}, {2.1 * first_hz, 0.04}}, x.sample_rate_hz,
                                0.3);
    log = test::simulate_sampled_log(plant, x, 1e-4);
    nominal.actuators = log.log_info.actuators.names;
    nominal.sensors = log.log_info.sensors.names;
    nominal.controller = [K = plant.K](double) {
      return Eigen::MatrixXcd(-K.cast<std::complex<double>>());
    };
    nominal.rigid_body = [](double) { return Eigen::MatrixXcd(Eigen::MatrixXcd::Identity(2, 2)); };
    nominal.free_from_hz = 1e9;
  }
  void delay_excitation(Index samples) {
    const Index N = log.log_info.period_samples;
    for (Eigen::MatrixXd& r : log.excitation_periods) {
      const Eigen::MatrixXd true_r = r;
      for (Index n = 0; n < N; ++n) r.row(n) = true_r.row((n - samples + N) % N);
    }
  }
  test::SampledPlant plant;
  MemoryLog log;
  NominalStage nominal;
};

TEST(ExcitationTiming, IsRightOnCleanLogs) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    Case c(seed);
    HealthRecord record = read_health_record({&c.log}, {});
    EXPECT_FALSE(align_excitation(record, std::nullopt)) << seed;
    EXPECT_FALSE(align_excitation(record, c.nominal)) << seed;
  }
}

TEST(ExcitationTiming, WholeSamplesAreFoundWithAndWithoutTheController) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    for (const int samples : {1, 2, -1, 40}) {
      Case c(seed);
      const FrfEstimate before = estimate_plant_frf({&c.log});
      c.delay_excitation(samples);
      for (const bool known : {false, true}) {
        HealthRecord record = read_health_record({&c.log}, {});
        const auto delay =
            align_excitation(record, known ? std::optional<NominalStage>(c.nominal) : std::nullopt);
        ASSERT_TRUE(delay) << seed << " " << samples << " " << known;
        EXPECT_EQ(delay->samples, samples);
        EXPECT_EQ(delay->certain, known);
        EXPECT_EQ(to_finding(*delay).severity, Severity::doubt);
      }
      // The finding's statement about the response is true.
      const FrfEstimate after = estimate_plant_frf({&c.log});
      EXPECT_LT((after.response - before.response).cwiseAbs().maxCoeff(),
                1e-9 * before.response.cwiseAbs().maxCoeff());
    }
  }
}

TEST(ExcitationTiming, BlamesNoChannel) {
  Case c(5);
  c.delay_excitation(1);
  const std::vector<Finding> findings =
      test::told(check_health(read_health_record({&c.log}, {}), c.nominal));
  ASSERT_FALSE(findings.empty());
  EXPECT_EQ(findings.front().cause, Cause::excitation_timing);
  for (const Finding& f : findings) EXPECT_NE(f.cause, Cause::skew) << f.channel << " " << f.what;
}

// In this case the excitation is right and the response is wrong.
TEST(ExcitationTiming, ActuatorsThatAreLateAreNotTakenForIt) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Case c(seed);
    const Index N = c.log.log_info.period_samples;
    for (LogSamples& record : c.log.records) {
      const Eigen::MatrixXd u = record.actuators;
      for (Index n = N; n < u.rows(); ++n) record.actuators.row(n) = u.row(n - 1);
    }
    HealthRecord record = read_health_record({&c.log}, {});
    EXPECT_FALSE(align_excitation(record, c.nominal)) << seed;
  }
}

}  // namespace stageid::test_excitation_timing
