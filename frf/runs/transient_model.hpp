#pragma once

#include <Eigen/Core>
#include <vector>

#include "frf/runs/excitation_spectrum.hpp"
#include "frf/runs/run_spectra.hpp"

namespace stageid {

/// The bins of a record of P periods (bin b has the frequency b / P lines), from which the transient and the noise on
/// each excited line are estimated.
///
///   Z(b) = G_zr(b) R(b) + T(b) + V(b)
/// T, the transient of the start (and the end) of a finite record, is smooth in b. Bins without a line contain T + V
/// only: between the lines for P >= 2, the empty lines for P = 1 (even-order distortions of the plant then count as
/// noise). T is fitted there and subtracted from Z on the line. G_zr is not smoothed, so resonances are not biased.
/// Source: docs/theory.md, section 4; Pintelon, Schoukens, Vandersteen, Barbe, MSSP 24 (2010).
class TransientModel {
 public:
  /// `excitation` of the run, with its lines; `outputs`: rank of the noise of Z.
  /// @throws std::invalid_argument if there are too few bins, or one period with too few empty lines. `place` names the
  ///         run.
  TransientModel(int period_samples, int periods, const ExcitationSpectrum& excitation,
                 Eigen::Index outputs, const std::string& place);

  Eigen::Index bins() const noexcept { return bins_; }  ///< from DC to below Nyquist

  /// Fills the mean with the steady state on the lines of the excitation. The scatter is scaled so that
  /// scatter / scatter_dof / periods estimates Cov(mean). Each pole of a line reduces its
  /// degrees of freedom (line_dof) by one over the rank of the noise.
  /// Z: DFT / number of samples, channels x bins().
  void separate(const Eigen::MatrixXcd& Z, RunSpectra& run) const;

 private:
  void separate_line(const Eigen::MatrixXcd& Z, Eigen::Index k, RunSpectra& run) const;
  Eigen::Index first_of_window(Eigen::Index bin) const;  ///< index in usable_

  int periods_;
  Eigen::Index bins_;
  const ExcitationSpectrum& excitation_;
  Eigen::Index outputs_;
  std::vector<Eigen::Index> usable_;  ///< bins used for fits, ascending
  Eigen::Index window_ = 0;
};

}  // namespace stageid
