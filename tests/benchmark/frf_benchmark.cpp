// One estimate at the paper's shape, from memory: 13 axes, 17 actuators and 7 sensors, periods of
// 40 000 samples, 4000 odd lines. bytes_per_second is what the log holds of the periods used, as
// float64.
#include <benchmark/benchmark.h>

#include "frf/plant_frf.hpp"
#include "tests/support/closed_loop.hpp"

namespace stageid {
namespace {

/// Every run and period gives the same samples with a little of the run's own: nothing is
/// simulated, and one period is in memory, so what is measured is the estimate.
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
    period.col(static_cast<Eigen::Index>(run)) = wave_;
    return period;
  }
  void read(std::size_t run, std::uint64_t, std::uint64_t, LogSamples& out) const override {
    out.actuators = noise_.leftCols(17);
    out.actuators.col(static_cast<Eigen::Index>(run)) += wave_;
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

}  // namespace
}  // namespace stageid

BENCHMARK_MAIN();
