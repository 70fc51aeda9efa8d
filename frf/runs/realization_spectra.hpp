#pragma once

#include <Eigen/Core>
#include <vector>

#include "frf/runs/channel_choice.hpp"
#include "frf/runs/run_spectra.hpp"
#include "frf/runs/run_table.hpp"

namespace stageid {

/// The runs of one realization, added in any order. Their scatters, the largest part, are separate, because the noise
/// may differ between experiments. The next realization reuses their memory.
class RealizationSpectra {
 public:
  /// `excitation`: R of each experiment, excited axes x lines; `pool`: source of the scatters' memory.
  RealizationSpectra(int realization, std::vector<Eigen::MatrixXcd> excitation, MatrixPool& pool);
  ~RealizationSpectra();
  RealizationSpectra(const RealizationSpectra&) = delete;
  RealizationSpectra& operator=(const RealizationSpectra&) = delete;

  /// Not safe for concurrent use.
  void add(std::size_t experiment, RunSpectra&& spectra);

  int realization() const noexcept { return realization_; }
  Eigen::Index experiments() const noexcept { return std::ssize(runs_); }

  /// At line k, one column per experiment: R (axes x E) and Z = [Y; U] (n_y + n_u x E).
  Eigen::MatrixXcd excitation(Eigen::Index k) const;
  Eigen::MatrixXcd response(Eigen::Index k) const;

  const std::vector<RunSpectra>& runs() const noexcept { return runs_; }  ///< by experiment

  /// Degrees of freedom of scatter(): sum_e (P_e - 1), or those of the transient models. The scatter is scaled for
  /// this number, even if a line has fewer.
  int scatter_dof() const;
  double scatter_dof(Eigen::Index k) const;  ///< of line k
  /// sum_e sum_p (Z_pe - Z_e)(Z_pe - Z_e)^H at line k, or the equivalent from the residuals of the transient models;
  /// full Hermitian matrix.
  Eigen::MatrixXcd scatter(Eigen::Index k) const;

 private:
  MatrixPool& pool_;
  int realization_;
  std::vector<Eigen::MatrixXcd> excitation_;
  std::vector<RunSpectra> runs_;
};

/// Refuses inputs that are constant throughout a realization. They make U singular on every line, and this error
/// names the channel instead of a line.
/// @throws std::invalid_argument naming the first such channel
void refuse_constant_inputs(const RealizationRuns& realization, const RealizationSpectra& spectra,
                            const ChannelChoice& channels);

}  // namespace stageid
