#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "acquisition/files/file_error.hpp"
#include "frf/plant/plant_frf.hpp"
#include "tests/support/process/error_message.hpp"
#include "tests/support/stages/closed_loop.hpp"

namespace stageid::test_plant_frf_errors {

using test::LoopExperiment;
using test::MemoryLog;
using testing::HasSubstr;

template <typename Error = std::invalid_argument>
std::string message_of(const std::vector<const LogReader*>& logs, const FrfOptions& options = {}) {
  return test::error_message<Error>([&] { estimate_plant_frf(logs, options); });
}

/// Expects an error whose message contains all these texts.
template <typename Error = std::invalid_argument>
void expect_refused(const std::vector<const LogReader*>& logs, const FrfOptions& options,
                    const std::vector<std::string>& texts) {
  const std::string message = message_of<Error>(logs, options);
  for (const std::string& text : texts) EXPECT_THAT(message, HasSubstr(text));
}

MemoryLog small_log(const LoopExperiment& x = {}) {
  return test::simulate_log(test::small_stage(), x);
}

TEST(PlantFrfErrors, TooLittleDataForTheMethod) {
  expect_refused({}, {}, {"no log given"});
  const FrfOptions lpm{.transient_periods = 1, .method = FrfMethod::lpm};
  MemoryLog log = small_log({.lines = {1, 2, 3, 4, 5, 6, 8}, .periods = 1});
  expect_refused({&log}, lpm, {"memory.slog:/runs/0000", "Excite only odd lines"});
  log = small_log({.period_samples = 16, .lines = {1, 3, 5}, .periods = 1});
  expect_refused({&log}, lpm, {"needs 16 bins", "of 1 period has 4"});
  log = small_log({.periods = 1});
  expect_refused({&log}, {.covariance = CovarianceKind::full}, {"needs two clean periods"});
}

TEST(PlantFrfErrors, UnknownChannels) {
  const MemoryLog log = small_log();
  expect_refused({&log}, {.inputs = {"a1", "b7"}}, {"unknown actuator 'b7'", "a1, a2, a3"});
  expect_refused({&log}, {.outputs = {"q"}}, {"unknown sensor 'q'", "z1, z2"});
  expect_refused({&log}, {.outputs = {"z1", "z1"}}, {"duplicate channel"});
}

TEST(PlantFrfErrors, MissingExperiments) {
  MemoryLog log = small_log({.realizations = 2});
  expect_refused({&log}, {.realizations = {0, 7}},
                 {"realization 8 has no complete run; those with one are 1, 2"});
  log.log_runs[5].complete = false;
  expect_refused({&log}, {.realizations = {0, 1}},
                 {"3 excited axes but only 2 experiments in realization 2 (counted from 1)"});
  log.log_runs[5].complete = true;
  log.log_runs[2].complete = log.log_runs[4].complete = false;
  expect_refused({&log}, {},
                 {"realization 1 (counted from 1) has 2 of 3 experiments", "name the inputs"});
  EXPECT_EQ(message_of({&log}, {.inputs = {"a1", "a2"}, .realizations = {0}}), "no error");
  expect_refused({&log}, {.inputs = {"a1", "a2", "a3"}, .realizations = {0}},
                 {"3 inputs but only 2 experiments in realization 1 (counted from 1)"});
  for (LogRun& run : log.log_runs) run.complete = false;
  expect_refused({&log}, {}, {"no complete run"});
}

TEST(PlantFrfErrors, OtherNumbersOfInputsThanTheRunsDetermine) {
  MemoryLog log = small_log({.axes = 2});
  log.log_info.excitation = test::channels("d", 3, "N");
  expect_refused({&log}, {},
                 {"3 inputs but only 2 experiments in realization 1 (counted from 1); "
                  "measure one experiment per input, or select at most 2 inputs"});
  log = small_log({.axes = 2, .experiments = 3, .scheme = test::AxisScheme::random});
  expect_refused({&log}, {.inputs = {"a1", "a2", "a3"}},
                 {"3 inputs but only 2 excited axes (a1, a2)", "select 2 inputs"});
  log = small_log();
  log.log_info.excitation = test::channels("d", 3, "N");
  log.log_info.actuators = {{"a1", "a2", "x", "w"}, {"N", "N", "N", "N"}};
  for (LogSamples& record : log.records) {
    record.actuators.conservativeResize(Eigen::NoChange, 4);
    record.actuators.col(3).setZero();
  }
  expect_refused({&log}, {.inputs = {"a1", "a2"}},
                 {"2 inputs but 3 excited axes (d1, d2, d3)", "select 3 inputs"});
}

TEST(PlantFrfErrors, LogsWithoutUsablePeriods) {
  const MemoryLog good = small_log();
  expect_refused({&good}, {.transient_periods = -1}, {"must be 0 or more"});
  expect_refused<FormatError>({&good}, {.transient_periods = 3},
                              {"3 periods recorded, 3 transient: no period remains"});
  MemoryLog log = good;
  log.log_info.period_samples = 240;
  expect_refused<FormatError>(
      {&log}, {},
      {"memory.slog:/runs/0000", "750 samples are not a whole number of periods of 240 samples"});
  log.log_info.period_samples = 0;
  expect_refused<FormatError>({&log}, {}, {"period_samples"});
  log = good;
  log.log_info.sample_rate_hz = 0.0;
  expect_refused<FormatError>({&log}, {}, {"sample_rate_hz"});
  log = good;
  log.records[1].marked[300] = log.records[1].marked[600] = 1;
  expect_refused<FormatError>({&log}, {}, {"/runs/0001", "has a marked sample"});
}

TEST(PlantFrfErrors, TheMessageDoesNotDependOnTheNumberOfThreads) {
  MemoryLog log = small_log();
  for (const std::size_t run : {1U, 2U}) log.records[run].marked.setOnes();
  EXPECT_EQ(message_of<FormatError>({&log}, {.threads = 1}),
            message_of<FormatError>({&log}, {.threads = 2}));
}

TEST(PlantFrfErrors, SingularExcitationNamesLineAndFrequency) {
  MemoryLog log = small_log({.scheme = test::AxisScheme::random});
  // The third experiment repeats the second on line 9 (36 Hz) only.
  RealDft dft(250);
  for (Eigen::Index c = 0; c < 3; ++c) {
    const auto spectrum = [&](std::size_t run) -> Eigen::VectorXcd {
      const auto values = dft.forward(log.excitation_periods[run].col(c));
      return Eigen::Map<const Eigen::VectorXcd>(values.data(), dft.half_size()) / 250.0;
    };
    Eigen::VectorXcd third = spectrum(2);
    third[9] = spectrum(1)[9];
    log.excitation_periods[2].col(c) = dft.inverse(third);
  }
  expect_refused(
      {&log}, {},
      {"singular excitation in realization 1 (counted from 1), line 9 (36 Hz)", "orthogonal"});
  log = small_log();
  for (LogSamples& record : log.records) record.actuators.col(2) = record.actuators.col(1);
  expect_refused({&log}, {}, {"singular inputs in realization 1 (counted from 1), line 1 (4 Hz)"});
}

TEST(PlantFrfErrors, ExcitationsThatDoNotBelongTogether) {
  MemoryLog log = small_log({.realizations = 2});
  log.excitation_periods[4] =
      small_log({.lines = {1, 3, 5, 7, 9, 13, 21, 35, 51, 77}}).excitation_periods[1];
  expect_refused({&log}, {}, {"/runs/0004/excitation", "line 75 (300 Hz)", "same lines"});
  log = small_log({.axes = 2, .realizations = 2});
  log.excitation_periods[3].col(2) = log.excitation_periods[3].col(1);
  expect_refused({&log}, {}, {"/runs/0003/excitation", "channel a3", "same axes"});
  log = small_log();
  log.excitation_periods[1].conservativeResize(249, Eigen::NoChange);
  expect_refused({&log}, {}, {"/runs/0001/excitation", "249 samples"});
  for (Eigen::MatrixXd& period : log.excitation_periods) period.setConstant(250, 3, 0.5);
  expect_refused({&log}, {}, {"/runs/0000/excitation", "nothing is excited"});
}

TEST(PlantFrfErrors, LogsOfDifferentStages) {
  const MemoryLog first = small_log();
  MemoryLog second = first;
  second.file = "other.slog";
  second.log_info.sensors.names[0] = "y1";
  expect_refused({&first, &second}, {}, {"other.slog", "sensor channels", "memory.slog"});
  second = first;
  second.log_info.sample_rate_hz = 2000.0;
  expect_refused({&first, &second}, {}, {"different sample rate"});
}

}  // namespace stageid::test_plant_frf_errors
