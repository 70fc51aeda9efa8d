// The estimator at the paper's size: 3960 lines, 4 x 13 channels, rigid body and 17 modes, 970
// parameters; beside it, in the same run, one 850 x 850 x 850 product of the same library and the same
// equations written out densely. Then how an iteration grows with lines and channels.

#include <benchmark/benchmark.h>
#include <Eigen/Core>
#include <fstream>
#include <string>

#include "estimation/equations/arrow_system.hpp"
#include "estimation/equations/numerators.hpp"
#include "estimation/problem/freed_memory.hpp"
#include "estimation/products/equation_method.hpp"
#include "estimation/search/automatic_fit.hpp"
#include "tests/support/stages/random_stage.hpp"

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

/// The paper's problem, its channels `times` times over, on every `every`-th line.
struct Case {
  FitProblem problem;
  FitParameters beta;
};

Case make_case(int times, Eigen::Index every, int threads) {
  const test::RandomStage& stage = paper_stage();
  const Eigen::Index lines = stage.frf.lines() / every;
  const Eigen::Index own = stage.frf.response.rows();
  Case out;
  FitProblem& problem = out.problem;
  problem.lines.sample_period_s = 1.0 / stage.frf.sample_rate_hz;
  problem.lines.hold = HoldModel::exact;
  problem.lines.omega_rad_s = stage.frf.omega_rad_s()(Eigen::seqN(0, lines, every));
  problem.n_outputs = stage.frf.n_outputs() * times;
  problem.n_inputs = stage.frf.n_inputs();
  Eigen::MatrixXcd data(own * times, lines);
  Eigen::MatrixXd weights(own * times, lines);
  const Eigen::MatrixXd W = make_weights(stage.frf, options_of(stage, threads));
  for (Eigen::Index k = 0; k < lines; ++k)
    for (int t = 0; t < times; ++t) {
      data.col(k).segment(t * own, own) = stage.frf.response.col(k * every);
      weights.col(k).segment(t * own, own) = W.col(k * every);
    }
  problem.G = std::move(data);
  problem.W = std::move(weights);
  problem.threads = threads;
  for (const Submodel& s : stage.truth.submodels) {
    const auto order = static_cast<Eigen::Index>(s.denominator.size()) - 1;
    problem.shapes.push_back({s.integrators, static_cast<int>(order), 0});
    out.beta.a.emplace_back(Eigen::Map<const Eigen::VectorXd>(s.denominator.data() + 1, order));
  }
  out.beta.input_delay_s.setConstant(problem.n_inputs, stage.delay_s);
  out.beta.output_delay_s.setZero(problem.n_outputs);
  solve_numerators(problem, evaluate_groups(problem, out.beta, false), out.beta.B);
  return out;
}

/// One iteration of iterate(): equations, step, numerators at the new poles.
double iterate_once(const Case& c, FitMethod method) {
  const std::vector<BasisGroup> groups = evaluate_groups(c.problem, c.beta, true);
  const ArrowSystem system(c.problem, c.beta, groups, method, ChannelEquationsUse::eliminated);
  FitParameters next = stepped(c.problem, c.beta, system.solve_globals(1e-6));
  return solve_numerators(c.problem, evaluate_groups(c.problem, next, false), next.B).value().cost;
}

/// Floating-point operations of the matrix products of one iteration: sums of fractions, the pairs that
/// are multiplied out, the residual (three times) and its gradients.
double operations(const Case& c, FitMethod method) {
  const FitProblem& p = c.problem;
  const BasisGroup group = evaluate_groups(p, c.beta, true).at(0);
  const FractionColumns& x = group.fractions;
  const auto direct = [&](const auto& left, const auto& right, std::vector<ColumnPair> pairs) {
    return static_cast<double>(PairReduction(x, left, right, std::move(pairs)).direct().size());
  };
  const Eigen::Index f = p.functions();
  const Eigen::Index d = group.D.re.cols();
  const auto simple = static_cast<double>(x.simple_columns());
  double columns = static_cast<double>(x.base->cols()) + simple;
  columns += 2.0 * direct(x.F, x.F, triangular_pairs(f)) + direct(x.F, x.D, all_pairs(f, d));
  columns += direct(x.D, x.D, triangular_pairs(d)) / 4.0;  // four derivatives share one weight
  if (method == FitMethod::riv)
    columns += 2.0 * (simple + direct(x.F, x.Y, all_pairs(f, p.denominators())));
  columns += 2.0 * 6.0 * static_cast<double>(f);
  return 2.0 * static_cast<double>(p.size() * p.channels()) * columns;
}

double product_rate = 0.0;  // of product_850, for the fraction of it that an iteration reaches

void product_850(benchmark::State& state) {
  const Eigen::MatrixXd A = Eigen::MatrixXd::Random(850, 850);
  const Eigen::MatrixXd B = Eigen::MatrixXd::Random(850, 850);
  Eigen::MatrixXd C(850, 850);
  const auto begin = std::chrono::steady_clock::now();
  for (auto _ : state) {
    C.noalias() = A * B;
    benchmark::DoNotOptimize(C.data());
  }
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
  const double each = 2.0 * 850 * 850 * 850;
  product_rate = each * static_cast<double>(state.iterations()) / taken.count();
  state.counters["GFLOP/s"] = 1e-9 * product_rate;
}
BENCHMARK(product_850)->Unit(benchmark::kMillisecond)->UseRealTime();

void report_rate(benchmark::State& state, const Case& c, FitMethod method, double seconds) {
  const double rate = operations(c, method) * static_cast<double>(state.iterations()) / seconds;
  state.counters["GFLOP"] = 1e-9 * operations(c, method);
  state.counters["GFLOP/s"] = 1e-9 * rate;
  if (product_rate > 0.0) state.counters["of_product"] = rate / product_rate;
  state.counters["MB"] = 24e-6 * static_cast<double>(c.problem.G->size());  // data and weights
}

void iteration(benchmark::State& state) {
  const Case c = make_case(1, 1, static_cast<int>(state.range(0)));
  const FitMethod method = state.range(1) == 0 ? FitMethod::gn : FitMethod::riv;
  const auto begin = std::chrono::steady_clock::now();
  for (auto _ : state) benchmark::DoNotOptimize(iterate_once(c, method));
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
  report_rate(state, c, method, taken.count());
}
BENCHMARK(iteration)
    ->ArgNames({"threads", "riv"})
    ->ArgsProduct({{1, 2}, {0, 1}})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

/// The same equations as the paper writes them: every parameter's column on every line of
/// every channel, zeros and all. In slices of lines, so that it needs no 3 GB.
void dense_equations(benchmark::State& state) {
  constexpr Eigen::Index kSlice = 16;
  const Case c = make_case(1, 1, 1);
  const FitProblem& p = c.problem;
  const std::vector<BasisGroup> groups = evaluate_groups(p, c.beta, true);
  std::vector<SplitMatrix> of_globals;
  for (Eigen::Index k = 0; k < p.channels(); ++k)
    of_globals.push_back(global_columns(p, c.beta, groups[0], k, {0, p.size()}));
  for (auto _ : state) {
    Eigen::MatrixXd M = Eigen::MatrixXd::Zero(p.parameters(), p.parameters());
    for (Eigen::Index first = 0; first < p.size(); first += kSlice) {
      const Eigen::Index n = std::min(kSlice, p.size() - first);
      Eigen::MatrixXd J = Eigen::MatrixXd::Zero(2 * n * p.channels(), p.parameters());
      for (Eigen::Index k = 0; k < p.channels(); ++k) {
        const Eigen::VectorXd root = p.weights(k).segment(first, n).cwiseSqrt();
        const auto at = static_cast<std::size_t>(k);
        const Eigen::Index own = p.globals() + k * p.functions();
        J.block(2 * n * k, 0, n, p.globals()) =
            root.asDiagonal() * of_globals[at].re.middleRows(first, n);
        J.block(2 * n * k + n, 0, n, p.globals()) =
            root.asDiagonal() * of_globals[at].im.middleRows(first, n);
        J.block(2 * n * k, own, n, p.functions()) =
            root.asDiagonal() * groups[0].F.re.middleRows(first, n);
        J.block(2 * n * k + n, own, n, p.functions()) =
            root.asDiagonal() * groups[0].F.im.middleRows(first, n);
      }
      M.noalias() += J.transpose() * J;
    }
    benchmark::DoNotOptimize(M.data());
  }
  state.counters["GFLOP"] = 4e-9 * static_cast<double>(p.size() * p.channels()) *
                            static_cast<double>(p.parameters() * p.parameters());
}
BENCHMARK(dense_equations)->Unit(benchmark::kMillisecond)->UseRealTime()->Iterations(1);

/// A value of /proc/self/status, MB.
double memory_mb(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with(key + ":")) return 1e-3 * std::stod(line.substr(key.size() + 1));
  return 0.0;
}

/// Peak of additional memory while a task runs, MB.
template <typename Task>
double memory_of_mb(const Task& task) {
  std::ofstream("/proc/self/clear_refs") << 5;  // the peak begins anew
  const double before = memory_mb("VmRSS");
  task();
  return memory_mb("VmHWM") - before;
}

/// Linear in lines and in channels: ns is the time per line and channel; beyond, the memory that an
/// iteration takes as a part of the data and weights.
void scale(benchmark::State& state) {
  const Case c = make_case(static_cast<int>(state.range(0)), state.range(1), 2);
  state.counters["beyond"] =
      memory_of_mb([&] { benchmark::DoNotOptimize(iterate_once(c, FitMethod::riv)); }) /
      (24e-6 * static_cast<double>(c.problem.G->size()));
  const auto begin = std::chrono::steady_clock::now();
  for (auto _ : state) benchmark::DoNotOptimize(iterate_once(c, FitMethod::gn));
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
  report_rate(state, c, FitMethod::gn, taken.count());
  state.counters["channels"] = static_cast<double>(c.problem.channels());
  state.counters["lines"] = static_cast<double>(c.problem.size());
  state.counters["ns"] = 1e9 * taken.count() / static_cast<double>(state.iterations()) /
                         static_cast<double>(c.problem.G->size());
}
BENCHMARK(scale)
    ->ArgNames({"times", "every"})
    ->Args({1, 16})
    ->Args({1, 4})
    ->Args({1, 1})
    ->Args({10, 16})
    ->Args({100, 16})
    ->Args({1924, 16})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

void blind_fit(benchmark::State& state) {
  const test::RandomStage& stage = paper_stage();
  FitOptions options = options_of(stage, 2);
  options.residue_rank = static_cast<int>(state.range(0));
  options.rigid_body_rank = options.residue_rank > 0 ? 3 : 0;
  for (auto _ : state)
    benchmark::DoNotOptimize(automatic_fit(stage.frf, ModelStructure{}, ModeSelection{}, options));
}
BENCHMARK(blind_fit)->ArgName("rank")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond)->UseRealTime();

/// 10 000 channels x 2000 lines x 20 modes, whole fits with their deviations; `variance`: that of the
/// response too. peak is that of response, variance and weights and all that the fit makes, over the bytes
/// of these three.
void large_fit(benchmark::State& state) {
  test::RandomStageSpec spec;
  spec.outputs = 100;
  spec.inputs = 100;
  spec.least_modes = spec.most_modes = 20;
  spec.line_spacing_hz = 0.99;
  test::RandomStage stage = test::draw_random_stage(2, spec);
  stage.exact.resize(0, 0);
  stage.variance.resize(0, 0);
  FitOptions options = options_of(stage, 2);
  options.uncertainty = true;
  options.response_variance = state.range(0) != 0;
  const double entries = static_cast<double>(stage.frf.response.size());
  double beyond_mb = 0.0;
  for (auto _ : state)
    beyond_mb = memory_of_mb(
        [&] { benchmark::DoNotOptimize(fit_additive_model(stage.frf, stage.truth, options)); });
  state.counters["lines"] = static_cast<double>(stage.frf.lines());
  state.counters["data_GB"] = 32e-9 * entries;
  state.counters["peak_GB"] = 24e-9 * entries + 1e-3 * beyond_mb;
  state.counters["peak"] = (24e-6 * entries + beyond_mb) / (32e-6 * entries);
}
BENCHMARK(large_fit)
    ->ArgName("variance")
    ->Arg(0)
    ->Arg(1)
    ->Unit(benchmark::kSecond)
    ->UseRealTime()
    ->Iterations(1);

}  // namespace

int main(int argc, char** argv) {
  stageid::keep_freed_memory();
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
