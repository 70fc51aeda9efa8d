#pragma once

#include <Eigen/Core>

#include <vector>

#include "excitation/multisine/dft.hpp"
#include "excitation/multisine/frequency_grid.hpp"

namespace stageid {

/// Converts between the lines of a grid and one period of samples, `oversampling` times as dense as the
/// grid:  x(n) = 2 Re sum_k X_k exp(2 pi j l_k n / N).
class LineSpectrum {
 public:
  /// @throws std::invalid_argument if the dense period has more samples than an int can count.
  explicit LineSpectrum(const FrequencyGrid& grid, int oversampling = 1);

  /// Converts X_k, size of the grid, to samples, size oversampling * samples_per_period().
  Eigen::VectorXd samples(const Eigen::Ref<const Eigen::VectorXcd>& coefficients);

  /// The inverse, DFT / N; other lines are discarded.
  Eigen::VectorXcd coefficients(const Eigen::Ref<const Eigen::VectorXd>& samples);

 private:
  std::vector<int> lines_;
  RealDft dft_;
  Eigen::VectorXcd half_spectrum_;  ///< zero except on the lines
};

}  // namespace stageid
