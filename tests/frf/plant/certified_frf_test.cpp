// The log relative error of a frequency response whose exact value is known for these samples.

#include <gtest/gtest.h>

#include <vector>

#include "frf/plant/plant_frf.hpp"
#include "tests/support/logs/memory_log.hpp"
#include "tests/support/models/certificate.hpp"

namespace stageid::test_certified_frf {

using nlohmann::json;
using test::expect_digits;

test::MemoryLog log_of(const json& problem) {
  test::MemoryLog log;
  log.log_info.sample_rate_hz = problem["sample_rate_hz"];
  log.log_info.period_samples = problem["period_samples"];
  log.log_info.transient_periods = 0;
  log.log_info.excitation = log.log_info.actuators = test::channels("a", 2, "N");
  log.log_info.sensors = test::channels("z", 2, "m");
  for (const json& run : problem["runs"]) {
    LogSamples record;
    record.actuators = test::columns<double>(run["actuators"]).transpose();
    record.sensors = test::columns<double>(run["sensors"]).transpose();
    log.append(run["realization"], run["experiment"],
               test::columns<double>(run["excitation"]).transpose(), std::move(record));
  }
  return log;
}

template <typename Matrix>
auto all(const Matrix& values) {
  return std::vector<typename Matrix::Scalar>(values.reshaped().begin(), values.reshaped().end());
}

TEST(CertifiedFrf, ResponseAndVariances) {
  for (const json& problem : test::certificates("frf")) {
    const test::MemoryLog log = log_of(problem);
    const FrfEstimate frf = estimate_plant_frf({&log}, {.periods = PeriodChoice::unmarked});
    expect_digits(problem, "response", all(frf.response));
    expect_digits(problem, "noise_variance", all(frf.noise_variance));
    expect_digits(problem, "total_variance", all(frf.total_variance));
    expect_digits(problem, "residual_covariance", all(frf.residual_covariance));
    expect_digits(problem, "input_factor", all(frf.input_factor));
  }
}

}  // namespace stageid::test_certified_frf
