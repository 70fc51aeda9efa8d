#include "tools/python/simulate.hpp"

#include <fmt/format.h>
#include <sys/mman.h>

#include <cstdint>
#include <utility>

#include "tools/experiment/config_plan.hpp"
#include "tools/experiment/loop_check.hpp"
#include "tools/experiment/run_metadata.hpp"
#include "tools/measure/measured_stage.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/interrupt.hpp"

namespace stageid {
namespace {

/// Room for so many numbers, in large pages where the kernel has them: with small ones a fifth of the
/// time of a simulation goes into the first touch of its memory.
void reserve_large(std::vector<double>& numbers, std::size_t count) {
  numbers.reserve(count);
  constexpr std::uintptr_t kPage = std::uintptr_t{1} << 21;
  const auto begin = reinterpret_cast<std::uintptr_t>(numbers.data());
  const std::uintptr_t first = (begin + kPage - 1) / kPage * kPage;
  const std::uintptr_t last = (begin + count * sizeof(double)) / kPage * kPage;
  if (last > first)
    static_cast<void>(::madvise(reinterpret_cast<void*>(first), last - first, MADV_HUGEPAGE));
}

}  // namespace

RunMemory::RunMemory(LogInfo info, std::size_t runs, std::size_t samples) : info_(std::move(info)) {
  reserve_large(rows_, runs * samples * (info_.actuators.size() + info_.sensors.size() + 1));
  reserve_large(excitation_,
                runs * static_cast<std::size_t>(info_.period_samples) * info_.excitation.size());
}

void RunMemory::begin_run(const LogRun& /*run*/,
                          const Eigen::Ref<const Eigen::MatrixXd>& excitation) {
  using Rows = Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;
  const std::size_t before = excitation_.size();
  excitation_.resize(before + static_cast<std::size_t>(excitation.size()));
  Rows(excitation_.data() + before, excitation.rows(), excitation.cols()) = excitation;
}

void RunMemory::write(std::span<const double> rows) {
  rows_.insert(rows_.end(), rows.begin(), rows.end());
}

SimulatedExperiment simulate_experiment(const std::filesystem::path& file) {
  const ExperimentConfig config = load_experiment_config(file);
  require_stable_loop(config, Console());
  const ExperimentPlan plan = make_plan(config);
  MeasurementRequest request;
  request.pace = 0.0;
  const std::unique_ptr<MeasuredStage> stage = make_measured_stage(config, plan, request, {});

  SimulatedExperiment out;
  out.name = file.filename();
  out.realizations = plan.spec().realizations;
  out.experiments = plan.experiments();
  out.samples = static_cast<std::size_t>(plan.samples_per_run());
  const StageInfo& info = stage->info();
  out.runs = std::make_unique<RunMemory>(
      experiment_log_info(plan, info, run_metadata(config, request.backend, info)),
      plan.runs().size(), out.samples);
  RunExperimentOptions options;
  options.interrupt = &interrupt_flag();
  options.misses_allowed = config.stage.real_time.misses_allowed;
  options.ramp_s = config.stage.ramp_s;
  const ExperimentResult result = stage->perform(*out.runs, options);
  if (result.end == ExperimentEnd::interrupted) throw Interrupted();
  if (result.end != ExperimentEnd::complete)
    throw StageError(fmt::format("{}: {}", file.string(), result.message));
  return out;
}

}  // namespace stageid
