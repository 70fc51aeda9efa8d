#pragma once

#include <Eigen/Core>
#include <vector>

#include "frf/response/nonlinearity.hpp"
#include "frf/runs/realization_spectra.hpp"

namespace stageid {

/// Accumulates LineAlignment over realizations. Spectra contain the excited lines first, then the detection
/// lines.
class AlignmentAverage {
 public:
  /// `excited`, `detection`: ascending.
  AlignmentAverage(std::vector<int> excited, const std::vector<int>& detection,
                   Eigen::Index outputs);

  /// `G_before`: (n_y n_u) x excited lines, the mean of the previous realizations, which does not contain the noise
  /// of this one; used from the second realization on. `G`: includes this realization, for the detection lines.
  void add(const RealizationSpectra& spectra, const Eigen::MatrixXcd& G_before,
           const Eigen::MatrixXcd& G, int workers);

  /// `resolution_hz`: distance of neighbouring lines.
  LineAlignment finish(double resolution_hz) const;

 private:
  void add_run(const Eigen::MatrixXcd& residual, const Eigen::VectorXd& smallest);

  std::vector<int> excited_;
  std::vector<int> lines_;            // of both, ascending
  std::vector<Eigen::Index> column_;  // index into the spectra for each of lines_
  Eigen::Index outputs_;
  bool first_ = true;
  LineAlignment sum_;
};

}  // namespace stageid
