// The estimator at the paper's size: 3960 lines, 4 x 13 channels, rigid body and 17 modes, 970
// parameters; beside it, in the same run, one 850 x 850 x 850 product of the same library.

#include <benchmark/benchmark.h>

#include <Eigen/Core>
#include <chrono>
#include <utility>

#include "estimation/arrow_system.hpp"
#include "estimation/automatic_fit.hpp"
#include "estimation/numerators.hpp"
#include "tests/support/random_stage.hpp"

namespace {

using namespace stageid;

const test::RandomStage& paper_stage() {
  static const test::RandomStage stage = [] {
    test::RandomStageSpec spec;
    spec.least_modes = spec.most_modes = 17;
    return test::draw_random_stage(1, spec);
  }();
  return stage;
}

FitOptions options_of(const test::RandomStage& stage, int threads) {
  FitOptions options;
  options.weighting = Weighting::noise_variance;
  options.hold = HoldModel::exact;
  options.delay_s = stage.delay_s;
  options.threads = threads;
  options.uncertainty = false;
  return options;
}

void product_850(benchmark::State& state) {
  const Eigen::MatrixXd A = Eigen::MatrixXd::Random(850, 850);
  const Eigen::MatrixXd B = Eigen::MatrixXd::Random(850, 850);
  Eigen::MatrixXd C(850, 850);
  for (auto _ : state) {
    C.noalias() = A * B;
    benchmark::DoNotOptimize(C.data());
  }
  state.counters["GFLOP/s"] = benchmark::Counter(2.0 * 850 * 850 * 850 * 1e-9,
                                                 benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(product_850)->Unit(benchmark::kMillisecond)->UseRealTime();

/// One iteration, step and numerators: what ten more take than two, from a start a per mille away.
void iteration(benchmark::State& state) {
  const test::RandomStage& stage = paper_stage();
  FitOptions options = options_of(stage, static_cast<int>(state.range(0)));
  options.method = state.range(1) == 0 ? FitMethod::gn : FitMethod::riv;
  options.gradient_tolerance = options.step_tolerance = options.deviation_tolerance = 0.0;
  AdditiveModel start = stage.truth;
  for (Submodel& s : start.submodels)
    if (s.is_mode()) s.denominator[2] *= 1.01;
  const auto seconds_of = [&](int iterations) {
    options.max_iterations = iterations;
    const auto begin = std::chrono::steady_clock::now();
    const int done = fit_additive_model(stage.frf, start, options).model.fit.iterations;
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
    return std::pair(taken.count(), done);
  };
  for (auto _ : state) {
    const auto [few_s, few] = seconds_of(2);
    const auto [many_s, many] = seconds_of(7);
    if (many <= few) state.SkipWithError("the fit ended early");
    state.SetIterationTime((many_s - few_s) / std::max(many - few, 1));
  }
}
BENCHMARK(iteration)
    ->ArgNames({"threads", "riv"})
    ->Args({1, 0})
    ->Args({1, 1})
    ->Args({2, 0})
    ->Args({2, 1})
    ->Unit(benchmark::kMillisecond)
    ->UseManualTime();

void blind_fit(benchmark::State& state) {
  const test::RandomStage& stage = paper_stage();
  const FitOptions options = options_of(stage, 2);
  for (auto _ : state)
    benchmark::DoNotOptimize(automatic_fit(stage.frf, ModelStructure{}, ModeSelection{}, options));
}
BENCHMARK(blind_fit)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace

BENCHMARK_MAIN();
