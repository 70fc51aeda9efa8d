#include "excitation/plan/joint_crest_reduction.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>

#include "excitation/multisine/line_spectrum.hpp"
#include "excitation/multisine/multisine_lines.hpp"
#include "excitation/multisine/signal_peaks.hpp"

namespace stageid {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;

// As in multisine_lines.cpp: low levels change the signal quickly and stall, high ones refine it.
constexpr double kFirstFraction = 0.7;
constexpr double kLastFraction = 0.97;
constexpr double kStep = 1.0;

class JointCrest {
 public:
  explicit JointCrest(const JointCrestProblem& problem)
      : problem_(problem),
        synthesis_(problem.grid, std::max(1, (dense_oversampling(problem.grid) + 1) / 2)) {
    const Eigen::VectorXd frequency_hz = problem.grid.frequency_hz();
    for (const BoundedSignal& signal : problem.signals) {
      if (!std::isfinite(signal.peak_limit)) continue;
      MatrixXcd H = signal.transfer / (signal.peak_limit - signal.reserve);
      for (Index k = 0; k < H.cols(); ++k)
        H.col(k) *= kind_factor(signal.kind, frequency_hz[k], problem.grid.sample_rate_hz());
      transfer_.push_back(std::move(H));
    }
  }

  Eigen::MatrixXd reduce(const Eigen::MatrixXd& phase_rad, int iterations) {
    R_ = axis_coefficients(Eigen::VectorXcd::Ones(phase_rad.rows()), problem_.amplitude, phase_rad);
    MatrixXcd best;
    double best_peak = std::numeric_limits<double>::infinity();
    double level = std::numeric_limits<double>::infinity();
    bool start_is_best = true;
    for (int i = 0; i <= iterations; ++i) {
      const MatrixXcd now = R_;
      const double peak = pass(level);
      if (peak < best_peak) {
        best_peak = peak;
        best = now;
        start_is_best = i == 0;
      }
      if (peak <= problem_.enough) break;
      const double fraction = kFirstFraction + (kLastFraction - kFirstFraction) * i / iterations;
      level = fraction * peak;
      if (i == 0) {  // the first pass() evaluated the peak only
        R_ = now;
        pass(level);
      }
    }
    if (start_is_best) return phase_rad;
    Eigen::MatrixXd reduced = phase_rad;
    for (Index i = 0; i < best.size(); ++i)
      if (problem_.amplitude.data()[i] > 0.0)
        reduced.data()[i] = positive_phase_rad(best.data()[i]);
    return reduced;
  }

 private:
  /// Computes the largest ratio of peak to limit at R_, then corrects R_ by clipping at `level`.
  double pass(double level) {
    MatrixXcd correction = MatrixXcd::Zero(R_.rows(), R_.cols());
    Eigen::MatrixXd weight = Eigen::MatrixXd::Zero(R_.rows(), R_.cols());
    double peak = 0.0;
    for (Index e = 0; e < problem_.mixing.cols(); ++e) {
      const Eigen::VectorXcd T = problem_.mixing.col(e);
      for (const MatrixXcd& H : transfer_) {
        const Eigen::VectorXcd X =
            (H.array() * (T.asDiagonal() * R_).array()).colwise().sum().transpose();
        // The transform is skipped if the signal cannot reach the level even with all lines in phase.
        if (2.0 * X.cwiseAbs().sum() < std::min(level, peak)) continue;
        const Eigen::VectorXd x = synthesis_.samples(X);
        const double largest = x.cwiseAbs().maxCoeff();
        peak = std::max(peak, largest);
        if (!(largest > level)) continue;
        const Eigen::VectorXcd D = synthesis_.coefficients(x - x.cwiseMax(-level).cwiseMin(level));
        const MatrixXcd back = T.asDiagonal() * H;
        correction.array() += back.conjugate().array().rowwise() * D.transpose().array();
        weight.array() += back.array().abs2();
      }
    }
    for (Index i = 0; i < R_.size(); ++i) {
      if (!(weight.data()[i] > 0.0)) continue;
      const std::complex<double> moved =
          R_.data()[i] - kStep * correction.data()[i] / weight.data()[i];
      const double size = std::abs(moved);
      if (size > 0.0) R_.data()[i] = moved * (problem_.amplitude.data()[i] / 2.0 / size);
    }
    return peak;
  }

  const JointCrestProblem& problem_;
  LineSpectrum synthesis_;
  std::vector<MatrixXcd> transfer_;  // divided by the limits
  MatrixXcd R_;
};

}  // namespace

Eigen::MatrixXd reduce_joint_crest(const JointCrestProblem& problem,
                                   const Eigen::Ref<const Eigen::MatrixXd>& phase_rad,
                                   int iterations) {
  return JointCrest(problem).reduce(phase_rad, iterations);
}

}  // namespace stageid
