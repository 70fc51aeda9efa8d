// Cost of a cycle of the whole loop at 10 kHz by the wall clock, as a share of the period: controller, limits,
// logging to a file and the simulated wafer stage.   loop_cost [SECONDS [off|try]]

#include <fmt/format.h>

#include <cstdlib>
#include <string>

#include "acquisition/loop/run_experiment.hpp"
#include "acquisition/slog/slog_writer.hpp"
#include "tests/support/process/temporary_directory.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace stageid {
namespace {

constexpr double kRate_hz = 10'000.0;
constexpr int kPeriod = 10'000;

/// One axis: a second of settling and `seconds` of measuring.
ExperimentPlan plan_of(int seconds) {
  ExperimentSpec spec;
  spec.axes = {{"z1", 2.0, {}}};
  spec.realizations = 1;
  spec.periods = seconds;
  spec.transient_periods = 1;
  spec.seed = 1;
  return {FrequencyGrid::band(kRate_hz, kPeriod, {.low_hz = 1.0, .high_hz = 2000.0}), spec};
}

void print(const char* what, const TimingHistogram& histogram) {
  fmt::print("| {} |", what);
  for (const double share : {0.5, 0.99, 0.999, 0.9999, 1.0}) {
    const double seconds = histogram.quantile_s(share);
    fmt::print(" {:.3g} us ({:.2g} %) |", 1e6 * seconds, 100.0 * seconds * kRate_hz);
  }
  fmt::print("\n");
}

int measure(int seconds, const RealTimeOptions& real_time) {
  test::SimulatedSpec spec = test::wafer_stage_spec();
  spec.pace = 1.0;
  LimitedStage stage(test::simulated(spec), spec.limits);
  MotionController controller(spec.controller);
  const ExperimentPlan plan = plan_of(seconds);
  const test::TemporaryDirectory directory(std::filesystem::temp_directory_path());
  SlogWriter log =
      SlogWriter::create(directory / "run.slog", experiment_log_info(plan, stage.info()));
  for (const std::string& missing : missing_for_real_time(real_time)) fmt::print("{}\n", missing);
  RunExperimentOptions options;
  options.real_time = real_time;
  options.misses_allowed = 1'000'000'000;
  const ExperimentResult result = run_experiment(plan, stage, controller, log, options);
  fmt::print("{}; {} cycles, {} late, {} periods skipped\n", result.message, result.health.cycles,
             result.health.late, result.timing.skipped);
  fmt::print(
      "| below | median | 99 % | 99.9 % | 99.99 % | all |\n| --- | --- | --- | --- | --- | --- "
      "|\n");
  print("execution", result.timing.execution);
  print("lateness", result.timing.lateness);
  return result.end == ExperimentEnd::complete ? 0 : 1;
}

}  // namespace
}  // namespace stageid

int main(int argc, char** argv) {
  const int seconds = argc > 1 ? std::atoi(argv[1]) : 30;
  stageid::RealTimeOptions real_time;
  if (argc < 3 || std::string(argv[2]) == "try")
    real_time.policy = stageid::RealTimePolicy::attempt;
  return stageid::measure(seconds, real_time);
}
