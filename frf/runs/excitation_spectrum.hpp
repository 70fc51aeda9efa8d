#pragma once

#include <Eigen/Core>
#include <vector>

#include "excitation/multisine/dft.hpp"

namespace stageid {

/// Excited lines and channels of one run.
struct ExcitationSpectrum {
  std::vector<int> lines;              ///< excited in some channel, ascending, never DC or Nyquist
  std::vector<Eigen::Index> channels;  ///< excited on some line, ascending
  Eigen::MatrixXcd values;             ///< R, excitation channels x lines: DFT / number of samples
  std::vector<Eigen::Index> only;      ///< of each line: its only channel; -1: several

  /// Whether several channels are excited, each on its own lines.
  bool is_zippered() const;

  friend bool operator==(const ExcitationSpectrum&, const ExcitationSpectrum&) = default;
};

/// The spectrum of one period (samples x channels) on its excited lines.
///
/// A line counts as excited if it is above 1e-6 of the channel's largest, which rounding (also to float32) does not
/// reach. It must also be above the rounding of integer samples or of up to seven decimal digits, white with variance
/// step^2 / (12 N) per line; the step is the smallest distance between the values, or that of the last digit.
/// @pre period.rows() == dft.length()
ExcitationSpectrum excitation_spectrum(const Eigen::MatrixXd& period, RealDft& dft);

}  // namespace stageid
