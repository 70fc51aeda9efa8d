// Are the variances and radii of an FRF what they say? One closed loop, measured many times.
//
//   frf_certification_study [seeds = 500] [outputs = 4] [inputs = 13] [periods = 4]
//                           [realizations = 2] [scheme = 0: single axis | 1: orthogonal]
//
// Prints, for the noise and the total variance, the empirical over the reported variance: mean over
// all entries, smallest, largest, and how many entries lie in the 99 % interval of that ratio
// around 1; then the coverage of the 95 % radii.

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>

#include "frf/confidence.hpp"
#include "frf/plant_frf.hpp"
#include "tests/support/closed_loop.hpp"

namespace {

using stageid::FrfEstimate;
using stageid::VarianceKind;
using stageid::test::ClosedLoop;
using stageid::test::LoopExperiment;

/// Gain that falls over the lines, phases that differ from entry to entry, and
/// a loop gain around one, so that what is fed back matters.
ClosedLoop loop_of_size(int outputs, int inputs) {
  ClosedLoop loop;
  loop.plant = [outputs, inputs](double omega) {
    Eigen::MatrixXcd G(outputs, inputs);
    for (int i = 0; i < outputs; ++i)
      for (int j = 0; j < inputs; ++j)
        G(i, j) = std::polar(1.0 + 0.2 * std::cos(i + 2.0 * j), 0.9 * i * j + 1e-3 * omega) /
                  std::complex<double>(1.0, omega / 150.0);
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
    const Eigen::ArrayXXd radius = stageid::confidence_radius(frf, 0.95, kind).array();
    if (seeds++ == 0) squares = reported = Eigen::ArrayXXd::Zero(error.rows(), error.cols());
    dof = kind == VarianceKind::total ? frf.total_dof : frf.noise_dof;
    squares += error.array().abs2();
    reported += variance.array();
    covered += (error.array().abs() <= radius).cast<double>().mean();
  }

  void print(const char* name) const {
    if (seeds == 0) return;
    const Eigen::ArrayXXd ratio = squares / reported;
    // To first order: the squares have S complex degrees of freedom, the reported mean S dof.
    const double half_width = 2.576 * std::sqrt((1.0 + 1.0 / dof) / seeds);
    const double inside = ((ratio - 1.0).abs() <= half_width).cast<double>().mean();
    fmt::print(
        "{:5}  ratio {:.4f} ({:.3f} ... {:.3f}), {:.1f} % of {} entries in 1 +- {:.3f}; "
        "95 % radii cover {:.2f} %\n",
        name, ratio.mean(), ratio.minCoeff(), ratio.maxCoeff(), 100.0 * inside, ratio.size(),
        half_width, 100.0 * covered / seeds);
  }
};

}  // namespace

int main(int argc, char** argv) {
  const auto number = [&](int i, int otherwise) {
    return i < argc ? std::atoi(argv[i]) : otherwise;
  };
  const int seeds = number(1, 500);
  const int outputs = number(2, 4);
  const int inputs = number(3, 13);
  const ClosedLoop loop = loop_of_size(outputs, inputs);
  LoopExperiment x;
  x.axes = inputs;
  x.periods = number(4, 4);
  x.realizations = number(5, 2);
  x.transient_periods = 0;
  x.scheme = number(6, 0) == 1 ? stageid::test::AxisScheme::orthogonal
                               : stageid::test::AxisScheme::single_axis;
  x.noise_factor = 1e-3 * Eigen::MatrixXcd::Identity(outputs, outputs);
  Certificate noise;
  Certificate total;
  for (int seed = 1; seed <= seeds; ++seed) {
    x.seed = static_cast<std::uint64_t>(seed);
    const auto log = stageid::test::simulate_log(loop, x);
    const FrfEstimate frf = stageid::estimate_plant_frf({&log});
    Eigen::MatrixXcd error = frf.response;
    for (Eigen::Index k = 0; k < frf.lines(); ++k)
      error.col(k) -= loop.plant(stageid::test::omega_of(x, k)).reshaped();
    noise.add(error, frf, VarianceKind::noise);
    total.add(error, frf, VarianceKind::total);
  }
  noise.print("noise");
  total.print("total");
  return 0;
}
