#pragma once

#include <Eigen/Core>
#include <vector>

#include "frf/runs/excitation_spectrum.hpp"
#include "frf/runs/run_spectra.hpp"

namespace stageid {

/// The bins of a record of P periods (bin b has the frequency b / P lines) from which the transient,
/// and the noise, on each excited line are told.
///
///   Z(b) = G_zr(b) R(b) + T(b) + V(b)
/// T, what is left of the start (and of the end) in a finite record, is smooth in b. Bins that hold
/// no line at all carry T + V only: between the lines with P >= 2, the lines left empty with P = 1
/// (even-order distortions of the plant count as noise then). T is fitted there and subtracted from
/// Z on the line; G_zr is not smoothed, so no resonance is biased.
/// Source: method.md section 3, facts 5; Pintelon, Schoukens, Vandersteen, Barbe, MSSP 24 (2010).
class TransientModel {
 public:
  /// `excitation` of the run, with its lines; `outputs`: rank of the noise of Z.
  /// @throws std::invalid_argument if there are too few bins, or one period with too few empty
  ///         lines. `place` names the run.
  TransientModel(int period_samples, int periods, const ExcitationSpectrum& excitation,
                 Eigen::Index outputs, const std::string& place);

  Eigen::Index bins() const noexcept { return bins_; }  ///< DC ... below Nyquist

  /// Fills mean with the steady state, on the lines of the excitation, and the scatter such that
  /// scatter / scatter_dof / periods estimates Cov(mean). Lines that needed poles have fewer
  /// degrees of freedom, one a pole over the rank of the noise: line_dof.
  /// Z: DFT / samples, channels x bins().
  void separate(const Eigen::MatrixXcd& Z, RunSpectra& run) const;

 private:
  void separate_line(const Eigen::MatrixXcd& Z, Eigen::Index k, RunSpectra& run) const;
  std::vector<Eigen::Index> window(Eigen::Index bin) const;

  int periods_;
  Eigen::Index bins_;
  const ExcitationSpectrum& excitation_;
  Eigen::Index outputs_;
  std::vector<Eigen::Index> usable_;  ///< bins fitted on, ascending
  Eigen::Index window_ = 0;
};

}  // namespace stageid
