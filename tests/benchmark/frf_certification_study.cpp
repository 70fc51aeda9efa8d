// Tests the variances and radii of an FRF: one closed loop, measured many times.
//
//   frf_certification_study variance [seeds = 500] [outputs = 4] [inputs = 13] [periods = 4]
//                                    [realizations = 2] [scheme = 0: single axis | 1: orthogonal]
//   frf_certification_study coverage [seeds = 1000]
//   frf_certification_study covariance [draws = 50000] [outputs = 4] [inputs = 13] [scheme = 0]
//
// variance: for the noise and the total variance, the empirical over the reported variance: mean
// over all entries, smallest, largest, and how many entries lie in the 99 % interval of that ratio;
// then the coverage of the 95 % radii. coverage: of the radii for P = 3, 5, 10 and M = 2, 5, 10.
// covariance: the full covariance against that of the draws, on one line, by Frobenius norms.
#include <fmt/format.h>

#include <cmath>
#include <string>

#include "frf/plant/plant_frf.hpp"
#include "frf/response/confidence.hpp"
#include "tests/benchmark/arguments.hpp"
#include "tests/support/stages/closed_loop.hpp"

namespace {

using namespace stageid;
using namespace stageid::test;

/// Gain that falls over the lines (not, if `flat`), phases that differ from entry to entry, and a
/// loop gain around one, so that what is fed back matters.
ClosedLoop loop_of_size(int outputs, int inputs, bool flat) {
  ClosedLoop loop;
  loop.plant = [=](double omega) {
    const double at = flat ? 100.0 : omega;
    Eigen::MatrixXcd G(outputs, inputs);
    for (int i = 0; i < outputs; ++i)
      for (int j = 0; j < inputs; ++j)
        G(i, j) = std::polar(1.0 + 0.2 * std::cos(i + 2.0 * j), 0.9 * i * j + 1e-3 * at) /
                  std::complex<double>(1.0, at / 150.0);
    return G;
  };
  loop.controller = [outputs, inputs](double) {
    Eigen::MatrixXcd C(inputs, outputs);
    for (int j = 0; j < inputs; ++j)
      for (int i = 0; i < outputs; ++i) C(j, i) = 0.3 * std::cos(1.1 * j - 0.6 * i);
    return C;
  };
  return loop;
}

LoopExperiment experiment(int outputs, int inputs, int periods, int realizations, int scheme) {
  LoopExperiment x;
  x.axes = inputs;
  x.periods = periods;
  x.realizations = realizations;
  x.transient_periods = 0;
  x.scheme = scheme == 1 ? AxisScheme::orthogonal : AxisScheme::single_axis;
  x.noise_factor = 1e-3 * Eigen::MatrixXcd::Identity(outputs, outputs);
  return x;
}

Eigen::MatrixXcd error_of(const FrfEstimate& frf, const ClosedLoop& loop, const LoopExperiment& x) {
  Eigen::MatrixXcd error = frf.response;
  for (Eigen::Index k = 0; k < frf.lines(); ++k)
    error.col(k) -= loop.plant(omega_of(x, k)).reshaped();
  return error;
}

/// Squared errors against one reported variance, over seeds.
struct Certificate {
  Eigen::ArrayXXd squares;
  Eigen::ArrayXXd reported;
  double covered = 0.0;
  int seeds = 0;
  double dof = 0.0;

  void add(const Eigen::MatrixXcd& error, const FrfEstimate& frf, VarianceKind kind) {
    const Eigen::MatrixXd& variance =
        kind == VarianceKind::total ? frf.total_variance : frf.noise_variance;
    if (variance.size() == 0) return;
    const Eigen::ArrayXXd radius = confidence_radius(frf, 0.95, kind).array();
    if (seeds++ == 0) squares = reported = Eigen::ArrayXXd::Zero(error.rows(), error.cols());
    dof = kind == VarianceKind::total ? frf.total_dof : frf.noise_dof;
    squares += error.array().abs2();
    reported += variance.array();
    covered += (error.array().abs() <= radius).cast<double>().mean();
  }

  void print(const std::string& name) const {
    if (seeds == 0) return;
    const Eigen::ArrayXXd ratio = squares / reported;
    // To first order: the squares have S complex degrees of freedom, the reported mean S dof.
    const double half_width = 2.576 * std::sqrt((1.0 + 1.0 / dof) / seeds);
    const double inside = ((ratio - 1.0).abs() <= half_width).cast<double>().mean();
    fmt::print(
        "{:12}  ratio {:.4f} ({:.3f} ... {:.3f}), {:.1f} % of {} entries in 1 +- {:.3f}; "
        "95 % radii cover {:.2f} %\n",
        name, ratio.mean(), ratio.minCoeff(), ratio.maxCoeff(), 100.0 * inside, ratio.size(),
        half_width, 100.0 * covered / seeds);
  }
};

struct Certificates {
  Certificate noise;
  Certificate total;
};

Certificates certify(const ClosedLoop& loop, LoopExperiment x, int seeds) {
  Certificates found;
  for (int seed = 1; seed <= seeds; ++seed) {
    x.seed = static_cast<std::uint64_t>(seed);
    const auto log = simulate_log(loop, x);
    const FrfEstimate frf = estimate_plant_frf({&log});
    const Eigen::MatrixXcd error = error_of(frf, loop, x);
    found.noise.add(error, frf, VarianceKind::noise);
    found.total.add(error, frf, VarianceKind::total);
  }
  return found;
}

/// One axis, so that there are no more degrees of freedom than M (P - 1) and M - 1.
void study_coverage(int seeds) {
  const ClosedLoop loop = loop_of_size(4, 1, false);
  for (const int periods : {3, 5, 10})
    certify(loop, experiment(4, 1, periods, 1, 0), seeds)
        .noise.print(fmt::format("P = {}", periods));
  for (const int realizations : {2, 5, 10})
    certify(loop, experiment(4, 1, 2, realizations, 0), seeds)
        .total.print(fmt::format("M = {}", realizations));
}

/// Lines of equal response and noise are so many draws of one line.
void study_covariance(int draws, int outputs, int inputs, int scheme) {
  const ClosedLoop loop = loop_of_size(outputs, inputs, true);
  LoopExperiment x = experiment(outputs, inputs, 2, 1, scheme);
  x.lines.clear();
  for (int line = 1; line < 125; ++line) x.lines.push_back(line);
  const auto lines = static_cast<int>(x.lines.size());
  const Eigen::Index n_c = outputs * inputs;
  Eigen::MatrixXcd sample = Eigen::MatrixXcd::Zero(n_c, n_c);
  Eigen::MatrixXcd reported = sample;
  const int logs = (draws + lines - 1) / lines;
  for (int seed = 1; seed <= logs; ++seed) {
    x.seed = static_cast<std::uint64_t>(seed);
    const auto log = simulate_log(loop, x);
    const FrfEstimate frf = estimate_plant_frf({&log}, {.covariance = CovarianceKind::full});
    const Eigen::MatrixXcd error = error_of(frf, loop, x);
    sample.noalias() += error * error.adjoint() / (logs * lines);
    reported += frf.covariance.rowwise().mean().reshaped(n_c, n_c) / logs;
  }
  // A sample covariance of S draws is off by tr(C) / sqrt(S) in the Frobenius norm, by chance.
  const double chance = sample.trace().real() / std::sqrt(logs * lines) / sample.norm();
  fmt::print(
      "covariance {} x {}, {} draws: |reported - sample| / |sample| = {:.2f} % ({:.2f} % by "
      "chance)\n",
      n_c, n_c, logs * lines, 100.0 * (reported - sample).norm() / sample.norm(), 100.0 * chance);
}

}  // namespace

int main(int argc, char** argv) {
  const Arguments number(argc, argv);
  const std::string what = number.word(1, "");
  if (what == "variance") {
    const int outputs = number(3, 4);
    const int inputs = number(4, 13);
    const Certificates found = certify(
        loop_of_size(outputs, inputs, false),
        experiment(outputs, inputs, number(5, 4), number(6, 2), number(7, 0)), number(2, 500));
    found.noise.print("noise");
    found.total.print("total");
  } else if (what == "coverage") {
    study_coverage(number(2, 1000));
  } else if (what == "covariance") {
    study_covariance(number(2, 50000), number(3, 4), number(4, 13), number(5, 0));
  } else {
    fmt::print(stderr, "frf_certification_study variance | coverage | covariance [NUMBERS]\n");
    return 2;
  }
  return 0;
}
