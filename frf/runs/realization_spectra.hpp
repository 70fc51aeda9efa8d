#pragma once

#include <Eigen/Core>
#include <vector>

#include "frf/runs/excitation_spectrum.hpp"
#include "frf/runs/run_spectra.hpp"

namespace stageid {

/// The runs of one realization, gathered. Runs may arrive in any order. Their scatters, the largest part, are kept
/// apart, as the noise of one experiment may not be that of another, and are used again by the next realization.
class RealizationSpectra {
 public:
  /// `excitation`: R of each experiment, excited axes x lines; `pool`: where scatters came from.
  RealizationSpectra(int realization, std::vector<Eigen::MatrixXcd> excitation, MatrixPool& pool);
  ~RealizationSpectra();
  RealizationSpectra(const RealizationSpectra&) = delete;
  RealizationSpectra& operator=(const RealizationSpectra&) = delete;

  /// One thread at a time.
  void add(std::size_t experiment, RunSpectra&& spectra);

  int realization() const noexcept { return realization_; }
  Eigen::Index experiments() const noexcept { return static_cast<Eigen::Index>(runs_.size()); }

  /// At line k, a column an experiment: R (axes x E) and Z = [Y; U] (n_y + n_u x E).
  Eigen::MatrixXcd excitation(Eigen::Index k) const;
  Eigen::MatrixXcd response(Eigen::Index k) const;

  int periods(std::size_t experiment) const { return runs_[experiment].periods; }
  const RunSpectra& run(std::size_t experiment) const { return runs_[experiment]; }

  /// Degrees of freedom of scatter(): sum_e (P_e - 1), or those of the transient models.
  /// The scatter is scaled for so many, whatever a line has of them.
  int scatter_dof() const;
  double scatter_dof(Eigen::Index k) const;  ///< that line k has
  /// sum_e sum_p (Z_pe - Z_e)(Z_pe - Z_e)^H at line k, or what the transient models leave in its
  /// place; full Hermitian matrix.
  Eigen::MatrixXcd scatter(Eigen::Index k) const;
  Eigen::MatrixXcd scatter(std::size_t experiment, Eigen::Index k) const;  ///< of one experiment

 private:
  MatrixPool& pool_;
  int realization_;
  std::vector<Eigen::MatrixXcd> excitation_;
  std::vector<RunSpectra> runs_;
};

}  // namespace stageid
