#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "excitation/multisine/bounded_signal.hpp"
#include "excitation/multisine/frequency_grid.hpp"

namespace stageid {

/// The largest that a signal becomes in some runs.
struct SignalPeak {
  double steady = 0.0;     ///< bound on |x(t)| over all t, in steady state
  double from_rest = 0.0;  ///< largest |x[n]| of the first period, begun at rest, with its margin
  double rms = 0.0;        ///< over the window of the signal's limit, steady state
  double peak() const { return steady > from_rest ? steady : from_rest; }
  void include(const SignalPeak& other);
};

/// Predicts signals from the spectrum of the excitation of one run.
///
/// Steady state: x is a trigonometric polynomial of degree l = largest line; sampled m > 2 l times a
/// period, |x(t)| <= max_n |x(t_n)| / cos(pi l / m) for all t (M. Riesz: next to its maximum M such a
/// polynomial stays above M cos(l t)). m is 8 l or more, so that the bound is at most 8 % high, in
/// effect less than 1 %, as the largest of some thousand maxima hardly ever lies between the samples.
///
/// From rest: x = h * (r 1(t >= 0)), h from the transfer, interpolated between the lines, below
/// them as the signal tells, held constant above them, over two periods with r in the first: what has not died out after a period
/// wraps round.
class SignalPredictor {
 public:
  /// @throws std::invalid_argument if the dense period is too long to be counted in an int.
  explicit SignalPredictor(const FrequencyGrid& grid);
  ~SignalPredictor();
  SignalPredictor(const SignalPredictor&) = delete;
  SignalPredictor& operator=(const SignalPredictor&) = delete;

  /// @param spectrum  R, axes x lines: coefficients of exp(j 2 pi l n / N) in the run
  /// @returns one entry a signal
  std::vector<SignalPeak> predict(const std::vector<BoundedSignal>& signals,
                                  const Eigen::MatrixXcd& spectrum);

 private:
  struct Work;
  std::unique_ptr<Work> work_;
};

/// Samples a period that follow a signal closely: a multiple of samples_per_period(), at least 8
/// times the largest line.
int dense_oversampling(const FrequencyGrid& grid);

}  // namespace stageid
