#include "tools/python/simulate.hpp"

#include <fmt/format.h>
#include <sys/mman.h>

#include <bit>
#include <cstdint>
#include <utility>
#include <vector>

#include "acquisition/record/run_writer.hpp"
#include "acquisition/slog/slog_format.hpp"
#include "tools/experiment/config_plan.hpp"
#include "tools/experiment/loop_check.hpp"
#include "tools/experiment/run_metadata.hpp"
#include "tools/measure/measured_stage.hpp"
#include "tools/python/array_log.hpp"
#include "tools/python/interruptible.hpp"
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

/// All runs of an experiment in contiguous memory.
class RunMemory final : public RunWriter {
 public:
  RunMemory(LogInfo info, const ExperimentPlan& plan)
      : realizations(plan.spec().realizations),
        experiments(plan.experiments()),
        samples(plan.samples_per_run()),
        info_(std::move(info)) {
    const std::size_t runs = plan.runs().size();
    reserve_large(rows, runs * static_cast<std::size_t>(samples) *
                            (info_.actuators.size() + info_.sensors.size() + 1));
    reserve_large(period,
                  runs * static_cast<std::size_t>(info_.period_samples) * info_.excitation.size());
  }

  const LogInfo& info() const noexcept override { return info_; }
  void begin_run(const LogRun& /*run*/,
                 const Eigen::Ref<const Eigen::MatrixXd>& excitation) override {
    const auto values = excitation.reshaped<Eigen::RowMajor>();
    period.insert(period.end(), values.begin(), values.end());
  }
  void write(std::span<const double> more) override {
    rows.insert(rows.end(), more.begin(), more.end());
  }
  void end_run(const LogRun& /*run*/) override {}
  void synchronize() override {}

  py::ssize_t realizations;
  py::ssize_t experiments;   ///< of each
  py::ssize_t samples;       ///< of each run
  std::vector<double> rows;  ///< actuators + sensors + status word (slog_format.hpp), run after run
  std::vector<double> period;  ///< one per run, sample by sample, run after run

 private:
  LogInfo info_;
};

std::unique_ptr<RunMemory> recorded(const std::filesystem::path& file) {
  const ExperimentConfig config = load_experiment_config(file);
  require_stable_loop(config, Console());
  const ExperimentPlan plan = make_plan(config);
  MeasurementRequest request;
  request.pace = 0.0;
  const std::unique_ptr<MeasuredStage> stage = make_measured_stage(config, plan, request, {});
  const StageInfo& info = stage->info();
  auto memory = std::make_unique<RunMemory>(
      experiment_log_info(plan, info, run_metadata(config, request.backend, info)), plan);
  RunExperimentOptions options;
  options.interrupt = &interrupt_flag();
  options.misses_allowed = config.stage.real_time.misses_allowed;
  options.ramp_s = config.stage.ramp_s;
  const ExperimentResult result = stage->perform(*memory, options);
  if (result.end == ExperimentEnd::interrupted) throw Interrupted();
  if (result.end != ExperimentEnd::complete)
    throw StageError(fmt::format("{}: {}", file.string(), result.message));
  return memory;
}

/// The recorded rows as arrays over the same memory.
ExperimentArrays arrays_of(std::unique_ptr<RunMemory> recording) {
  RunMemory* memory = recording.release();
  const py::capsule owner(memory, [](void* p) { delete static_cast<RunMemory*>(p); });
  const py::ssize_t M = memory->realizations, E = memory->experiments, S = memory->samples;
  const LogInfo& info = memory->info();
  const auto n_u = std::ssize(info.actuators), n_y = std::ssize(info.sensors);
  const py::ssize_t words = n_u + n_y + 1;
  const auto columns = [&](py::ssize_t first, py::ssize_t count) {
    constexpr py::ssize_t kWord = sizeof(double);
    return RealArray({M, E, S, count},
                     {E * S * words * kWord, S * words * kWord, words * kWord, kWord},
                     memory->rows.data() + first, owner);
  };
  const py::ssize_t P = info.period_samples;
  ExperimentArrays arrays{
      RealArray({M, E, P, std::ssize(info.excitation)}, memory->period.data(), owner),
      columns(0, n_u), columns(n_u, n_y), FlagArray({M, E, S})};
  std::uint8_t* marked = arrays.marked->mutable_data();
  for (py::ssize_t n = 0; n < M * E * S; ++n) {
    const double word = memory->rows[n * words + words - 1];
    marked[n] = unpack_status(std::bit_cast<std::uint64_t>(word)).marked ? 1 : 0;
  }
  return arrays;
}

}  // namespace

std::shared_ptr<LogReader> simulate(const std::filesystem::path& config) {
  std::unique_ptr<RunMemory> memory = interruptible([&] { return recorded(config); });
  LogInfo info = memory->info();
  return std::make_shared<ArrayLog>(config.filename(), std::move(info),
                                    arrays_of(std::move(memory)));
}

}  // namespace stageid
