// Cost of the log, the loop and a simulated stage, relative to memcpy on the same machine in the same run, because on a
// shared machine only the ratios can be compared from day to day.

#include <benchmark/benchmark.h>

#include <cstring>
#include <ctime>
#include <vector>

#include "acquisition/loop/measurement_loop.hpp"
#include "acquisition/record/row_transpose.hpp"
#include "acquisition/slog/crc32c.hpp"
#include "acquisition/slog/slog_reader.hpp"
#include "acquisition/slog/slog_writer.hpp"
#include "hal/simulator/modal_plant.hpp"
#include "hal/simulator/noise.hpp"
#include "hal/stage/limited_stage.hpp"
#include "hal/stage/motion_controller.hpp"
#include "tests/support/logs/memory_log.hpp"
#include "tests/support/process/temporary_directory.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace stageid {
namespace {

// The wafer stage: 17 actuators, 7 sensors, periods of 40 000 samples.
constexpr std::size_t kActuators = 17;
constexpr std::size_t kSensors = 7;
constexpr std::size_t kWords = kActuators + kSensors + 1;
constexpr int kPeriod = 40'000;
constexpr std::size_t kBlockRows = 2048;
constexpr std::uint64_t kRows = 20 * kPeriod;

/// Time that this thread has had a processor: others may be at work on this machine.
double processor_seconds() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Bytes a second of memcpy between two buffers larger than the caches.
double memcpy_rate() {
  static const double rate = [] {
    std::vector<char> from(std::size_t{1} << 27, 1);
    std::vector<char> to(from.size(), 2);
    double best = 0.0;
    for (int repeat = 0; repeat < 10; ++repeat) {
      const double start = processor_seconds();
      std::memcpy(to.data(), from.data(), from.size());
      benchmark::DoNotOptimize(to.data());
      best = std::max(best, static_cast<double>(from.size()) / (processor_seconds() - start));
    }
    return best;
  }();
  return rate;
}

void report_bytes(benchmark::State& state, double bytes_an_iteration) {
  const double bytes = bytes_an_iteration * static_cast<double>(state.iterations());
  state.SetBytesProcessed(static_cast<std::int64_t>(bytes));
  state.counters["of_memcpy"] =
      benchmark::Counter(bytes / memcpy_rate(), benchmark::Counter::kIsRate);
}

LogInfo info_of_stage() {
  LogInfo info;
  info.sample_rate_hz = 10'000.0;
  info.period_samples = kPeriod;
  info.excitation = test::channels("a", 1, "N");
  info.actuators = test::channels("a", kActuators, "N");
  info.sensors = test::channels("s", kSensors, "m");
  return info;
}

std::vector<double> some_rows(std::size_t rows) {
  std::vector<double> words(rows * kWords, 0.0);
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (i % kWords != kWords - 1) words[i] = 1.0 / static_cast<double>(i + 1);
  }
  return words;
}

void write_log(const std::filesystem::path& file) {
  SlogWriter log = SlogWriter::create(file, info_of_stage());
  log.begin_run({}, Eigen::MatrixXd::Ones(kPeriod, 1));
  const std::vector<double> block = some_rows(kBlockRows);
  std::uint64_t left = kRows;
  while (left > 0) {
    const std::uint64_t rows = std::min<std::uint64_t>(left, kBlockRows);
    log.write(std::span(block).first(rows * kWords));
    left -= rows;
  }
  log.end_run({});
  log.close(0, "");
}

void Memcpy(benchmark::State& state) {
  std::vector<char> from(std::size_t{1} << 27, 1);
  std::vector<char> to(from.size(), 2);
  for (auto _ : state) {
    std::memcpy(to.data(), from.data(), from.size());
    benchmark::DoNotOptimize(to.data());
  }
  report_bytes(state, static_cast<double>(from.size()));
}
BENCHMARK(Memcpy)->Unit(benchmark::kMillisecond);

template <std::uint32_t (*function)(std::span<const std::byte>, std::uint32_t) noexcept>
void Crc(benchmark::State& state) {
  const std::vector<std::byte> bytes(std::size_t{1} << 17, std::byte{5});
  for (auto _ : state) benchmark::DoNotOptimize(function(bytes, 0));
  report_bytes(state, static_cast<double>(bytes.size()));
}
BENCHMARK(Crc<crc32c>)->Name("Crc32c/128kB");
BENCHMARK(Crc<crc32c_portable>)->Name("Crc32cPortable/128kB");

void Transpose(benchmark::State& state) {
  const std::vector<double> rows = some_rows(640);
  std::vector<double> columns((kWords - 1) * kPeriod);
  std::size_t at = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        transpose_rows(rows.data(), kWords, 640, kWords - 1, columns.data() + at, kPeriod));
    at = at + 2 * 640 > kPeriod ? 0 : at + 640;
  }
  report_bytes(state, static_cast<double>(rows.size() * sizeof(double)));
}
BENCHMARK(Transpose);

/// One period after another from page cache, checked and transposed; threads share the reader.
void ReadPeriods(benchmark::State& state) {
  static const test::TemporaryDirectory directory;
  static const std::filesystem::path file = directory / "a.slog";
  static const bool written = (write_log(file), true);
  static const SlogReader reader(file);
  benchmark::DoNotOptimize(written);
  LogSamples samples;
  std::uint64_t first = static_cast<std::uint64_t>(state.thread_index()) * kPeriod;
  for (auto _ : state) {
    reader.read(0, first, kPeriod, samples);
    benchmark::DoNotOptimize(samples.actuators.data());
    first = (first + kPeriod) % kRows;
  }
  report_bytes(state, static_cast<double>(kPeriod * kWords * sizeof(double)));
}
BENCHMARK(ReadPeriods)->Unit(benchmark::kMillisecond)->ThreadRange(1, 2);

void Open(benchmark::State& state) {
  const test::TemporaryDirectory directory;
  write_log(directory / "a.slog");
  for (auto _ : state) benchmark::DoNotOptimize(SlogReader(directory / "a.slog"));
}
BENCHMARK(Open)->Unit(benchmark::kMicrosecond);

void WriteBlocks(benchmark::State& state) {
  const test::TemporaryDirectory directory(std::filesystem::temp_directory_path());
  SlogWriter log = SlogWriter::create(directory / "a.slog", info_of_stage());
  log.begin_run({}, Eigen::MatrixXd::Ones(kPeriod, 1));
  const std::vector<double> block = some_rows(kBlockRows);
  for (auto _ : state) log.write(block);
  report_bytes(state, static_cast<double>(block.size() * sizeof(double)));
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * kBlockRows));
}
BENCHMARK(WriteBlocks)->Unit(benchmark::kMicrosecond)->Iterations(2000);

/// The yardstick on a shared machine: the loop is compared with it in the same run.
void MatrixTimesVector(benchmark::State& state) {
  const Eigen::MatrixXd a = Eigen::MatrixXd::Constant(32, 32, 0.03);
  Eigen::VectorXd x = Eigen::VectorXd::Ones(32);
  Eigen::VectorXd y(32);
  for (auto _ : state) {
    y.noalias() = a * x;
    benchmark::DoNotOptimize(y.data());
    benchmark::ClobberMemory();
  }
}
BENCHMARK(MatrixTimesVector);

/// Does nothing, at once.
class IdleStage final : public CyclicStage {
 public:
  explicit IdleStage(Clock clock = Clock::virtual_time, bool stamps = false) {
    info_.clock = clock;
    info_.stamps = stamps;
    info_.sample_rate_hz = 10'000.0;
    info_.actuators.resize(kActuators);
    info_.sensors.resize(kSensors);
  }
  const StageInfo& info() const noexcept override { return info_; }
  void start(std::uint64_t, Inputs& first) override {
    for (double& y : first.y) y = 0.0;
    first.valid = ~std::uint64_t{0};
  }
  [[nodiscard]] Outcome exchange(const Outputs& outputs, Inputs& inputs,
                                 Deadline) noexcept override {
    inputs.y[0] = 1e-6 * outputs.u[0];
    if (info_.stamps) {
      inputs.t_sample_ns = static_cast<std::int64_t>(outputs.cycle + 1) * 100'000;
      inputs.t_arrival_ns = inputs.stamp_ns = inputs.t_sample_ns + 7'000;
    }
    return Outcome::ok;
  }
  void stop() noexcept override {}

 private:
  StageInfo info_;
};

/// The smallest controller there is: one axis.
MotionController small_controller() {
  MotionControllerSpec spec;
  spec.sample_rate_hz = 10'000.0;
  spec.sensor_decoupling = Eigen::MatrixXd::Zero(1, kSensors);
  spec.actuator_decoupling = Eigen::MatrixXd::Zero(kActuators, 1);
  spec.axes.resize(1);
  return MotionController(spec);
}

void Controller(benchmark::State& state) {
  MotionController controller = small_controller();
  const std::vector<double> y(kSensors, 0.0);
  std::vector<double> u(kActuators, 0.0);
  for (auto _ : state) {
    controller.update(y.data(), u.data());
    benchmark::DoNotOptimize(u.data());
    benchmark::ClobberMemory();
  }
}
BENCHMARK(Controller);

/// One cycle with the row taken out again by the same thread, in batches. Less Controller, this is what
/// the loop itself costs.
void step(benchmark::State& state, IdleStage stage, const LoopOptions& options, int inputs) {
  MotionController controller = small_controller();
  SampleRing ring(kWords, 4096);
  MeasurementLoop loop(stage, controller, ring, options);
  LoopExcitation excitation;
  excitation.period = Eigen::MatrixXd::Ones(kPeriod, inputs);
  for (int i = 0; i < inputs; ++i) excitation.actuators.push_back(i);
  excitation.samples = ~std::uint64_t{0} >> 1;
  loop.start(1, excitation);
  for (auto _ : state) {
    if (loop.step() == LoopStatus::ring_full) {
      ring.pop(ring.capacity_rows());
      static_cast<void>(loop.step());
    }
  }
  report_bytes(state, kWords * sizeof(double));
}
void LoopStep(benchmark::State& state) {
  step(state, IdleStage(), {}, static_cast<int>(state.range(0)));
}
BENCHMARK(LoopStep)->Arg(1)->Arg(13);

/// With the clock read twice per cycle; the second one also judges the time stamps of the samples.
void LoopStepByWallClock(benchmark::State& state) { step(state, IdleStage(Clock::wall), {}, 1); }
BENCHMARK(LoopStepByWallClock);
void LoopStepWithStamps(benchmark::State& state) {
  step(state, IdleStage(Clock::wall, true), {.jitter_s = 50e-6, .jitter_rms_s = 8e-6}, 1);
}
BENCHMARK(LoopStepWithStamps);

// Parts of a cycle of the simulated wafer stage, and the whole.

void plant_step(benchmark::State& state) {
  const test::SimulatedSpec spec = test::wafer_stage_spec();
  ModalPlant plant(plant_modes(spec.info, spec.plant), spec.info.delay_s, spec.info.sample_rate_hz);
  std::vector<double> u(17, 0.1);
  std::vector<double> y(7);
  for (auto _ : state) {
    plant.step(u.data());
    plant.output(y.data());
    benchmark::DoNotOptimize(y.data());
    benchmark::ClobberMemory();
  }
}
BENCHMARK(plant_step);

void controller_update(benchmark::State& state) {
  MotionController controller(test::wafer_stage_spec().controller);
  std::vector<double> u(17);
  std::vector<double> y(7, 1e-9);
  for (auto _ : state) {
    controller.update(y.data(), u.data());
    benchmark::DoNotOptimize(u.data());
    benchmark::ClobberMemory();
  }
}
BENCHMARK(controller_update);

void noise_sample(benchmark::State& state) {
  StageNoise noise({17, 7, 1e4, 1e-3, 1e-10, 1e-10, 20.0});
  noise.restart(1, 1);
  for (auto _ : state) {
    noise.next();
    benchmark::DoNotOptimize(noise.sensor_m());
    benchmark::ClobberMemory();
  }
}
BENCHMARK(noise_sample);

void closed_loop_cycle(benchmark::State& state, const test::SimulatedSpec& spec) {
  LimitedStage stage(test::simulated(spec), spec.limits);
  MotionController controller(spec.controller);
  std::vector<double> y(7);
  std::vector<double> u(17);
  Inputs inputs;
  inputs.y = y;
  stage.start(1, inputs);
  Outputs outputs;
  outputs.u = u;
  for (auto _ : state) {
    controller.update(y.data(), u.data());
    outputs.cycle = inputs.cycle;
    if (stage.exchange(outputs, inputs, {}) != Outcome::ok) state.SkipWithError("not ok");
  }
  state.counters["times_real_time"] =
      benchmark::Counter(static_cast<double>(state.iterations()) / spec.info.sample_rate_hz,
                         benchmark::Counter::kIsRate);
}

void limited_closed_loop_cycle(benchmark::State& state) {
  closed_loop_cycle(state, test::wafer_stage_spec());
}
BENCHMARK(limited_closed_loop_cycle);

void cycle_in_a_ramp_of_all_modes(benchmark::State& state) {
  test::SimulatedSpec spec = test::wafer_stage_spec();
  spec.simulation.faults = {{SimulationSpec::Fault::Kind::mode_frequency, -1, 0, 1, -1, 1e-3, 1e6}};
  closed_loop_cycle(state, spec);
}
BENCHMARK(cycle_in_a_ramp_of_all_modes);

}  // namespace
}  // namespace stageid

BENCHMARK_MAIN();
