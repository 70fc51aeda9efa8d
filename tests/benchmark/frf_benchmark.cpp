// One estimate at the paper's shape, from memory: 13 axes, 17 actuators and 7 sensors, periods of
// 40 000 samples, 4000 odd lines. bytes_per_second is what the log holds of the periods used, as
// float64.
//
// spectra_of_30_channels over fftw_alone_30_channels is the share of FFTW's own rate: the same
// transforms by the best plan that FFTW finds by timing, without copies, and nothing done with them.
#include <benchmark/benchmark.h>
#include <fftw3.h>

#include <numeric>

#include "frf/plant/plant_frf.hpp"
#include "frf/runs/run_steps.hpp"
#include "tests/support/stages/closed_loop.hpp"

namespace stageid {
namespace {

/// Every run and period gives the same samples plus a small part of its own. Nothing is simulated and only one period
/// is in memory, so only the estimate is measured.
class RepeatingLog : public LogReader {
 public:
  RepeatingLog(int axes, int periods) : periods_(periods) {
    constexpr int kPeriod = 40000;
    info_.sample_rate_hz = 10000.0;
    info_.period_samples = kPeriod;
    info_.transient_periods = 1;
    info_.excitation = test::channels("a", 17, "N");
    info_.actuators = test::channels("a", 17, "N");
    info_.sensors = test::channels("z", 7, "m");
    test::ComplexNoise random(1);
    std::vector<int> lines;
    for (int line = 1; line < 8000; line += 2) lines.push_back(line);
    Eigen::MatrixXcd spectrum(1, static_cast<Eigen::Index>(lines.size()));
    for (Eigen::Index k = 0; k < spectrum.cols(); ++k) spectrum(0, k) = random.phase();
    RealDft dft(kPeriod);
    wave_ = test::synthesize(spectrum, lines, dft);
    noise_ = Eigen::MatrixXd::Random(kPeriod, 24);
    for (int e = 0; e < axes; ++e) {
      LogRun run;
      run.name = std::to_string(e);
      run.experiment = e;
      run.samples = static_cast<std::uint64_t>(1 + periods) * kPeriod;
      runs_.push_back(run);
    }
  }
  const std::filesystem::path& path() const noexcept override { return path_; }
  const LogInfo& info() const noexcept override { return info_; }
  const std::vector<LogRun>& runs() const noexcept override { return runs_; }
  Eigen::MatrixXd excitation(std::size_t run) const override {
    Eigen::MatrixXd period = Eigen::MatrixXd::Zero(wave_.rows(), 17);
    period.col(run) = wave_;
    return period;
  }
  void read(std::size_t run, std::uint64_t, std::uint64_t, LogSamples& out) const override {
    out.actuators = noise_.leftCols(17);
    out.actuators.col(run) += wave_;
    out.sensors = noise_.rightCols(7);
    out.marked.setZero(wave_.rows());
  }
  double bytes() const {
    return static_cast<double>(runs_.size()) * periods_ * static_cast<double>(noise_.size()) * 8.0;
  }

 private:
  int periods_;
  std::filesystem::path path_ = "repeating.slog";
  LogInfo info_;
  std::vector<LogRun> runs_;
  Eigen::MatrixXd wave_;
  Eigen::MatrixXd noise_;
};

void estimate_plant(benchmark::State& state) {
  const RepeatingLog log(13, 10);
  FrfOptions options;
  options.outputs = {"z1", "z2", "z3", "z4"};
  options.threads = static_cast<int>(state.range(0));
  for (auto _ : state) benchmark::DoNotOptimize(estimate_plant_frf({&log}, options));
  state.SetBytesProcessed(static_cast<std::int64_t>(log.bytes()) * state.iterations());
}
BENCHMARK(estimate_plant)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();

constexpr int kChannels = 30;
constexpr int kPeriod = 40000;

void spectra_of_30_channels(benchmark::State& state) {
  const Eigen::MatrixXd samples = Eigen::MatrixXd::Random(kPeriod, kChannels);
  std::vector<Eigen::Index> channels(kChannels);
  std::iota(channels.begin(), channels.end(), Eigen::Index{0});
  std::vector<int> lines;
  for (int line = 1; line < 8000; line += 2) lines.push_back(line);
  Eigen::MatrixXcd spectra(kChannels, static_cast<Eigen::Index>(lines.size()));
  RealDft dft(kPeriod);
  for (auto _ : state) {
    line_spectra(samples, channels, lines, 0, dft, spectra);
    benchmark::DoNotOptimize(spectra.data());
  }
  state.SetItemsProcessed(state.iterations() * kChannels * kPeriod);
}
BENCHMARK(spectra_of_30_channels)->Unit(benchmark::kMillisecond)->UseRealTime();

/// Argument 0: one channel again and again, from the cache; 1: the 30 channels, from memory.
void fftw_alone_30_channels(benchmark::State& state) {
  double* in = fftw_alloc_real(static_cast<std::size_t>(kPeriod) * kChannels);
  fftw_complex* out = fftw_alloc_complex(kPeriod / 2 + 1);
  fftw_plan plan = fftw_plan_dft_r2c_1d(kPeriod, in, out, FFTW_MEASURE);
  Eigen::Map<Eigen::VectorXd>(in, Eigen::Index{kPeriod} * kChannels).setRandom();
  const std::ptrdiff_t stride = state.range(0) == 0 ? 0 : kPeriod;
  for (auto _ : state) {
    for (int c = 0; c < kChannels; ++c) fftw_execute_dft_r2c(plan, in + c * stride, out);
    benchmark::DoNotOptimize(out);
  }
  state.SetItemsProcessed(state.iterations() * kChannels * kPeriod);
  fftw_destroy_plan(plan);
  fftw_free(in);
  fftw_free(out);
}
BENCHMARK(fftw_alone_30_channels)->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace stageid

BENCHMARK_MAIN();
