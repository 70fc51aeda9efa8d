#pragma once

#include <Eigen/Core>
#include <vector>

#include "excitation/multisine/dft.hpp"

namespace stageid {

/// What one run's excitation holds.
struct ExcitationSpectrum {
  std::vector<int> lines;              ///< excited in some channel, ascending, never DC or Nyquist
  std::vector<Eigen::Index> channels;  ///< excited on some line, ascending
  Eigen::MatrixXcd values;             ///< R, excitation channels x lines: DFT / samples
  std::vector<Eigen::Index> only;      ///< of each line: its only channel; -1: it has several

  /// Several channels are excited, each on lines of its own.
  bool is_zippered() const;

  friend bool operator==(const ExcitationSpectrum&, const ExcitationSpectrum&) = default;
};

/// The spectrum of one period (samples x channels) on its excited lines.
///
/// A line counts as excited if it is above 1e-6 of the channel's largest, which rounding (of
/// float32 too) does not reach, and above the rounding of integer samples, white with variance
/// step^2 / (12 N) a line; the step is the smallest distance between values that occur.
/// @pre period.rows() == dft.length()
ExcitationSpectrum excitation_spectrum(const Eigen::MatrixXd& period, RealDft& dft);

}  // namespace stageid
