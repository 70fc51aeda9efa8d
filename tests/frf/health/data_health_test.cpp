#include "frf/health/data_health.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "frf/plant/plant_frf.hpp"
#include "tests/support/stages/closed_loop.hpp"

namespace stageid {
namespace data_health_test {

/// Faults of a log in which the loop moves a3, which is not excited. @param coupling from a1 and a2 to a3
std::vector<Finding> excluded(double coupling, std::uint64_t seed) {
  test::LoopExperiment x{.axes = 2, .realizations = 2, .periods = 4, .transient_periods = 0};
  x.seed = seed;
  test::ClosedLoop loop = test::small_stage();
  loop.controller = [weak = loop.controller, coupling](double omega_rad_s) {
    Eigen::MatrixXcd C = weak(omega_rad_s);
    C.row(2) *= coupling;
    return C;
  };
  const auto n_y = loop.plant(1.0).rows();
  x.noise_factor =
      1e-2 * loop.plant(test::omega_of(x, 5)).norm() * Eigen::MatrixXcd::Identity(n_y, n_y);
  const test::MemoryLog log = test::simulate_log(loop, x);
  std::vector<Finding> findings = check_health(estimate_plant_frf_and_health({&log}).health, {});
  std::erase_if(findings, [](const Finding& f) { return f.cause != Cause::excluded; });
  return findings;
}

// Averaged over the lines, the bias counts even where it is far below the noise of each line.
TEST(DataHealth, AnUnexcitedActuatorThatMovesMoreThanTheNoiseIsAFault) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    EXPECT_EQ(excluded(1.0, seed).size(), 1U) << seed;
    EXPECT_EQ(excluded(0.1, seed).size(), 1U) << seed;
    EXPECT_TRUE(excluded(1e-4, seed).empty()) << seed;
  }
}

}  // namespace data_health_test
}  // namespace stageid
