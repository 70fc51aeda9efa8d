#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "excitation/multisine/bounded_signal.hpp"
#include "excitation/multisine/frequency_grid.hpp"

namespace stageid {

/// Largest values of a signal over a set of runs.
struct SignalPeak {
  double steady = 0.0;     ///< bound on |x(t)| over all t, in steady state
  double from_rest = 0.0;  ///< largest |x[n]| of the first period from rest, with its margin
  double rms = 0.0;        ///< over the window of the signal's limit, steady state
  double peak() const { return steady > from_rest ? steady : from_rest; }
  void include(const SignalPeak& other);
};

/// Predicts signals from the spectrum of the excitation of one run.
///
/// Steady state: x is a trigonometric polynomial of degree l = largest line. Sampled m > 2 l times per
/// period, |x(t)| <= max_n |x(t_n)| / cos(pi l / m) for all t (M. Riesz: near its maximum M, such a
/// polynomial is above M cos(l t)). With m >= 8 l the bound is at most 8 % too large, and usually less than
/// 1 %, because the largest of some thousand maxima is rarely between two samples.
///
/// From rest: x = h * (r 1(t >= 0)) over two periods, with r in the first; what has not decayed after one
/// period wraps around. The transfer is interpolated between the lines, taken from
/// BoundedSignal::below_band below them, and constant above them.
class SignalPredictor {
 public:
  /// @throws std::invalid_argument if the number of dense samples per period exceeds an int.
  explicit SignalPredictor(const FrequencyGrid& grid);
  ~SignalPredictor();
  SignalPredictor(SignalPredictor&&) = delete;

  /// @param spectrum  R, axes x lines: coefficients of exp(j 2 pi l n / N) in the run
  /// @returns one entry per signal
  std::vector<SignalPeak> predict(const std::vector<BoundedSignal>& signals,
                                  const Eigen::MatrixXcd& spectrum);

 private:
  struct Work;
  std::unique_ptr<Work> work_;
};

/// Oversampling factor for a close approximation of the signal: at least 8 samples per period of the largest
/// line.
int dense_oversampling(const FrequencyGrid& grid);

}  // namespace stageid
